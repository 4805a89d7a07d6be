"""`trackside simulate`: what it makes, and that it makes nothing half."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from capture import Session, read_camera_calibration, read_world_calibration
from capture.result_files import read_ground_truth
from dialogue import TracksideError, UsageError
from geometry import wrap
from simulation.recordings import film_to_car
from simulation.world import world
from tracking.scene import read_scene
from trackside.cli import trackside
from trackside.virtual.day import whole


def simulate(*words: str) -> str:
    done = CliRunner().invoke(trackside, ["simulate", *words])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return str(done.stdout)


def test_without_a_film_the_session_can_be_scored_at_once(tmp_path: Path) -> None:
    said = simulate("--map", "loop", "--power", "medium", "--no-film", "-o", str(tmp_path / "run"))
    assert f"next: trackside slam {tmp_path / 'run' / 'car'}" in said
    session = Session.open(tmp_path / "run" / "car")
    assert session.has_ground_truth
    assert session.info.map == "loop"
    assert (tmp_path / "run" / "truth" / "car.tum").exists()


@pytest.mark.slow
def test_the_tracked_film_is_within_millimetres_of_the_truth(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    simulate("--map", "s-curve", "--power", "high", "--seed", "4", "-o", str(folder))
    read_camera_calibration(folder / "calibration")
    assert read_world_calibration(folder / "film" / "calibration").accepted
    assert read_scene(folder / "scene.yaml").cones.height_m == 0.30
    words = ["track", str(folder / "film"), "--scene", str(folder / "scene.yaml"), "--no-clip"]
    assert CliRunner().invoke(trackside, words).exit_code == 0
    found, true = Session.open(folder / "film").ground_truth(), read_ground_truth(folder / "truth")
    offset_s, _ = film_to_car(world("s-curve", "high", 4))
    t_ns = found.path.t_ns + round(offset_s * 1e9)
    inside = (t_ns > true.path.t_ns[0]) & (t_ns < true.path.t_ns[-1])
    exact = true.path.interpolated(t_ns[inside])
    path = found.path.selected(inside)
    assert abs(path.positions - exact.positions).max() < 0.005
    assert abs(wrap(path.heading - exact.heading)).max() < 0.0087
    assert found.landmarks is not None
    assert true.landmarks is not None
    assert len(found.landmarks) == len(true.landmarks)


def test_a_folder_that_exists_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    with pytest.raises(TracksideError, match="exists"):
        simulate("--no-film", "-o", str(tmp_path / "run"))
    assert list((tmp_path / "run").iterdir()) == []


def test_a_wrong_map_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such map"):
        simulate("--map", "tnru", "--no-film", "-o", str(tmp_path / "run"))
    assert list(tmp_path.iterdir()) == []


def test_a_site_without_calibrations_is_told_and_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "site").mkdir()
    with pytest.raises(TracksideError, match="camera"):
        simulate("--site", str(tmp_path / "site"), "-o", str(tmp_path / "run"))
    assert [child.name for child in tmp_path.iterdir()] == ["site"]


def test_parts_of_steps_add_up_to_whole_ones() -> None:
    told: list[int] = []
    advance = whole(told.append)
    for _ in range(10):
        advance(0.25)
    assert sum(told) == 2
