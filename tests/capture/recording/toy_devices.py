"""Devices that give what they are told to, in no time, and the clocks of a made-up machine."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from capture.clock import UtcLine
from capture.recording.recorder import Clocks
from capture.recording.stream import Stream
from capture.recording.translation import LogMessage, raw_messages
from capture.sensor_messages import imu_message
from capture.topics import IMU_TYPE, LOG_NAME
from drivers import Chunk, Counters, DriverError, Reading

S = 10**9
UTC_0 = 1_700_000_000 * S


class ToyClocks:
    """A machine whose monotonic time stands still until it is moved."""

    def __init__(self) -> None:
        self.now_ns = 100 * S
        self.utc_step_ns = 0
        self.free_bytes = 10**12

    @property
    def utc(self) -> UtcLine:
        return UtcLine(100 * S, UTC_0)

    def clocks(self) -> Clocks:
        return Clocks(
            lambda: self.now_ns,
            lambda: self.now_ns - 100 * S + UTC_0 + self.utc_step_ns,
            self.free,
        )

    def free(self, folder: Path) -> int:
        assert folder.is_dir()
        return self.free_bytes


class ToyDevice:
    """Gives a sample at each of `times_s` (after the start), then nothing more.

    An error in the place of a time is raised there. `errors` are raised by the first connects.
    """

    def __init__(
        self,
        name: str,
        times_s: Sequence[float | Exception],
        *,
        errors: Sequence[DriverError] = (),
    ) -> None:
        self.counters = Counters()
        self.connects = self.closes = 0
        self._name, self._script, self._errors = name, list(times_s), list(errors)
        self._nothing = threading.Event()

    @property
    def name(self) -> str:
        return self._name

    def connect(self) -> None:
        self.connects += 1
        if self._errors:
            raise self._errors.pop(0)

    def identify(self) -> Mapping[str, object]:
        return {"model": "toy", "serial": self._name}

    def read(self, timeout_s: float) -> Reading[float] | None:
        if not self._script:
            self._nothing.wait(min(timeout_s, 0.01))
            return None
        step = self._script.pop(0)
        if isinstance(step, Exception):
            raise step
        self.counters.samples += 1
        return Reading((Chunk(100 * S + round(step * S), b"toy"),), (), (step,))

    def give(self, times_s: Sequence[float]) -> None:
        """Let there be more to read."""
        self._script.extend(times_s)

    def close(self) -> None:
        self.closes += 1


class ToyTranslator:
    log_name = LOG_NAME

    def __init__(self, name: str, utc: UtcLine) -> None:
        self.topic = f"/{name}/data"
        self._utc = utc

    def messages(self, reading: Reading[float]) -> Iterator[LogMessage]:
        yield from raw_messages(reading, f"/raw{self.topic}", self._utc)
        for chunk in reading.raw:
            stamp_ns = self._utc.utc(chunk.t_ns) - 1000
            data = imu_message(stamp_ns, "toy", (0.0, 0.0, 0.0), (0.0, 0.0, 9.8))
            yield LogMessage(self.topic, IMU_TYPE, data, chunk.t_ns, stamp_ns)

    def state(self) -> Mapping[str, object]:
        return {"mood": "fine"}


def toy_streams(
    clocks: ToyClocks, devices: Sequence[ToyDevice], asked_hz: float | None = 10.0
) -> dict[str, Stream]:
    return {
        device.name: Stream(device, ToyTranslator(device.name, clocks.utc), asked_hz)
        for device in devices
    }
