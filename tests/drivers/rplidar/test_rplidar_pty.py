"""The emulated lidar on a pseudo-terminal at real pace, for our driver and for another program."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyrplidar import PyRPlidar

from drivers import (
    DeviceBack,
    DeviceLost,
    DeviceLostError,
    DeviceReader,
    PtyEmulator,
    Reading,
)
from drivers.reader import Event
from drivers.rplidar import Revolution, RPLidar, RPLidarConfig, RPLidarModel, a2m8, emulated_lidar
from drivers.rplidar.emulator import STANDARD
from drivers.rplidar.protocol import pwm_request
from drivers.rplidar.scene import Rotor


@pytest.fixture
def model() -> RPLidarModel:
    """A lidar behind USB whose head is up to speed at once, so that tests need not wait."""
    made = emulated_lidar()
    made.rotor = Rotor(spin_up_s=0.05)
    return made


@pytest.fixture
def emulator(model: RPLidarModel) -> Iterator[PtyEmulator]:
    with PtyEmulator(model) as running:
        yield running


def read_until(lidar: RPLidar, turns: int, timeout_s: float = 20.0) -> list[Revolution]:
    got: list[Revolution] = []
    end_s = time.monotonic() + timeout_s
    while len(got) < turns and time.monotonic() < end_s:
        reading = lidar.read(0.1)
        got += reading.samples if reading else []
    return got


def test_pyrplidar_scans_the_emulated_lidar(
    emulator: PtyEmulator, model: RPLidarModel, capsys: pytest.CaptureFixture[str]
) -> None:
    lidar = PyRPlidar()
    lidar.connect(port=emulator.path, baudrate=115200, timeout=5)
    info, health = lidar.get_info(), lidar.get_health()
    assert (info.model, info.firmware_major, info.firmware_minor) == (0x28, 1, 29)
    assert info.serialnumber == model.spec.info.serial
    assert health.status == 0
    assert [mode.name for mode in lidar.get_scan_modes()][3:] == ["Sensitivity", "Stability"]
    # Its own set_motor_pwm moves DTR on the open port, which no pseudo-terminal has.
    lidar.lidar_serial.send_data(pwm_request(600))
    scan = lidar.start_scan()()
    beams = [next(scan) for _ in range(450)]
    lidar.stop()
    lidar.disconnect()
    capsys.readouterr()
    assert 2 <= sum(beam.start_flag for beam in beams) <= 3
    angle = np.radians([beam.angle for beam in beams])
    x_m = np.abs(np.cos(angle) * [beam.distance for beam in beams]) / 1000.0
    y_m = np.abs(np.sin(angle) * [beam.distance for beam in beams]) / 1000.0
    # Every beam ends at a wall of the room of 6 m by 4 m.
    assert np.minimum(np.abs(x_m - 3.0), np.abs(y_m - 2.0)).max() < 0.005


def test_our_driver_through_a_real_port(
    emulator: PtyEmulator, model: RPLidarModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped, receive = threading.Event(), model.receive

    def listen(data: bytes, now_ns: int) -> None:
        receive(data, now_ns)
        if data.endswith(pwm_request(0)):
            stopped.set()

    monkeypatch.setattr(model, "receive", listen)
    lidar = RPLidar(RPLidarConfig(emulator.path))
    lidar.connect()
    turns = read_until(lidar, 5)
    assert lidar.identify()["scan_mode"] == "Sensitivity"
    lidar.close()
    assert [700 < len(turn) < 870 for turn in turns[:5]] == [True] * 5
    assert stopped.wait(20.0)
    assert (model.rotor.target_hz, model.state) == (0.0, "idle")


def test_a_reader_survives_a_lidar_that_hangs_up_and_comes_back(
    model: RPLidarModel, tmp_path: Path
) -> None:
    # A fixed name that points to wherever the lidar is, as /dev/serial/by-id does.
    link = tmp_path / "lidar"
    seen: list[Reading[Revolution] | Event] = []
    come = threading.Semaphore(0)

    def take(one: Reading[Revolution] | Event) -> None:
        seen.append(one)
        for _ in one.samples if isinstance(one, Reading) else ():
            come.release()

    lidar = RPLidar(RPLidarConfig(str(link)))
    reader = DeviceReader(lidar, take, retry_s=(0.05,))
    with PtyEmulator(model) as emulator:
        link.symlink_to(emulator.path)
        lidar.connect()
        reader.start()
        assert all(come.acquire(timeout=20.0) for _ in range(2))
    fresh = emulated_lidar()
    fresh.rotor = Rotor(spin_up_s=0.05)
    with PtyEmulator(fresh) as emulator:
        link.unlink()
        link.symlink_to(emulator.path)
        while not any(isinstance(one, DeviceBack) for one in seen):
            assert come.acquire(timeout=20.0)
        assert all(come.acquire(timeout=20.0) for _ in range(2))
        assert reader.stop()
    events = [type(one) for one in seen if not isinstance(one, Reading)]
    assert events == [DeviceLost, DeviceBack]
    turns = [turn for one in seen if isinstance(one, Reading) for turn in one.samples]
    assert {turn.epoch for turn in turns} == {0, 1}


def test_a_stale_scan_on_a_real_port_is_stopped(emulator: PtyEmulator, model: RPLidarModel) -> None:
    model.left_scanning(STANDARD, time.monotonic_ns())
    lidar = RPLidar(RPLidarConfig(emulator.path, scan_mode="Express"))
    lidar.connect()
    assert len(read_until(lidar, 2)) >= 2
    lidar.close()


def test_a_port_without_a_dtr_line_is_no_obstacle() -> None:
    spec = replace(a2m8(), accessory_board=False)
    with PtyEmulator(RPLidarModel(spec)) as emulator:
        lidar = RPLidar(RPLidarConfig(emulator.path))
        lidar.connect()  # would set DTR
        assert lidar.identify()["motor"] == "DTR line"
        lidar.close()
        with pytest.raises(DeviceLostError, match="not connected"):
            lidar.read(0.0)
