"""An RPLidar and its emulated device, in simulated time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drivers import Reading, Tick
from drivers.rplidar import LidarPort, Revolution, RPLidar, RPLidarConfig, RPLidarModel


@dataclass
class Bench:
    """The driver, the model behind it, and all that was read."""

    model: RPLidarModel = field(default_factory=RPLidarModel)
    config: RPLidarConfig = field(default_factory=lambda: RPLidarConfig("/dev/lidar"))
    port: LidarPort = field(init=False)
    turns: list[Revolution] = field(default_factory=list)
    ticks: list[Tick] = field(default_factory=list)
    raw: bytearray = field(default_factory=bytearray)
    now_ns: int = 0

    def __post_init__(self) -> None:
        self.lidar = RPLidar(self.config, self.open)

    def open(self, path: str, baud: int) -> LidarPort:
        assert path == self.config.port
        if hasattr(self, "port"):
            self.now_ns = self.port.now_ns()
        self.port = LidarPort(self.model, baud=baud, start_ns=self.now_ns)
        return self.port

    def run(self, seconds: float, timeout_s: float = 0.1) -> None:
        """Read for so long; what comes is kept."""
        end_ns = self.port.now_ns() + round(seconds * 1e9)
        while self.port.now_ns() < end_ns:
            self.take(self.lidar.read(timeout_s))

    def take(self, reading: Reading[Revolution] | None) -> None:
        if reading is not None:
            self.turns += reading.samples
            self.ticks += reading.ticks
            self.raw += b"".join(chunk.data for chunk in reading.raw)

    def connected(self) -> Bench:
        """This, after connecting."""
        self.lidar.connect()
        return self


def on_our_clock(ticks: list[Tick], turn: Revolution) -> NDArray[np.float64]:
    """A turn's times by the tick of its epoch with the least delay; enough where clocks agree."""
    offset = min(t.arrival_ns - t.delay_ns - t.device_ns for t in ticks if t.epoch == turn.epoch)
    return turn.device_ns.astype(np.float64) + offset


def scene(
    ranges: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> Callable[[NDArray[np.int64], NDArray[np.float64]], NDArray[np.float64]]:
    """A source that stands still, of a function of the bearing."""
    return lambda _, bearing: ranges(bearing)
