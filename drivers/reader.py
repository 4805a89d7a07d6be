"""One thread for one device: it reads, and when the device is lost it tries until it is back.

A lost device never stops the others. What happened is told in events, in order with the readings.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from drivers.device import Device, Reading
from drivers.errors import DriverError

Sample = TypeVar("Sample")

READ_TIMEOUT_S = 0.1
RETRY_S = (0.2, 0.5, 1.0, 2.0)
"""How long to wait before each further try; the last one holds for all that follow."""


@dataclass(frozen=True)
class DeviceLost:
    """The device failed at `t_ns` (monotonic) with this error; it is being tried again."""

    t_ns: int
    error: DriverError


@dataclass(frozen=True)
class DeviceBack:
    """The device answers again since `t_ns` (monotonic), after so many tries."""

    t_ns: int
    tries: int


Event = DeviceLost | DeviceBack


class DeviceReader(Generic[Sample]):
    """Reads a connected device in a thread and hands on all it gives.

    take : called in the thread with each reading and event; it must not block and not raise.
    """

    def __init__(
        self,
        device: Device[Sample],
        take: Callable[[Reading[Sample] | Event], None],
        *,
        read_timeout_s: float = READ_TIMEOUT_S,
        retry_s: tuple[float, ...] = RETRY_S,
        clock_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.device = device
        self._take, self._clock_ns = take, clock_ns
        self._read_timeout_s, self._retry_s = read_timeout_s, retry_s
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name=device.name, daemon=True)
        self.last_error: DriverError | None = None
        """Why the newest try to get the device back failed."""

    def start(self) -> None:
        """Begin to read; the device is connected already, or is tried until it is."""
        self._thread.start()

    def end(self) -> None:
        """Ask the thread to end after its present read; `stop` does so too."""
        self._ending.set()

    def stop(self, timeout_s: float = 5.0) -> bool:
        """End the thread and close the device; whether the thread ended in time."""
        self.end()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        self.device.close()
        return not self._thread.is_alive()

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                self._read_on()
            except Exception as err:  # also a fault of ours must not end the recording
                self._take(DeviceLost(self._clock_ns(), _told(self.device.name, err)))
                self._reconnect()

    def _read_on(self) -> None:
        while not self._ending.is_set():
            reading = self.device.read(self._read_timeout_s)
            if reading is not None:
                self._take(reading)

    def _reconnect(self) -> None:
        self.device.close()
        tries = 0
        while not self._ending.wait(self._retry_s[min(tries, len(self._retry_s) - 1)]):
            tries += 1
            try:
                self.device.connect()
            except Exception as err:
                self.last_error = _told(self.device.name, err)
                continue
            self._take(DeviceBack(self._clock_ns(), tries))
            return


def _told(device: str, err: Exception) -> DriverError:
    """The error of a driver as it is; any other says that it is a fault of ours."""
    if isinstance(err, DriverError):
        return err
    return DriverError(f"{device}: a fault of trackside: {type(err).__name__}: {err}")
