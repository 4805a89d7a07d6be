from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_session import estimate, landmarks, trajectory

from capture import (
    MissingStreamError,
    Session,
    SessionError,
    TextFileError,
    write_estimated_map,
    write_landmarks,
    write_tum,
)
from capture.import_tum import TumFiles, import_tum
from dialogue import UsageError


@pytest.fixture
def files(tmp_path: Path) -> TumFiles:
    made = estimate()
    assert made.map is not None
    write_tum(tmp_path / "truth.tum", trajectory())
    write_tum(tmp_path / "slam.tum", made.path)
    write_landmarks(tmp_path / "cones.csv", landmarks())
    write_estimated_map(tmp_path / "map.csv", made.map)
    return TumFiles(
        truth=tmp_path / "truth.tum",
        cones=tmp_path / "cones.csv",
        path=tmp_path / "slam.tum",
        map=tmp_path / "map.csv",
        name="theirs",
    )


def test_truth_and_estimate_make_a_session(files: TumFiles, tmp_path: Path) -> None:
    with files.truth.open("a") as stream:
        stream.write("9 nan 0 0 0 0 0 1\n")
    counts = import_tum(files, tmp_path / "run")
    assert (counts.truth_poses, counts.dropped_truth_poses, counts.landmarks) == (20, 1, 2)
    assert (counts.estimate_poses, counts.estimated_landmarks) == (20, 2)
    session = Session.open(tmp_path / "run")
    assert session.info.origin["dropped_poses"] == 1
    assert session.estimates == ("theirs",)
    np.testing.assert_array_equal(session.ground_truth().path.poses, trajectory().poses)
    with pytest.raises(MissingStreamError, match="no log at all"):
        session.odometry()


def test_truth_alone_is_enough(files: TumFiles, tmp_path: Path) -> None:
    counts = import_tum(TumFiles(truth=files.truth), tmp_path / "run")
    assert (counts.landmarks, counts.estimate_poses, counts.estimated_landmarks) == (None,) * 3
    assert Session.open(tmp_path / "run").estimates == ()


def test_a_map_needs_its_path(files: TumFiles, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="a map needs its path; give it with --path"):
        import_tum(TumFiles(truth=files.truth, map=files.map), tmp_path / "run")


def test_a_wrong_file_leaves_nothing_behind(files: TumFiles, tmp_path: Path) -> None:
    assert files.map is not None
    files.map.write_text("id,x,y\n1,0,0\n1,0,0\n")
    with pytest.raises(TextFileError, match=r"map\.csv:3: id 1 stands in line 2 already"):
        import_tum(files, tmp_path / "run")
    assert not (tmp_path / "run").exists()
    assert list(tmp_path.glob(".*")) == []


def test_a_bad_name_leaves_nothing_behind(files: TumFiles, tmp_path: Path) -> None:
    wrong = TumFiles(truth=files.truth, path=files.path, name="a/b")
    with pytest.raises(UsageError, match="cannot name an estimate"):
        import_tum(wrong, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_an_existing_session_is_kept(files: TumFiles, tmp_path: Path) -> None:
    import_tum(files, tmp_path / "run")
    with pytest.raises(SessionError, match="exists already"):
        import_tum(files, tmp_path / "run")
