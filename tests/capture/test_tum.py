from __future__ import annotations

from pathlib import Path
from time import process_time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from capture import TextFileError, read_planar_tum, read_tum, write_tum
from geometry import Trajectory

ROW = "{} 1 2 0 0 0 0 1\n"


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "path.tum"
    file.write_text(text)
    return file


def refusal(file: Path) -> str:
    with pytest.raises(TextFileError) as caught:
        read_tum(file)
    return str(caught.value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_trajectory_survives_to_the_last_bit(tmp_path: Path, data: st.DataObject) -> None:
    n = data.draw(st.integers(1, 8))
    t_ns = np.cumsum(data.draw(st.lists(st.integers(1, 10**18), min_size=n, max_size=n)))
    lengths = st.lists(st.floats(-1e6, 1e6), min_size=n, max_size=n)
    turns = st.floats(-np.pi, np.pi, exclude_min=True).filter(lambda a: a == 0 or abs(a) > 1e-300)
    angles = st.lists(turns, min_size=n, max_size=n)
    before = Trajectory(t_ns, *(np.array(data.draw(each)) for each in (lengths, lengths, angles)))
    write_tum(tmp_path / "a.tum", before)
    after, dropped = read_planar_tum(tmp_path / "a.tum")
    write_tum(tmp_path / "b.tum", after)
    assert dropped == 0
    np.testing.assert_array_equal(after.t_ns, before.t_ns)
    np.testing.assert_array_equal(after.poses, before.poses)
    assert (tmp_path / "a.tum").read_bytes() == (tmp_path / "b.tum").read_bytes()


def test_comments_blank_lines_and_any_separator(tmp_path: Path) -> None:
    text = "\ufeff# a_comment, 1\n\n0.5 1 2 0 0 0 0 1\n1.5\t3\t4\t0\t0\t0\t0\t1  # note\n"
    text += "   # indented\n 2.5, 5, 6, 0, 0, 0, 0, 1\r\n"
    path = read_tum(written(tmp_path, text)).path
    assert path.t_ns.tolist() == [500_000_000, 1_500_000_000, 2_500_000_000]
    assert path.positions[:, 0].tolist() == [1, 3, 5]


def test_stamps_need_no_order(tmp_path: Path) -> None:
    path = read_tum(written(tmp_path, ROW.format(2) + ROW.format(1) + ROW.format(1.5))).path
    assert (path.t_ns / 1e9).tolist() == [1, 1.5, 2]


def test_stamps_are_exact_beyond_a_double(tmp_path: Path) -> None:
    text = ROW.format("1700000000.123456789") + ROW.format("1.700000000123456790e9")
    path = read_tum(written(tmp_path, text)).path
    assert path.t_ns.tolist() == [1_700_000_000_123_456_789, 1_700_000_000_123_456_790]


def test_poses_that_are_not_finite_are_dropped_and_counted(tmp_path: Path) -> None:
    text = ROW.format(1) + "2 nan nan 0 0 0 0 1\n3 1 2 0 0 0 inf 1\n" + ROW.format(4)
    found = read_tum(written(tmp_path, text))
    assert (len(found.path), found.dropped) == (2, 2)
    assert read_planar_tum(found.file)[1] == 2


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["path.tum: holds no line of numbers", "expected 8 columns (t x y z qx qy qz qw)"]),
        ("# only this\n", ["holds no line of numbers"]),
        (ROW.format(1) + "2 1 2 0 0 0 1\n", ["path.tum:2: 7 columns", "expected 8", "correct"]),
        (ROW.format(1) + "2 1 2 0 0 0 0 1 9\n", ["path.tum:2: 9 columns"]),
        ("# t\n1 1 2 0 0 0 0 1 9\n", ["path.tum:2: 9 columns"]),
        (ROW.format(1) + "2 1 x 0 0 0 0 1\n", ["path.tum:2: y: expected a number, found 'x'"]),
        ("t x y z qx qy qz qw\n" + ROW.format(1), ["path.tum:1: t: 't' is no time", "with #"]),
        (ROW.format("nan"), ["path.tum:1: t: 'nan' is no time in seconds"]),
        (ROW.format("1403636579763555584"), ["path.tum:1: t: ", "beyond the years"]),
        ("1 1_0 2 0 0 0 0 1\n", ["path.tum:1: x: expected a number, found '1_0'"]),
        (ROW.format(1) + ROW.format(2) + ROW.format(1), ["path.tum:3: ", "line 1", "delete one"]),
        ("1 nan 2 0 0 0 0 1\n", ["path.tum:1: none of the 1 poses is finite"]),
        (ROW.format(1) + "2 1 2 0 0 0 0 0\n", ["path.tum:2: the quaternion has length 0.000"]),
    ],
)
def test_a_malformed_file_is_refused_with_place_and_remedy(
    tmp_path: Path, text: str, parts: list[str]
) -> None:
    message = refusal(written(tmp_path, text))
    assert [part for part in parts if part not in message] == []


def test_a_file_that_is_no_text(tmp_path: Path) -> None:
    file = tmp_path / "path.tum"
    file.write_bytes(b"1 2 \xff\xfe")
    assert "byte 4 is not UTF-8" in refusal(file)
    assert "there is no such file" in refusal(tmp_path / "absent.tum")


def test_an_unreadable_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def deny(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied")

    file = written(tmp_path, ROW.format(1))
    monkeypatch.setattr(Path, "read_text", deny)
    assert "cannot be read: Permission denied; check owner and mode" in refusal(file)


@pytest.mark.parametrize(
    ("row", "found"),
    [
        ("2 1 2 0.06 0 0 0 1\n", "z ranges over 0.060 m"),
        ("2 1 2 0 0.05 0 0 0.99875\n", "the tilt reaches 5.7 deg"),
    ],
)
def test_a_path_that_leaves_the_plane_is_no_trajectory(
    tmp_path: Path, row: str, found: str
) -> None:
    file = written(tmp_path, ROW.format(1) + row)
    assert len(read_tum(file).path) == 2
    with pytest.raises(TextFileError, match=r"path\.tum: .*--space 3d") as caught:
        read_planar_tum(file)
    assert found in str(caught.value)


def test_a_slightly_tilted_path_keeps_its_yaw(tmp_path: Path) -> None:
    trajectory, _ = read_planar_tum(written(tmp_path, "1 1 2 0.01 0.01 0 0.6 0.8\n"))
    np.testing.assert_allclose(trajectory.heading, [2 * np.arctan2(0.6, 0.8)], atol=1e-3)


def test_reading_is_fast_enough_for_a_quarter_of_an_hour(tmp_path: Path) -> None:
    n = 10_000
    rng = np.random.default_rng(2)
    t_ns = 1_700_000_000_000_000_000 + 15_000_000 * np.arange(n)
    x, y, heading = rng.normal(size=n), rng.normal(size=n), rng.uniform(-3, 3, n)
    write_tum(tmp_path / "a.tum", Trajectory(t_ns, x, y, heading))
    spent_s = []
    for _ in range(3):
        start_s = process_time()
        read_tum(tmp_path / "a.tum")
        spent_s.append(process_time() - start_s)
    # 0.03 s on the reference machine; the factor leaves room for slower ones.
    assert min(spent_s) < 0.15


@pytest.mark.realdata
def test_the_tum_benchmark_files_are_read(data_dir: Path) -> None:
    truth = read_tum(data_dir / "trajectories" / "freiburg1_xyz-groundtruth.txt")
    estimate = read_tum(data_dir / "trajectories" / "freiburg1_xyz-rgbdslam.txt")
    assert (len(truth.path), len(estimate.path)) == (3000, 788)
    assert (truth.dropped, estimate.dropped) == (0, 0)
    assert truth.path.t_ns[0] == 1_305_031_098_665_900_000
    with pytest.raises(TextFileError, match="leaves the plane"):
        read_planar_tum(truth.file)
