"""At real pace behind a pseudo-terminal: threads, signals and the end of a program."""

from __future__ import annotations

import queue
import subprocess
import sys
import threading

import pytest

from drivers import DeviceLost, DeviceReader, PtyEmulator
from drivers.device import Reading
from drivers.reader import Event
from drivers.vesc import (
    DriveCommand,
    DriveLimits,
    Firmware,
    VescConfig,
    VescController,
    VescModel,
    VescValues,
)

LIMITS = DriveLimits(
    erpm_min=-5000,
    erpm_max=10_000,
    duty=0.2,
    current_a=20,
    brake_a=15,
    erpm_per_s=1e9,
    heartbeat_s=1.0,
    telemetry_s=1.0,
)
PROGRAM = """
import sys, threading
from drivers import DeviceReader
from drivers.vesc import DriveLimits, VescConfig, VescController

states = threading.Semaphore(0)
controller = VescController(VescConfig(port=sys.argv[1]))
controller.connect()
DeviceReader(controller, lambda reading: states.release()).start()
limits = DriveLimits(
    erpm_min=-5000, erpm_max=10_000, duty=0.2, current_a=20, brake_a=15, erpm_per_s=1e9,
    heartbeat_s=1.0, telemetry_s=1.0,
)
driven = threading.Event()

def drive():
    states.acquire()
    with controller.arm(limits) as car:
        for count in range(10**6):
            car.rpm(3000)
            if count > 10:
                driven.set()
            states.acquire(timeout=0.1)

if sys.argv[2] == "sigterm":
    drive()
threading.Thread(target=drive, daemon=True).start()
driven.wait(20)
"""


class Watched(VescModel):
    """Tells when it was driven."""

    def __init__(self) -> None:
        super().__init__(Firmware(5, 3))
        self.driven = threading.Event()

    def receive(self, data: bytes, now_ns: int) -> None:
        super().receive(data, now_ns)
        if len(self.obeyed) > 5:
            self.driven.set()


def test_a_reader_s_thread_and_a_driving_program_share_the_port() -> None:
    model = Watched()
    inbox: queue.Queue[Reading[VescValues | DriveCommand] | Event] = queue.Queue()
    with PtyEmulator(model) as emulator:
        controller = VescController(VescConfig(port=emulator.path, rate_hz=100))
        controller.connect()
        reader = DeviceReader(controller, inbox.put)
        reader.start()
        seen = [inbox.get(timeout=10)]
        with controller.arm(LIMITS) as drive:
            for count in range(60):
                drive.rpm(3000 + count)
                seen.append(inbox.get(timeout=10))
        # The stop is recorded by the reader's thread, not only sent.
        while not any(command.kind == "stop" for command in commands(seen)):
            seen.append(inbox.get(timeout=10))
        emulator.unplug()
        while not isinstance(seen[-1], DeviceLost):
            seen.append(inbox.get(timeout=10))
        assert reader.stop()
    assert controller.counters.bad_bytes == 0
    assert [each.value for each in model.obeyed if each.kind == "rpm"] == [
        3000.0 + count for count in range(60)
    ]
    assert [(each.kind, each.value) for each in model.obeyed[-3:]] == [("current", 0.0)] * 3
    assert [command.kind for command in commands(seen)] == ["rpm"] * 60 + ["stop"]


def test_importing_opens_no_library_of_ports() -> None:
    program = "import drivers.vesc, sys; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert not {"serial", "numpy", "scipy", "rosbags"} & set(done.stdout.split())


def commands(
    seen: list[Reading[VescValues | DriveCommand] | Event],
) -> list[DriveCommand]:
    return [
        sample
        for reading in seen
        if isinstance(reading, Reading)
        for sample in reading.samples
        if isinstance(sample, DriveCommand)
    ]


@pytest.mark.parametrize(("end", "code"), [("sigterm", 143), ("daemon thread", 0)])
def test_a_program_that_ends_while_it_drives_stops_the_car(end: str, code: int) -> None:
    model = Watched()
    with PtyEmulator(model) as emulator:
        program = subprocess.Popen([sys.executable, "-c", PROGRAM, emulator.path, end])
        assert model.driven.wait(30)
        if end == "sigterm":
            program.terminate()
        assert program.wait(30) == code
        # What the program wrote may still wait in the terminal for the emulator's next turn.
        stopped = threading.Event()
        for _ in range(100):
            if (len(model.obeyed) > 2 and model.obeyed[-3].kind == "current") or stopped.wait(0.05):
                break
    assert [(each.kind, each.value) for each in model.obeyed[-3:]] == [("current", 0.0)] * 3
    assert model.dangers == []
