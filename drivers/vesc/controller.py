"""A VESC that is read and may drive: nothing moves but within `with controller.arm(limits)`.

There is one thread per device here too. The reader's thread asks for states, hears them, and sees
to it that the car stops when the user's program or the VESC falls silent; the user's program sends
its commands itself, whole frames between those of the reader. Nothing is repeated on its behalf:
when it hangs, the car stops, by us after `heartbeat_s` and, should all of us hang, by the VESC's
own watchdog (1 s unless set otherwise; 0.2 to 0.3 s and a brake current are better).
"""

from __future__ import annotations

import atexit
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType

from drivers.device import Reading
from drivers.errors import DeviceFaultError, DriverError, NotArmedError
from drivers.port import Port, SerialPort
from drivers.vesc.channel import DriveChannel
from drivers.vesc.drive import Drive, DriveCommand
from drivers.vesc.driver import Vesc, VescConfig
from drivers.vesc.faults import fault_name
from drivers.vesc.limits import DriveLimits
from drivers.vesc.values import VescValues

WATCH_S = 0.02
EXIT_BY_SIGTERM = 128 + signal.SIGTERM


class VescController:
    """A `drivers.device.Device` of states and of what was commanded, oldest first."""

    def __init__(
        self, config: VescConfig, open_port: Callable[[str, int], Port] = SerialPort
    ) -> None:
        self._vesc = Vesc(config, open_port, open_channel=self._open_channel)
        self.counters = self._vesc.counters
        self._channel: DriveChannel | None = None
        self._drive: Drive | None = None
        self._values: VescValues | None = None
        self._arming = threading.Lock()

    @property
    def name(self) -> str:
        """The device and its port."""
        return self._vesc.name

    def connect(self) -> None:
        """As `Vesc.connect`; the car stays disarmed."""
        self.close()
        self._vesc.connect()

    def identify(self) -> Mapping[str, object]:
        """As `Vesc.identify`."""
        return self._vesc.identify()

    def read(self, timeout_s: float) -> Reading[VescValues | DriveCommand] | None:
        """What came next and what was commanded; None if nothing was in time.

        Raises as `Vesc.read`, the car being stopped by then as far as it can be reached.
        """
        slices = max(round(timeout_s / WATCH_S), 1)
        for _ in range(slices):
            try:
                reading = self._vesc.read(timeout_s / slices)
            except DriverError as err:
                self._stop(f"the VESC cannot be read ({err})")
                raise
            commands = self._watch(reading)
            if reading is not None or commands:
                reading = reading or Reading()
                samples: list[VescValues | DriveCommand] = [*reading.samples, *commands]
                samples.sort(key=lambda sample: sample.t_ns)
                return Reading(reading.raw, reading.ticks, tuple(samples))
        return None

    def close(self) -> None:
        """Stop the car and give the port back."""
        self._stop("the port was closed")
        self._values = None
        self._vesc.close()

    @contextmanager
    def arm(self, limits: DriveLimits) -> Iterator[Drive]:
        """A block in which the car may be driven; however it is left, the car is stopped.

        The first command must come within `heartbeat_s`. SIGTERM leaves the block by `SystemExit`
        where it is the main thread's and nobody else handles that signal; at the interpreter's exit
        the car is stopped whichever thread has armed it.
        Raises `NotArmedError` if it is armed already or its state is not being read,
        `DeviceFaultError` for a firmware that cannot be commanded or that reports a fault.
        """
        drive = self._armed(limits)
        atexit.register(drive.stop, "the program ended")
        try:
            with _exit_on_sigterm():
                try:
                    yield drive
                finally:
                    drive.stop("the armed block was left")
        finally:
            atexit.unregister(drive.stop)

    def _armed(self, limits: DriveLimits) -> Drive:
        with self._arming:
            channel, values = self._channel, self._values
            if self._drive is not None and self._drive.why_stopped is None:
                raise NotArmedError(f"{self.name} is armed already; leave that block first")
            firmware = self._vesc.firmware
            firmware.command_ids()
            if channel is None or values is None:
                raise NotArmedError(
                    f"{self.name} has not told its state yet; let a DeviceReader read it, then arm"
                )
            if values.fault:
                raise DeviceFaultError(
                    f"{self.name} reports a fault: {fault_name(values.fault)}; remove its cause "
                    "before the car is armed"
                )
            drive = Drive(channel, firmware, limits, values)
            drive.watch(None)
            if drive.why_stopped is not None:
                raise NotArmedError(f"{self.name} cannot be armed: {drive.why_stopped}")
            self._drive = drive
        return drive

    def _watch(self, reading: Reading[VescValues] | None) -> list[DriveCommand]:
        """Hand the newest state to the armed block; what was commanded through it meanwhile."""
        values = reading.samples[-1] if reading is not None and reading.samples else None
        if values is not None:
            self._values = values
        drive = self._drive
        if drive is None:
            return []
        drive.watch(values)
        return drive.taken()

    def _stop(self, reason: str) -> None:
        drive = self._drive
        if drive is not None:
            drive.stop(reason)

    def _open_channel(self, port: Port) -> DriveChannel:
        self._channel = DriveChannel(port)
        return self._channel


@contextmanager
def _exit_on_sigterm() -> Iterator[None]:
    """A block that SIGTERM leaves as an exception does, unless somebody handles it already."""
    in_main = threading.current_thread() is threading.main_thread()
    if not in_main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    leaving = False

    def leave(_number: int, _frame: FrameType | None) -> None:
        nonlocal leaving
        if not leaving:  # a second one must not interrupt the stop
            leaving = True
            raise SystemExit(EXIT_BY_SIGTERM)

    signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
