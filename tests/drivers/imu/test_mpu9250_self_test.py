from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.imu.mpu9250.self_test import factory_trim, judge_self_test

CODES = bytes([120, 118, 122, 100, 101, 99])
STILL = np.array([0.0, 0.0, 16384.0, 10.0, -20.0, 30.0])


def answering(gyro: float = 1.0, accel: float = 1.0) -> np.ndarray:
    trims = np.array([factory_trim(code) for code in CODES])
    answer = np.concatenate((accel * trims[3:], gyro * trims[:3]))
    return np.asarray(STILL + answer, float)


@pytest.mark.parametrize(("code", "counts"), [(1, 2620.0), (2, 2646.2), (71, 5257.72), (0, None)])
def test_the_factory_trim(code: int, counts: float | None) -> None:
    """2620 * 1.01^(code - 1): reference protocols C.1."""
    trim = factory_trim(code)
    assert math.isnan(trim) if counts is None else trim == pytest.approx(counts, abs=0.01)


def test_a_healthy_chip_passes() -> None:
    result = judge_self_test(CODES, STILL, answering())
    assert result.passed
    assert result.gyro_ratio == pytest.approx((1.0, 1.0, 1.0))
    assert result.gyro_offset_deg_s == pytest.approx((10 / 131, -20 / 131, 30 / 131))


@pytest.mark.parametrize(
    ("gyro", "accel", "faults"),
    [
        (0.51, 1.0, 0),
        (0.49, 1.0, 3),
        (1.0, 0.51, 0),
        (1.0, 0.49, 3),
        (1.0, 1.49, 0),
        (1.0, 1.51, 3),
    ],
)
def test_the_limits(gyro: float, accel: float, faults: int) -> None:
    assert len(judge_self_test(CODES, STILL, answering(gyro, accel)).faults) == faults


@pytest.mark.parametrize(
    ("gyro_deg_s", "accel_g", "faults"),
    [(61, 0.3, 0), (59, 0.3, 3), (61, 0.22, 3), (61, 0.68, 3)],
)
def test_the_limits_without_a_factory_trim(gyro_deg_s: float, accel_g: float, faults: int) -> None:
    on = STILL + np.repeat([16384.0 * accel_g, 131.0 * gyro_deg_s], 3)
    result = judge_self_test(bytes(6), STILL, on)
    assert len(result.faults) == faults
    assert all(math.isnan(ratio) for ratio in result.gyro_ratio)


def test_offsets_at_rest() -> None:
    off = np.array([0.0, 0.0, 16384.0 * 1.6, 0.0, 131.0 * 21.0, 0.0])
    result = judge_self_test(CODES, off, off + answering() - STILL)
    assert result.faults == (
        "gyro y reads 21.0 deg/s at rest",
        "the accelerometer is 0.60 g off at rest",
    )
