from __future__ import annotations

import errno
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from small_session import (
    START_NS,
    estimate,
    landmarks,
    make_session,
    observations,
    odometry,
    trajectory,
)

from capture import (
    ClockPair,
    Estimate,
    GroundTruth,
    LogError,
    MissingStreamError,
    Session,
    SessionError,
    SessionInfo,
    TextFileError,
    list_sessions,
)
from dialogue import UsageError


def cut_off(session: Session) -> None:
    """Take the end of the log away, as a power cut does."""
    log = session.folder / "car.mcap"
    log.write_bytes(log.read_bytes()[:-200])


def full_disk(_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_streams_and_truth_come_back(tmp_path: Path) -> None:
    session = make_session(tmp_path / "run")
    assert (session.name, session.info.map, session.info.trial) == ("run", "turn", 2)
    np.testing.assert_array_equal(session.odometry().pose_odom_base, odometry().pose_odom_base)
    np.testing.assert_array_equal(session.observations().range_m, observations().range_m)
    truth = session.ground_truth()
    np.testing.assert_array_equal(truth.path.poses, trajectory().poses)
    assert truth.landmarks is not None
    np.testing.assert_array_equal(truth.landmarks.positions, landmarks().positions)
    assert truth.provenance == {"by": "test"}
    assert (session.truncated, session.remarks) == (False, ())
    assert [child.name for child in tmp_path.iterdir()] == ["run"]


def test_ros_tools_open_the_folder(tmp_path: Path) -> None:
    session = make_session(tmp_path / "run")
    with AnyReader([session.folder]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        times = [t for _, t, _ in reader.messages()]
        assert reader.start_time == START_NS
    assert counts == {"/wheel/odom": 50, "/landmarks/observed": 3}
    assert times == sorted(times)
    assert len(times) == 53


def test_session_yaml_keeps_everything(tmp_path: Path) -> None:
    info = SessionInfo(
        map="s-curve",
        power="low",
        trial=4,
        start_utc="2026-05-14T10:00:00+00:00",
        clocks=(ClockPair(monotonic_ns=5, utc_ns=START_NS),),
        devices={"lidar": {"model": "A2", "serial": "00e1"}},
        configuration={"rate_hz": 10.0},
        verdict="bad",
        verdict_reason="rear wheel: loose",
        notes="wet floor\nsecond line",
        origin={"left_out": {"/tf": 3}},
    )
    with Session.create(tmp_path / "run", info):
        pass
    assert Session.open(tmp_path / "run").info == info


def test_the_preferred_source_of_odometry_is_taken(tmp_path: Path) -> None:
    session = make_session(tmp_path / "run", "viso", "other", "zed", "wheel")
    assert session.odometry_sources == ("wheel", "zed", "viso", "other")
    assert session.odometry().source == "wheel"
    assert session.odometry("viso").source == "viso"


@pytest.mark.parametrize(
    ("reader", "what"),
    [("scans", "/scan"), ("imu", "/imu/data_raw"), ("vesc_state", "/vesc/state")],
)
def test_a_missing_stream_names_what_there_is(tmp_path: Path, reader: str, what: str) -> None:
    session = make_session(tmp_path / "run")
    expected = rf"run: has no .*\(topic {what}\); it has: /landmarks/observed \(3\), /wheel/odom"
    with pytest.raises(MissingStreamError, match=expected):
        getattr(session, reader)()


def test_a_missing_source_names_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(MissingStreamError, match=r"topic /vesc/odom.*/wheel/odom \(50\)"):
        make_session(tmp_path / "run").odometry("vesc")


def test_a_session_without_a_log_says_so(tmp_path: Path) -> None:
    with Session.create(tmp_path / "run", SessionInfo()) as writer:
        writer.add_ground_truth(GroundTruth(trajectory()))
    session = Session.open(tmp_path / "run")
    assert session.ground_truth().landmarks is None
    with pytest.raises(MissingStreamError, match=r"has no odometry .* it has: no log at all"):
        session.odometry()


def test_a_missing_truth_or_estimate(tmp_path: Path) -> None:
    with Session.create(tmp_path / "run", SessionInfo()):
        pass
    session = Session.open(tmp_path / "run")
    with pytest.raises(MissingStreamError, match=r"no ground truth .* trackside track"):
        session.ground_truth()
    session.write_estimate(estimate("ekf"))
    with pytest.raises(MissingStreamError, match=r"no estimate 'fast'; it has: ekf"):
        session.estimate("fast")


def test_an_estimate_survives_to_the_last_bit(tmp_path: Path) -> None:
    session = make_session(tmp_path / "run")
    made = estimate()
    session.write_estimate(made)
    assert session.estimates == ("ekf",)
    found = session.estimate("ekf")
    np.testing.assert_array_equal(found.path.poses, made.path.poses)
    assert found.map is not None
    assert made.map is not None
    np.testing.assert_array_equal(found.map.range_added_m, made.map.range_added_m)
    assert made.path_covariances is not None
    np.testing.assert_array_equal(found.path_covariances, made.path_covariances)
    assert found.provenance == {"seed": 3, "gates": [1, 2]}


def test_an_estimate_is_replaced_only_when_asked(tmp_path: Path) -> None:
    session = make_session(tmp_path / "run")
    session.write_estimate(estimate())
    shorter = Estimate("ekf", trajectory(5))
    with pytest.raises(SessionError, match="exists already"):
        session.write_estimate(shorter)
    assert len(session.estimate("ekf").path) == 20
    session.write_estimate(shorter, replace=True)
    assert len(session.estimate("ekf").path) == 5
    assert session.estimate("ekf").map is None
    with pytest.raises(SessionError, match="exists already"):
        session.write_ground_truth(GroundTruth(trajectory(3)))


@pytest.mark.parametrize("name", ["", "../ekf", "a/b", ".hidden", "a b"])
def test_a_name_that_is_no_folder_name(tmp_path: Path, name: str) -> None:
    session = make_session(tmp_path / "run")
    with pytest.raises(UsageError, match="cannot name an estimate; use letters"):
        session.write_estimate(replace(estimate(), name=name))
    with pytest.raises(UsageError):
        session.score_file(name)


def test_covariances_of_another_path_are_refused(tmp_path: Path) -> None:
    session = make_session(tmp_path / "run")
    session.write_estimate(estimate())
    file = session.folder / "estimates" / "ekf" / "path_covariance.csv"
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(TextFileError, match=r"path_covariance\.csv: its 19 stamps.* 20 poses"):
        session.estimate("ekf")


def test_what_is_no_session(tmp_path: Path) -> None:
    make_session(tmp_path / "runs" / "one")
    with pytest.raises(SessionError, match=r"is no session .* give one of them, such as .*one"):
        Session.open(tmp_path / "runs")
    with pytest.raises(SessionError, match=r"is no session .* trackside record or trackside imp"):
        Session.open(tmp_path / "runs" / "one" / "ground_truth")
    with pytest.raises(SessionError, match=r"absent: there is no such folder; check the path"):
        Session.open(tmp_path / "absent")


def test_a_newer_format_is_refused_by_number(tmp_path: Path) -> None:
    file = make_session(tmp_path / "run").folder / "session.yaml"
    file.write_text(file.read_text().replace("format: 1", "format: 2\nnew_key: 3"))
    with pytest.raises(SessionError, match=r"format 2; this trackside .* up to 1; update"):
        Session.open(tmp_path / "run")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("format: 1\ntrail: 2\n", r"session\.yaml:2:1: trail: unknown key; did you mean 'trial'"),
        ("format: [", r"session\.yaml: no valid YAML"),
        ("", r"session\.yaml: expected keys with values"),
    ],
)
def test_a_damaged_session_yaml(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "session.yaml").write_text(text)
    with pytest.raises(SessionError, match=message):
        Session.open(tmp_path / "run")


def test_an_unreadable_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def deny(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied")

    session = make_session(tmp_path / "run")
    monkeypatch.setattr(Path, "read_text", deny)
    with pytest.raises(SessionError, match=r"run.* cannot be read: Permission denied; check"):
        Session.open(session.folder)
    monkeypatch.setattr(Path, "exists", deny)
    with pytest.raises(SessionError, match=r"run.* cannot be read: Permission denied; check"):
        Session.open(session.folder)
    monkeypatch.undo()
    monkeypatch.setattr(Path, "iterdir", deny)
    with pytest.raises(SessionError, match=r"cannot be read: Permission denied; check"):
        list_sessions(tmp_path)


def test_a_truncated_log_is_read_and_told(tmp_path: Path) -> None:
    session = make_session(tmp_path / "run")
    cut_off(session)
    session = Session.open(session.folder)
    assert session.truncated
    assert "has no end" in session.remarks[0]
    assert session.odometry().t_ns.size == 50


def test_a_full_disk_leaves_no_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(LogError, match=r"cannot write .*: No space left on device .*MB free"):
        make_session(tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_the_old_estimate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = make_session(tmp_path / "run")
    session.write_estimate(estimate())
    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(LogError, match="No space left"):
        session.write_estimate(Estimate("ekf", trajectory(5)), replace=True)
    monkeypatch.undo()
    assert len(session.estimate("ekf").path) == 20
    assert [child.name for child in (session.folder / "estimates").iterdir()] == ["ekf"]


def test_nothing_is_ever_overwritten(tmp_path: Path) -> None:
    make_session(tmp_path / "run")
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    with pytest.raises(SessionError, match="nothing in it is ever overwritten"):
        make_session(tmp_path / "run", "vesc")
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before


def test_the_same_values_make_the_same_bytes(tmp_path: Path) -> None:
    first, second = make_session(tmp_path / "a"), make_session(tmp_path / "b")
    for session in (first, second):
        session.write_estimate(estimate())
    names = sorted(f.relative_to(first.folder) for f in first.folder.rglob("*") if f.is_file())
    different = [
        str(name)
        for name in names
        if (first.folder / name).read_bytes() != (second.folder / name).read_bytes()
    ]
    assert len(names) == 10
    assert different == []


def test_calibrations_are_copied_once(tmp_path: Path) -> None:
    session = make_session(tmp_path / "run")
    (tmp_path / "camera.yaml").write_text("fx: 500.0\n")
    session.copy_calibration(tmp_path / "camera.yaml")
    assert [file.read_text() for file in session.calibrations] == ["fx: 500.0\n"]
    with pytest.raises(SessionError, match=r"camera\.yaml exists already"):
        session.copy_calibration(tmp_path / "camera.yaml")
    with pytest.raises(TextFileError, match="no such file"):
        session.copy_calibration(tmp_path / "absent.yaml")


def test_sessions_are_listed_by_name(tmp_path: Path) -> None:
    for name in ("b", "a"):
        make_session(tmp_path / name)
    shutil.copytree(tmp_path / "a", tmp_path / ".a.partial-x")
    (tmp_path / "notes").mkdir()
    assert list_sessions(tmp_path) == (tmp_path / "a", tmp_path / "b")
    assert list_sessions(tmp_path / "a") == (tmp_path / "a",)
    with pytest.raises(SessionError, match="holds no sessions"):
        list_sessions(tmp_path / "notes")
