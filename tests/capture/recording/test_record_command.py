"""Whole roads through the real commands, on emulated devices behind pseudo-terminals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from capture import MeasuredCalibration, Parameter, write_calibration
from capture.errors import LogError
from capture.log_reader import McapLog
from capture.network_clock import opened_server, serve
from capture.recording.replay import recorded_chunks
from capture.session import Session
from drivers import DeviceModel, PtyEmulator
from drivers.imu.razor import razor_model
from drivers.rplidar import emulated_lidar
from drivers.vesc import emulated_vesc

TRACKSIDE = [sys.executable, "-m", "trackside"]
MODELS: dict[str, Callable[[], DeviceModel]] = {
    "lidar": emulated_lidar,
    "vesc": emulated_vesc,
    "razor": razor_model,
}


class Rig:
    """Emulated devices under names that they keep, and a rig file of them."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.folder, self._stack = folder, stack
        self.emulators: dict[str, PtyEmulator] = {}
        for name in MODELS:
            self.plug(name)
        blocks = [f"{name}:\n  port: {folder / name}\n" for name in MODELS]
        self.file = folder / "rig.yaml"
        self.file.write_text("recording:\n  still_s: 0.5\n" + "".join(blocks))

    def plug(self, name: str) -> None:
        emulator = self._stack.enter_context(PtyEmulator(MODELS[name]()))
        link = self.folder / name
        link.unlink(missing_ok=True)
        link.symlink_to(emulator.path)
        self.emulators[name] = emulator

    def unplug(self, name: str) -> None:
        (self.folder / name).unlink()
        self.emulators[name].unplug()

    def record(self, *words: str) -> subprocess.Popen[str]:
        command = [*TRACKSIDE, "record", "--rig", str(self.file), "--map", "turn", *words]
        return subprocess.Popen(
            command,
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def sessions(self) -> list[Path]:
        return sorted((self.folder / "sessions").glob("*"))


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with ExitStack() as stack:
        yield Rig(tmp_path, stack)


def told(process: subprocess.Popen[str], text: str) -> list[str]:
    """What a recording says until a line holds that text."""
    assert process.stderr is not None
    lines = []
    for line in process.stderr:
        lines.append(line)
        if text in line:
            return lines
    raise AssertionError(f"it ended without {text!r}: {''.join(lines)}")


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*TRACKSIDE, *words], capture_output=True, text=True, check=False)


def until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end_s, "it did not happen in time"


def until_kept(log: Path, seconds: int) -> None:
    """Wait until so many seconds of a running recording are on the disk."""

    def kept() -> bool:
        try:
            return len(McapLog(log).read("/diagnostics").messages) > seconds
        except LogError:
            return False

    until(kept)


def test_a_recording_gets_the_calibrations_in_force(rig: Rig) -> None:
    folder = rig.folder / "calibration"
    bias = (Parameter("gyro_bias_z_rad_s", 0.02),)
    for day, accepted in ((1, True), (2, True), (3, False)):
        made = f"2026-05-0{day}T10:00:00Z"
        one = MeasuredCalibration(kind="imu", made_utc=made, accepted=accepted, parameters=bias)
        write_calibration(folder, one)
    out, err = rig.record("--seconds", "1").communicate(timeout=40)
    (session,) = map(Session.open, rig.sessions())
    assert [file.name for file in session.calibrations] == ["imu_20260502T100000Z.yaml"], out
    assert "calibration in force: " in err
    assert session.measured("imu") == {"gyro_bias_z_rad_s": 0.02}


def test_a_recording_ends_with_sigterm_and_is_whole(rig: Rig) -> None:
    process = rig.record("--power", "low", "--notes", "first try")
    told(process, "drive; Ctrl-C ends")
    until_kept(rig.sessions()[0] / "car.mcap", 4)
    process.send_signal(signal.SIGTERM)
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 0, out
    assert "verdict: good" in out
    (folder,) = rig.sessions()
    assert folder.name.endswith("_turn_low_1")
    session = Session.open(folder)
    assert (session.info.power, session.info.trial, session.info.notes) == ("low", 1, "first try")
    assert {"lidar", "vesc", "razor"} == set(session.info.devices)
    names = {topic.name for topic in session.topics if topic.count}
    assert names >= {
        "/raw/lidar",
        "/raw/vesc",
        "/raw/imu",
        "/lidar/points",
        "/scan",
        "/vesc/state",
        "/imu/data_raw",
        "/imu/mag",
        "/diagnostics",
    }
    with AnyReader([folder]) as reader:
        assert reader.message_count == sum(topic.count for topic in session.topics)
    again = run("check", str(folder))
    assert again.returncode == 0
    assert "verdict: good" in again.stdout


def test_a_killed_recording_is_recovered_but_for_its_last_second(rig: Rig) -> None:
    process = rig.record("--power", "high")
    told(process, "drive; Ctrl-C ends")
    log = rig.sessions()[0] / "car.mcap"
    until_kept(log, 4)
    process.kill()
    process.communicate(timeout=20)
    killed_ns = time.time_ns()
    (folder,) = rig.sessions()
    assert run("check", str(folder)).stdout.count("trackside recover") == 1
    done = run("recover", str(folder))
    assert done.returncode == 0, done.stderr
    assert "car.mcap" in done.stdout
    assert "recovered after a power cut" in done.stdout
    session = Session.open(folder)
    assert not session.truncated
    last_ns = max(topic.last_ns for topic in session.topics)
    assert killed_ns - last_ns < 1.6e9  # the second that a flush lasts, and this test's own delays
    count = sum(topic.count for topic in session.topics)
    with AnyReader([folder]) as reader:
        assert reader.message_count == count
    with log.open("rb") as stream:
        assert sum(1 for _ in make_reader(stream).iter_messages()) == count


def test_a_cable_that_falls_out_and_is_put_back_costs_only_its_own_data(rig: Rig) -> None:
    process = rig.record()
    told(process, "drive; Ctrl-C ends")
    rig.unplug("vesc")
    lines = told(process, "vesc ALARM")
    assert "gone, being tried again" in lines[-1]
    rig.plug("vesc")
    told(process, "vesc gives data")
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    assert "vesc: gone once" in out
    assert "lidar: silent" not in out


def test_devices_that_cannot_be_had_are_told_and_nothing_is_left_behind(rig: Rig) -> None:
    rig.unplug("lidar")
    rig.unplug("razor")
    process = rig.record()
    _, err = process.communicate(timeout=20)
    assert process.returncode == 1
    assert f"lidar: {rig.folder / 'lidar'}: nothing is plugged in there" in err
    assert f"razor: {rig.folder / 'razor'}: nothing is plugged in there" in err
    assert rig.sessions() == []
    # The one that was there is free again, and can be recorded alone.
    alone = rig.record("--without", "lidar", "--without", "razor", "--seconds", "1.5")
    out, err = alone.communicate(timeout=20)
    assert alone.returncode == 0, err
    assert "verdict: good" in out


def test_a_full_disk_ends_the_recording_and_keeps_what_was_written(rig: Rig) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root may mount the small disk that this needs")
    disk = rig.folder / "sessions"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", str(disk)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("this machine does not let us mount a small disk")
    try:
        rig.file.write_text(rig.file.read_text().replace("recording:\n", RESERVE))
        process = rig.record()
        _, err = process.communicate(timeout=60)
        assert process.returncode == 1
        assert "No space left on device" in err
        (folder,) = rig.sessions()
        log = Session.open(folder).log
        assert log is not None
        assert log.truncated
        assert sum(topic.count for topic in log.topics.values()) > 100
    finally:
        subprocess.run(["umount", str(disk)], check=True)


RESERVE = "recording:\n  disk_reserve_mb: 0\n"


def test_a_recording_asks_the_clock_of_the_laptop_at_its_start_and_at_its_end(rig: Rig) -> None:
    ended = threading.Event()
    with closing(opened_server(0, "127.0.0.1")) as server:
        thread = threading.Thread(target=serve, args=(server, ended.is_set))
        thread.start()
        asked = f"recording:\n  clock_server: 127.0.0.1:{server.getsockname()[1]}\n"
        rig.file.write_text(rig.file.read_text().replace("recording:\n", asked))
        words = ["--without", "lidar", "--without", "razor", "--seconds", "1.5"]
        out, err = rig.record(*words).communicate(timeout=30)
        ended.set()
        thread.join()
    assert "verdict: good" in out, err
    (folder,) = rig.sessions()
    info = Session.open(folder).info
    first, last = info.peer_clocks
    assert last.monotonic_ns > first.monotonic_ns
    for told in info.peer_clocks:
        assert abs(told.offset_monotonic_ns) <= told.uncertainty_ns
        assert told.boot_id == told.own_boot_id == info.boot_id != ""


def test_a_clock_server_that_is_silent_spoils_nothing_and_is_told(rig: Rig) -> None:
    with closing(opened_server(0, "127.0.0.1")) as silent:
        asked = f"recording:\n  clock_server: 127.0.0.1:{silent.getsockname()[1]}\n"
        rig.file.write_text(rig.file.read_text().replace("recording:\n", asked))
        words = ["--without", "lidar", "--without", "razor", "--seconds", "2.5"]
        out, err = rig.record(*words).communicate(timeout=30)
    assert "verdict: good" in out, err
    assert "clock: 127.0.0.1" in out
    assert "does trackside clock serve run there" in out


def test_old_footage_becomes_a_film_and_ends_by_itself(tmp_path: Path) -> None:
    images = tmp_path / "images"
    images.mkdir()
    for number in range(45):
        good, data = cv2.imencode(".jpg", np.full((48, 64), 5 * number, np.uint8))
        assert good
        (images / f"{number:03}.jpg").write_bytes(data.tobytes())
    rig_file = tmp_path / "rig.yaml"
    rig_file.write_text(f"overhead_images:\n  folder: {images}\n  rate_hz: 30.0\n")
    words = ["--rig", str(rig_file), "--map", "turn", "-o", str(tmp_path / "films")]
    done = run("film", *words)
    assert done.returncode == 0, done.stderr
    assert "verdict: good" in done.stdout
    (folder,) = (tmp_path / "films").glob("*_turn_1_film")
    with AnyReader([folder]) as reader:
        frames = [
            reader.deserialize(data, connection.msgtype).data.tobytes()  # type: ignore[attr-defined]  # rosbags makes the type
            for connection, _, data in reader.messages()
            if connection.topic == "/overhead/image/compressed"
        ]
    assert frames == [(images / f"{number:03}.jpg").read_bytes() for number in range(45)]


def test_a_session_is_replayed_and_recorded_again_byte_for_byte(rig: Rig) -> None:
    first = rig.record("--seconds", "3")
    out, err = first.communicate(timeout=30)
    assert first.returncode == 0, err
    (folder,) = rig.sessions()
    again = rig.folder / "again.yaml"
    command = [*TRACKSIDE, "replay", str(folder), "--speed", "2", "-o", str(again)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as player:
        assert player.stdout is not None
        while "wrote" not in player.stdout.readline():
            pass
        words = ["--rig", str(again), "--map", "again", "-o", str(rig.folder / "second")]
        done = run("record", *words, "--seconds", "1")
        player.terminate()
    assert done.returncode == 0, done.stderr
    assert "verdict:" in out
    (second,) = (rig.folder / "second").glob("*")
    held = b"".join(c.data for c in recorded_chunks(Session.open(folder), "/raw/lidar"))
    played = b"".join(c.data for c in recorded_chunks(Session.open(second), "/raw/lidar"))
    assert len(played) > 10_000
    assert held.startswith(played[: len(held)])
