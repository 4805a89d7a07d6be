from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from test_recorder import TENTHS, record
from toy_devices import ToyClocks, ToyDevice

from capture.errors import SessionError
from capture.recording.check import checked
from capture.recording.recover import recover
from capture.session import Session
from capture.session_info import SessionInfo, write_session_info


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    folder = tmp_path / "session"
    record(folder, ToyClocks(), [ToyDevice("lidar", TENTHS), ToyDevice("imu", TENTHS)])
    return folder


def cut(folder: Path, size: int) -> None:
    """What a power cut leaves: a log without an end, no metadata, no verdict."""
    log = folder / "car.mcap"
    log.write_bytes(log.read_bytes()[:size])
    (folder / "metadata.yaml").unlink()
    info = Session.open(folder).info
    before = SessionInfo(
        map=info.map,
        clocks=info.clocks[:1],
        configuration=info.configuration,
        devices=info.devices,
    )
    write_session_info(folder, before)


def test_a_broken_recording_gets_its_end_and_its_verdict(recording: Path) -> None:
    whole = Session.open(recording)
    counts = {topic.name: topic.count for topic in whole.topics}
    # the footer and the summary are gone, every chunk is there
    size = (recording / "car.mcap").read_bytes().rindex(b"\x0f\x04\x00\x00\x00\x00\x00\x00\x00")
    cut(recording, size)
    assert Session.open(recording).truncated
    (log,), verdict = recover(recording)
    assert log.kept_as == "car.mcap.unfinished"
    assert (recording / log.kept_as).stat().st_size == size
    again = Session.open(recording)
    assert not again.truncated
    assert {topic.name: topic.count for topic in again.topics} == counts
    assert again.info.verdict == verdict.verdict == "good"
    assert "recovered after a power cut" in again.info.verdict_reason
    with AnyReader([recording]) as reader:
        assert reader.message_count == sum(counts.values())
    with (recording / "car.mcap").open("rb") as stream:
        assert sum(1 for _ in make_reader(stream).iter_messages()) == sum(counts.values())


def test_recovering_twice_changes_nothing(recording: Path) -> None:
    cut(recording, (recording / "car.mcap").stat().st_size - 200)
    recover(recording)
    before = (recording / "session.yaml").read_bytes(), (recording / "car.mcap").read_bytes()
    done, _ = recover(recording)
    assert done == ()
    after = (recording / "session.yaml").read_bytes(), (recording / "car.mcap").read_bytes()
    assert after == before


def test_a_log_that_broke_before_its_first_second_is_set_aside(recording: Path) -> None:
    cut(recording, 60)
    done, verdict = recover(recording)
    assert done == ()
    assert verdict.verdict == "bad"
    assert "nothing was recorded" in verdict.text
    assert (recording / "car.mcap.unfinished").exists()


def test_a_whole_recording_is_left_as_it_is(recording: Path) -> None:
    before = (recording / "car.mcap").read_bytes()
    done, verdict = recover(recording)
    assert done == ()
    assert verdict.verdict == "good"
    assert (recording / "car.mcap").read_bytes() == before


def test_a_session_that_trackside_did_not_record_cannot_be_checked(tmp_path: Path) -> None:
    write_session_info(tmp_path, SessionInfo(map="turn"))
    with pytest.raises(SessionError, match="was not recorded by trackside record"):
        checked(Session.open(tmp_path))
