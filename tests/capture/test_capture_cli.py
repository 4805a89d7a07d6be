from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from small_session import estimate, make_session, trajectory

from capture import write_tum
from capture.cli import export_group, import_group, info
from dialogue import TABLE_FORMATS, UsageError


def lines(command: object, *words: object) -> list[str]:
    """What a command prints on standard output; its errors are raised."""
    result = CliRunner().invoke(command, [str(word) for word in words], catch_exceptions=False)  # type: ignore[arg-type]  # a command or a group
    assert result.exit_code == 0, result.output
    return result.stdout.splitlines()


def test_import_tells_what_it_wrote_and_what_comes_next(tmp_path: Path) -> None:
    write_tum(tmp_path / "truth.tum", trajectory())
    truth, run = tmp_path / "truth.tum", tmp_path / "run"
    assert lines(import_group, "tum", "--truth", truth, "--path", truth, "-o", run) == [
        "ground truth: 20 poses",
        "estimate imported: 20 poses",
        f"wrote {run}",
        f"next: trackside score {run}",
    ]


def test_import_of_a_bag_prints_what_became_of_each_topic(tmp_path: Path) -> None:
    log = make_session(tmp_path / "run").folder / "car.mcap"
    out = lines(import_group, "bag", log, "-o", tmp_path / "new", "--topic", "observations=none")
    assert out[0].split() == ["topic", "role", "in", "the", "session", "count", "rate", "[Hz]"]
    assert out[2].split() == ["/wheel/odom", "wheel", "/wheel/odom", "50", "50.0"]
    assert out[3].startswith("/landmarks/observed  left out (trackside_msgs/msg/RangeBearingArray)")
    assert out[-1] == f"next: trackside info {tmp_path / 'new'}"
    assert lines(import_group, "bag", log, "-o", tmp_path / "b")[-1].startswith(
        "next: trackside slam"
    )


@pytest.mark.realdata
def test_import_of_a_data_set_prints_what_it_left_out(data_dir: Path, tmp_path: Path) -> None:
    folder, run = data_dir / "mrclam" / "MRCLAM_Dataset7", tmp_path / "run"
    assert lines(import_group, "mrclam", folder, "--robot", 3, "-o", run) == [
        "odometry /wheel/odom: 55078",
        "observations /landmarks/observed: 4425",
        "ground truth: 53545 poses, 15 landmarks",
        "left out: 965 sightings of other robots, 9 of unknown barcodes, "
        "7 odometry lines and 0 truth lines with a repeated stamp",
        f"wrote {run}",
        f"next: trackside slam {run}",
    ]


@pytest.mark.parametrize("wish", ["scan", "=x", "scan="])
def test_a_malformed_wish(tmp_path: Path, wish: str) -> None:
    with pytest.raises(UsageError, match="expected ROLE=TOPIC, such as"):
        lines(import_group, "bag", tmp_path, "-o", tmp_path / "new", "--topic", wish)


def test_exports_name_their_files(tmp_path: Path) -> None:
    run = make_session(tmp_path / "run").folder
    out = tmp_path / "out"
    assert lines(export_group, "tum", run, "-o", out) == [
        f"wrote {out / 'ground_truth.tum'}",
        f"wrote {out / 'odometry_wheel.tum'}",
    ]
    assert f"wrote {tmp_path / 'csv' / 'cones.csv'}" in lines(
        export_group, "csv", run, "-o", tmp_path / "csv"
    )
    assert lines(export_group, "rosbag1", run, "-o", tmp_path / "a.bag")[:2] == [
        "/landmarks/observed: 3",
        "/wheel/odom: 50",
    ]
    assert lines(export_group, "rosbag2", run, "-o", tmp_path / "bag")[2:] == [
        f"wrote {tmp_path / 'bag'}",
        f"next: ros2 bag play {tmp_path / 'bag'}",
    ]


def test_info_tells_streams_truth_and_estimates(tmp_path: Path) -> None:
    session = make_session(tmp_path / "run")
    session.write_estimate(estimate())
    found = json.loads("\n".join(lines(info, session.folder, "--format", "json")))
    counts = [(row["stream"], row["type"].split("/")[-1], row["count"]) for row in found["rows"]]
    assert found["title"] == "run turn"
    assert counts == [
        ("/landmarks/observed", "RangeBearingArray", 3),
        ("/wheel/odom", "Odometry", 50),
        ("ground_truth", "path", 20),
        ("ground_truth", "landmarks", 2),
        ("estimates/ekf", "path", 20),
        ("estimates/ekf", "landmarks", 2),
    ]
    assert found["rows"][1]["rate [Hz]"] == pytest.approx(50.0)
    assert found["rows"][1]["duration [s]"] == pytest.approx(0.98)


@pytest.mark.parametrize("table_format", TABLE_FORMATS)
def test_info_comes_in_every_format(tmp_path: Path, table_format: str) -> None:
    make_session(tmp_path / "run")
    assert lines(info, tmp_path / "run", "--format", table_format)


def test_info_warns_of_a_log_without_its_end(tmp_path: Path) -> None:
    log = make_session(tmp_path / "run").folder / "car.mcap"
    log.write_bytes(log.read_bytes()[:-100])
    result = CliRunner().invoke(info, [str(tmp_path / "run")], catch_exceptions=False)
    assert "remark: car.mcap has no end" in result.stderr
