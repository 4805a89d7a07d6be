from __future__ import annotations

import math

import numpy as np
import pytest

from capture.recording.still import StillPeriod
from drivers.imu import ImuSample

S = 10**9
GRAVITY = (0.0, 0.0, 9.80665)


def sample(t_ns: int, rate_rad_s: float) -> ImuSample:
    return ImuSample(t_ns, (0.0, 0.0, rate_rad_s), GRAVITY, temperature_c=25.0)


def period(noise_rad_s: float, seconds: float = 3.0) -> StillPeriod:
    rng = np.random.default_rng(0)
    still = StillPeriod()
    still.begin(10 * S, seconds)
    for k in range(1000):
        t_ns = 9 * S + k * S // 200
        rate = math.radians(2.0) + rng.normal(0.0, noise_rad_s)
        still.note(t_ns, sample(t_ns, rate if t_ns < 13 * S else 1.0))
    return still


def test_the_bias_is_what_the_gyro_reads_while_the_car_stands() -> None:
    told = period(math.radians(0.1)).state()
    assert float(str(told["still_gyro_bias_deg_s"]).split()[2]) == pytest.approx(2.0, abs=0.05)
    assert "remark" not in told


def test_a_car_that_moves_is_told() -> None:
    assert "the car moved" in str(period(math.radians(2.0)).state()["remark"])


def test_nothing_is_known_before_the_end_of_the_period() -> None:
    still = StillPeriod()
    assert still.state() == {}
    still.begin(0, 2.0)
    still.note(S, sample(S, 0.0))
    assert still.state() == {}
