"""Both IMUs as any other room sees them: devices in a reader, and a room that opens at once."""

from __future__ import annotations

import subprocess
import sys
import threading
import time

import pytest

from drivers import Device, DeviceReader, PtyEmulator, Reading
from drivers.imu import ImuSample
from drivers.imu.mpu9250 import Mpu9250, RealTimeMpu9250Bus
from drivers.imu.razor import Razor, RazorConfig, RazorModel


def read_some(device: Device[ImuSample], enough: int) -> list[ImuSample]:
    """Samples through the thread that the recorder uses."""
    samples: list[ImuSample] = []
    done = threading.Event()

    def take(event: object) -> None:
        assert isinstance(event, Reading), event
        samples.extend(event.samples)
        if len(samples) >= enough:
            done.set()

    device.connect()
    reader = DeviceReader(device, take)
    reader.start()
    assert done.wait(20.0)
    assert reader.stop()
    return samples


def test_the_mpu_9250_in_a_reader() -> None:
    bus = RealTimeMpu9250Bus(start_ns=time.monotonic_ns())
    samples = read_some(Mpu9250(open_bus=lambda _: bus), 60)
    assert samples[-1].linear_acceleration_m_s2[2] == pytest.approx(9.80665, abs=0.01)
    assert bus.closed


def test_the_razor_in_a_reader() -> None:
    with PtyEmulator(RazorModel()) as emulator:
        samples = read_some(Razor(RazorConfig(port=emulator.path)), 30)
    assert samples[-1].linear_acceleration_m_s2[2] == pytest.approx(9.80665, abs=0.01)


@pytest.mark.parametrize("name", ["drivers.imu", "drivers.imu.mpu9250", "drivers.imu.razor"])
def test_it_opens_without_the_libraries_of_the_ports(name: str) -> None:
    program = f"import {name}, sys; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"serial", "smbus2", "scipy", "cv2"} & set(loaded)
