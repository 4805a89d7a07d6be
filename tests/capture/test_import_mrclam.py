from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from capture import Session, SessionError, TextFileError
from capture.import_mrclam import import_mrclam
from dialogue import UsageError
from geometry import between, compose


@pytest.fixture
def data_set(tmp_path: Path) -> Path:
    """A data set of one robot, with every fault that the real ones have."""
    folder = tmp_path / "MRCLAM_Dataset9"
    folder.mkdir()
    files = {
        "Barcodes.dat": "# Subject Barcode\n 1 \t 5\n 2 \t 14\n 6 \t 63\n 7 \t 81\n",
        "Landmark_Groundtruth.dat": "6 1.0 -4.0 0.1 0.2\n7 \t 2.0 \t 3.0 0.3 0.4\n",
        "Robot1_Odometry.dat": "# t v w\n100.000 1.0 0.0\n101.000 2.0 0.0\n101.000 9.0 0.0\n"
        "103.000 0.0 0.5\n104.000 0.0 0.0\n",
        "Robot1_Measurement.dat": "100.500 63 2.0 0.1\n100.500 14 1.0 0.2\n100.500 81 3.0 -0.3\n"
        "102.250 99 1.0 0.0\n102.125 63 2.5 0.4\n",
        "Robot1_Groundtruth.dat": "99.001 0 0 0.5\n99.003 2 0 0.5\n99.002 1 0 0.5\n99.003 9 9 9\n",
    }
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


def test_what_is_taken_and_what_is_left_out(data_set: Path, tmp_path: Path) -> None:
    counts = import_mrclam(data_set, 1, tmp_path / "run")
    assert asdict(counts) == {
        "odometry": 4,
        "observations": 3,
        "truth_poses": 3,
        "landmarks": 2,
        "robot_sightings": 1,
        "unknown_barcodes": 1,
        "repeated_truth_stamps": 1,
        "repeated_odometry_stamps": 1,
    }
    origin = Session.open(tmp_path / "run").info.origin
    assert (origin["folder"], origin["robot"]) == ("MRCLAM_Dataset9", 1)
    assert origin["counts"] == asdict(counts)


def test_streams_of_the_session(data_set: Path, tmp_path: Path) -> None:
    import_mrclam(data_set, 1, tmp_path / "run")
    session = Session.open(tmp_path / "run")
    odometry = session.odometry()
    assert odometry.source == "wheel"
    assert (odometry.t_ns // 1_000_000_000).tolist() == [100, 101, 103, 104]
    assert odometry.speed_m_s.tolist() == [1, 2, 0, 0]
    np.testing.assert_allclose(odometry.pose_odom_base[:, 0], [0, 1, 5, 5])
    np.testing.assert_allclose(odometry.pose_odom_base[-1, 2], 0.5)
    seen = session.observations()
    assert seen.t_ns.tolist() == [100_500_000_000] * 2 + [102_125_000_000]
    assert seen.landmark_id.tolist() == [6, 7, 6]
    assert seen.range_m.tolist() == [2.0, 3.0, 2.5]
    truth = session.ground_truth()
    assert truth.path.t_ns.tolist() == [99_001_000_000, 99_002_000_000, 99_003_000_000]
    assert truth.path.x.tolist() == [0, 1, 2]
    assert truth.landmarks is not None
    assert truth.landmarks.covariances is not None
    np.testing.assert_allclose(truth.landmarks.covariances[1], [[0.09, 0], [0, 0.16]])


def test_a_robot_that_is_not_there(data_set: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"has no robot 3; robots there: 1; .*--robot N"):
        import_mrclam(data_set, 3, tmp_path / "run")
    with pytest.raises(UsageError, match=r"robots there: none"):
        import_mrclam(tmp_path / "absent", 1, tmp_path / "run")


@pytest.mark.parametrize(
    ("file", "text", "place"),
    [
        ("Robot1_Odometry.dat", "100 1\n", r"Robot1_Odometry\.dat:1: 2 columns; expected 3"),
        ("Robot1_Measurement.dat", "", r"Robot1_Measurement\.dat: holds no line of numbers"),
        ("Barcodes.dat", "6 63\n7 81\n6 9\n", r"Barcodes\.dat:3: subject 6 stands in line 1"),
        ("Landmark_Groundtruth.dat", "6 1 x 0 0\n", r"Groundtruth\.dat:1: y: expected a number"),
    ],
)
def test_a_malformed_file_leaves_nothing_behind(
    data_set: Path, tmp_path: Path, file: str, text: str, place: str
) -> None:
    (data_set / file).write_text(text)
    with pytest.raises(TextFileError, match=place):
        import_mrclam(data_set, 1, tmp_path / "run")
    assert [child.name for child in tmp_path.iterdir()] == [data_set.name]


def test_an_existing_session_is_kept(data_set: Path, tmp_path: Path) -> None:
    import_mrclam(data_set, 1, tmp_path / "run")
    with pytest.raises(SessionError, match="exists already"):
        import_mrclam(data_set, 1, tmp_path / "run")


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("robot", "rmse_m"), [(1, 4.09), (2, 2.04), (3, 3.02), (4, 2.90), (5, 2.98)]
)
def test_dead_reckoning_drifts_as_measured(
    data_dir: Path, tmp_path: Path, robot: int, rmse_m: float
) -> None:
    import_mrclam(data_dir / "mrclam" / "MRCLAM_Dataset7", robot, tmp_path / "run")
    session = Session.open(tmp_path / "run")
    odometry, truth = session.odometry(), session.ground_truth().path
    covered = (odometry.t_ns >= truth.t_ns[0]) & (odometry.t_ns <= truth.t_ns[-1])
    pose, true = odometry.pose_odom_base[covered], truth.interpolated(odometry.t_ns[covered])
    reckoned = compose(true.poses[0], between(pose[0], pose))
    error_m = np.hypot(reckoned[:, 0] - true.x, reckoned[:, 1] - true.y)
    assert np.sqrt(np.mean(error_m**2)) == pytest.approx(rmse_m, abs=0.005)
    assert set(session.observations().landmark_id.tolist()) == set(range(6, 21))
