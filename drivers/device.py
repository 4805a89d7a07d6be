"""What every device offers, so that one recorder serves them all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from drivers.port import Chunk

Sample = TypeVar("Sample", covariant=True)


@dataclass(frozen=True)
class Tick:
    """One moment on two clocks: what ties a device's time to ours.

    device_ns : on the device's own clock, which never goes back until the device restarts;
    arrival_ns : monotonic time at which the last byte of what was sent at that moment was here;
    delay_ns : how long it takes at the very least from the one to the other (wire and latency, by
    the data sheet); epoch : counts the restarts of the device's clock.
    """

    device_ns: int
    arrival_ns: int
    delay_ns: int = 0
    epoch: int = 0


@dataclass(frozen=True, eq=False)
class Reading(Generic[Sample]):
    """What one call of `Device.read` brought.

    raw : the bytes exactly as they came; ticks : what is now known of the device's clock, oldest
    first; samples : what the bytes complete, oldest first.
    """

    raw: tuple[Chunk, ...] = ()
    ticks: tuple[Tick, ...] = ()
    samples: tuple[Sample, ...] = ()


@dataclass
class Counters:
    """What a driver has seen since it was made; it only ever grows.

    bad_frames : pieces that failed a check; bad_bytes : bytes skipped to find the next good piece;
    lost_samples : samples that the device took and that never came, as far as its own counting
    tells; timeouts : questions without an answer; details : what else a device counts, by name.
    """

    samples: int = 0
    bad_frames: int = 0
    bad_bytes: int = 0
    lost_samples: int = 0
    timeouts: int = 0
    details: dict[str, int] = field(default_factory=dict)


class Device(Protocol[Sample]):
    """A device: `connect`, then `read` again and again, then `close`.

    Making one touches nothing. `connect` either succeeds or leaves everything as it was. `close`
    always stops what spins or drives, may be called at any time, twice, and from another thread.
    """

    counters: Counters

    @property
    def name(self) -> str:
        """The device and where it is, as error messages name it: `RPLidar on /dev/ttyUSB0`."""

    def connect(self) -> None:
        """Open, check, configure, start. Raises `DriverError` within five seconds."""

    def identify(self) -> Mapping[str, object]:
        """Model, firmware, serial number and settings in force, for `session.yaml`."""

    def read(self, timeout_s: float) -> Reading[Sample] | None:
        """What came next; None if nothing came in time. Raises `DriverError`."""

    def close(self) -> None:
        """Stop the device and give its port back; raises nothing."""
