"""The still period at the start of a recording: what the gyro reads while the car stands."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from drivers.imu import ImuSample, StillBias, still_bias


class StillPeriod:
    """Samples of one IMU between two moments (monotonic), and what they tell.

    Nothing is corrected by it: the bias stands in the diagnostics, and readers find their own.
    """

    def __init__(self) -> None:
        self._from_ns = self._until_ns = 0
        self._samples: list[ImuSample] = []
        self._bias: StillBias | None = None

    def begin(self, now_ns: int, seconds: float) -> None:
        """The car is asked to stand from now on."""
        self._from_ns, self._until_ns = now_ns, now_ns + round(seconds * 1e9)

    def note(self, measured_ns: int, sample: ImuSample) -> None:
        """One more sample, measured at that monotonic time."""
        if self._from_ns <= measured_ns < self._until_ns:
            self._samples.append(sample)
        elif self._samples and self._bias is None and measured_ns >= self._until_ns:
            self._bias = self._judged()

    def state(self) -> Mapping[str, object]:
        """The bias in deg/s, and a remark where it is not to be trusted; empty until known."""
        if self._bias is None:
            return {}
        bias = [f"{math.degrees(axis):.3f}" for axis in self._bias.bias_rad_s]
        told: dict[str, object] = {"still_gyro_bias_deg_s": " ".join(bias)}
        if not self._bias.accepted:
            told["remark"] = f"no still start ({self._bias.faults[0]})"
        return told

    def _judged(self) -> StillBias:
        gyro = np.array([sample.angular_velocity_rad_s for sample in self._samples])
        acceleration = np.array([sample.linear_acceleration_m_s2 for sample in self._samples])
        warm = [s.temperature_c for s in self._samples if s.temperature_c is not None]
        return still_bias(
            gyro,
            acceleration,
            (self._until_ns - self._from_ns) * 1e-9,
            float(np.mean(warm)) if warm else math.nan,
        )
