from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader
from toy_devices import UTC_0, S, ToyClocks, ToyDevice, toy_streams

from capture.errors import LogError, SessionError
from capture.log_writer import LogWriter
from capture.recording.check import checked
from capture.recording.ledger import RecordingError
from capture.recording.recorder import Limits, Recorder
from capture.recording.recover import recover
from capture.session import Session
from capture.session_info import ClockPair, SessionInfo
from drivers import DeviceLostError, NoAnswerError

TENTHS = [k / 10 for k in range(1, 50)]


def recorder(
    folder: Path, clocks: ToyClocks, devices: Sequence[ToyDevice], limits: Limits | None = None
) -> Recorder:
    folder.mkdir(exist_ok=True)
    streams = toy_streams(clocks, devices)
    info = SessionInfo(map="turn", clocks=(ClockPair(monotonic_ns=100 * S, utc_ns=UTC_0),))
    return Recorder(folder, info, streams, clocks.utc, limits or Limits(), clocks.clocks())


def until_written(recording: Recorder, topics: int, messages: int, *, ready: bool = True) -> None:
    """Poll until the scribe has written so many messages of so many topics."""
    end_s = time.monotonic() + 20.0
    while time.monotonic() < end_s:
        recording.poll()
        counts = [w.messages for w in list(recording._ledger.scribe.watch.streams.values())]
        enough = sum(count >= messages for count in counts) >= topics
        if enough and (recording.is_ready or not ready):
            return
    raise AssertionError("the scribe did not write in time")


def record(
    folder: Path, clocks: ToyClocks, devices: Sequence[ToyDevice], seconds: float = 5.0
) -> Recorder:
    """A whole recording of these devices."""
    recording = recorder(folder, clocks, devices)
    with recording:
        until_written(recording, 2 * len(devices), 40)
        clocks.now_ns += round(seconds * S)
        recording.poll()
    return recording


def test_a_recording_holds_every_byte_and_message_and_is_good(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    devices = [ToyDevice("lidar", TENTHS), ToyDevice("imu", TENTHS)]
    made = record(folder, ToyClocks(), devices)
    assert made.verdict().verdict == "good", made.verdict().text
    assert [d.closes >= 1 for d in devices] == [True, True]
    session = Session.open(folder)
    assert session.info.verdict == "good"
    assert session.info.devices["lidar"] == {"model": "toy", "serial": "lidar"}
    assert session.log is not None
    raw = session.log.read("/raw/lidar/data")
    assert len(raw.messages) == len(TENTHS)
    assert raw.log_t_ns.tolist() == [UTC_0 + round(t * S) for t in TENTHS]
    with AnyReader([folder]) as reader:
        assert reader.message_count == sum(t.count for t in session.topics)
        for _, _, data in reader.messages():
            assert data


def test_the_verdict_is_the_same_later(tmp_path: Path) -> None:
    devices = [ToyDevice("lidar", [*TENTHS[:20], *[t + 3 for t in TENTHS[20:]]])]
    devices[0].counters.bad_frames = 7
    clocks = ToyClocks()
    clocks.utc_step_ns = 3600 * S
    made = record(tmp_path / "session", clocks, devices, 9.0)
    facts, verdict = checked(Session.open(tmp_path / "session"))
    assert verdict == made.verdict()
    assert facts == made.facts()
    assert "silent for 3.10 s" in verdict.text
    assert "7 bad frames" in verdict.text
    assert "jumped by +3600.0 s" in verdict.text


def test_all_devices_that_cannot_be_had_are_told_at_once_and_none_is_left_running(
    tmp_path: Path,
) -> None:
    devices = [
        ToyDevice("lidar", [], errors=[NoAnswerError("no answer; is it powered?")]),
        ToyDevice("imu", TENTHS),
        ToyDevice("vesc", [], errors=[NoAnswerError("is the app set to UART?")]),
    ]
    with pytest.raises(RecordingError) as caught, recorder(tmp_path, ToyClocks(), devices):
        pass
    assert "lidar: no answer; is it powered?" in str(caught.value)
    assert "vesc: is the app set to UART?" in str(caught.value)
    assert all(device.closes for device in devices)
    assert not list(tmp_path.glob("*.mcap"))


def test_a_device_that_vanishes_is_tried_again_and_the_rest_goes_on(tmp_path: Path) -> None:
    gone = DeviceLostError("lidar on /dev/rc/lidar: the device is gone")
    lidar = ToyDevice("lidar", [0.1, 0.2, gone, *TENTHS[5:]])
    made = record(tmp_path / "session", ToyClocks(), [lidar, ToyDevice("imu", TENTHS)])
    assert lidar.connects == 2
    verdict = made.verdict()
    assert verdict.verdict == "good"
    assert "lidar: gone once" in verdict.text
    assert checked(Session.open(tmp_path / "session"))[1] == verdict


def test_a_fault_of_ours_in_one_driver_does_not_stop_the_others(tmp_path: Path) -> None:
    lidar = ToyDevice("lidar", [0.1, ZeroDivisionError("ours"), *TENTHS[2:]])
    made = record(tmp_path / "session", ToyClocks(), [lidar, ToyDevice("imu", TENTHS)])
    lost = next(s for s in made.facts().streams if s.device == "lidar").losses
    assert lost.disconnects == 1
    assert "a fault of trackside: ZeroDivisionError: ours" in lost.last_error


def test_a_silent_stream_is_an_alarm_after_two_seconds(tmp_path: Path) -> None:
    clocks = ToyClocks()
    devices = [ToyDevice("lidar", [0.1, 0.2]), ToyDevice("imu", [])]
    with recorder(tmp_path, clocks, devices) as recording:
        until_written(recording, 1, 2, ready=False)
        assert [status.state for status in recording.poll()] == ["ok", "starting"]
        clocks.now_ns += 3 * S
        lidar, imu = recording.poll()
        assert (lidar.state, imu.state) == ("silent", "starting")
        assert lidar.age_s == pytest.approx(2.8)
        started_ns = recording.started_ns
        clocks.now_ns += 8 * S
        recording.poll()
        assert recording.is_ready
        assert recording.started_ns > started_ns
        assert recording.poll()[1].state == "silent"


def test_a_recording_counts_from_when_every_device_gives_something(tmp_path: Path) -> None:
    clocks = ToyClocks()
    lidar, imu = ToyDevice("lidar", []), ToyDevice("imu", TENTHS)
    limits = Limits(seconds=30.0)
    with recorder(tmp_path, clocks, [lidar, imu], limits) as recording:
        until_written(recording, 1, 5, ready=False)
        clocks.now_ns += 4 * S
        recording.poll()
        assert not recording.is_ready
        lidar.give([4.0, 4.1])
        until_written(recording, 2, 1)
        assert recording.started_ns == 104 * S
        clocks.now_ns += 29 * S
        assert not recording.is_over()


def test_it_ends_by_itself_after_its_seconds(tmp_path: Path) -> None:
    clocks = ToyClocks()
    limits = Limits(seconds=30.0)
    with recorder(tmp_path, clocks, [ToyDevice("imu", TENTHS)], limits) as recording:
        assert not recording.is_over()
        clocks.now_ns += 30 * S
        assert recording.is_over()
    assert recording.ended_because == ""


def test_it_ends_before_the_disk_is_full_and_the_log_has_its_end(tmp_path: Path) -> None:
    clocks = ToyClocks()
    with recorder(tmp_path, clocks, [ToyDevice("imu", TENTHS)]) as recording:
        until_written(recording, 1, 5)
        clocks.free_bytes = 400_000_000
        clocks.now_ns += 2 * S
        recording.poll()
        assert recording.is_over()
    session = Session.open(tmp_path)
    assert not session.truncated
    assert "the disk is full: 400 MB left" in session.info.verdict_reason
    assert "the disk is full" in checked(session)[1].text


def test_a_disk_that_refuses_ends_the_recording_and_what_was_written_can_be_recovered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clocks, device = ToyClocks(), ToyDevice("imu", TENTHS)
    write = LogWriter.write

    def refuse(self: LogWriter, *args: object, **named: int) -> None:
        if named["log_t_ns"] > UTC_0 + 3 * S:
            raise LogError("cannot write car.mcap: No space left on device")
        write(self, *args, **named)  # type: ignore[arg-type]  # passed on as they came

    monkeypatch.setattr(LogWriter, "write", refuse)
    recording = recorder(tmp_path, clocks, [device])
    recording.__enter__()
    end_s = time.monotonic() + 20.0
    while not recording.is_over() and time.monotonic() < end_s:
        recording.poll()
    with pytest.raises(RecordingError, match="trackside recover"):
        recording.__exit__(None, None, None)
    assert device.closes
    monkeypatch.undo()
    assert Session.open(tmp_path).truncated


def test_a_recording_that_is_running_cannot_be_recorded_into_or_recovered(tmp_path: Path) -> None:
    clocks = ToyClocks()
    with recorder(tmp_path, clocks, [ToyDevice("imu", TENTHS)]):
        with pytest.raises(SessionError, match="is being recorded right now"):
            recover(tmp_path)
        with (
            pytest.raises(SessionError, match="is being recorded right now"),
            recorder(tmp_path, clocks, [ToyDevice("imu", TENTHS)]),
        ):
            pass


def break_off(recording: Recorder) -> None:
    with recording:
        until_written(recording, 1, 5)
        raise ZeroDivisionError


def test_an_error_of_the_caller_still_ends_devices_and_logs(tmp_path: Path) -> None:
    device = ToyDevice("imu", TENTHS)
    recording = recorder(tmp_path, ToyClocks(), [device])
    with pytest.raises(ZeroDivisionError):
        break_off(recording)
    assert device.closes
    session = Session.open(tmp_path)
    assert not session.truncated
    assert "of an error (ZeroDivisionError)" in session.info.verdict_reason
