"""The self test of the chip: the sensors move themselves, and the answer is compared with its trim.

Factory trim and limits: MPU-9250 accelerometer and gyroscope self-test (InvenSense AN), as the
SparkFun DMP library and Winer's MPU9250 read it: reference protocols C.1.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.errors import DeviceFaultError
from drivers.imu.mpu9250 import registers as reg
from drivers.imu.mpu9250.bus import Bus
from drivers.imu.sample import Vector, vector

SAMPLES = 200
SETTLE_S = 0.020
FILTER = 2
TRIM_COUNTS, TRIM_BASE = 2620.0, 1.01
GYRO_LEAST_RATIO, GYRO_LEAST_DEG_S, GYRO_MOST_OFFSET_DEG_S = 0.5, 60.0, 20.0
ACCEL_RATIOS, ACCEL_LIMITS_G, ACCEL_MOST_OFFSET_G = (0.5, 1.5), (0.225, 0.675), 0.5

Counts = npt.NDArray[np.float64]


@dataclass(frozen=True)
class SelfTest:
    """The verdict and what it rests on; per axis x, y, z.

    gyro_ratio, accel_ratio : answer over factory trim, NaN where the chip holds no trim;
    gyro_answer_deg_s, accel_answer_g : the answers; gyro_offset_deg_s : at rest;
    faults : empty if it passed, else what is out of its limits.
    """

    gyro_ratio: Vector
    accel_ratio: Vector
    gyro_answer_deg_s: Vector
    accel_answer_g: Vector
    gyro_offset_deg_s: Vector
    faults: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether every axis is within its limits."""
        return not self.faults


def factory_trim(code: int) -> float:
    """The answer in counts at the smallest full scale that the factory stored; NaN for code 0."""
    return TRIM_COUNTS * TRIM_BASE ** (code - 1) if code else float("nan")


def judge_self_test(codes: bytes, off: Counts, on: Counts) -> SelfTest:
    """The verdict on mean counts without and with the self test.

    codes : six bytes, SELF_TEST of gyro x, y, z then of the accelerometer; off, on : (6,)
    accelerometer x, y, z, gyro x, y, z at 2 g and 250 deg/s. The chip may lie as it likes, so the
    offset of the accelerometer is judged by the size of what it feels.
    """
    answer = on - off
    gyro = answer[3:] / reg.GYRO_COUNTS_PER_DEG_S[0]
    accel = answer[:3] / reg.ACCEL_COUNTS_PER_G[0]
    offset = off[3:] / reg.GYRO_COUNTS_PER_DEG_S[0]
    still = off[:3] / reg.ACCEL_COUNTS_PER_G[0]
    trims = [factory_trim(code) for code in codes]
    gyro_ratio, accel_ratio = answer[3:] / trims[:3], answer[:3] / trims[3:]
    faults = []
    for k, axis in enumerate("xyz"):
        if not _gyro_answers(gyro_ratio[k], gyro[k]):
            faults.append(f"gyro {axis} answers with {gyro[k]:.1f} deg/s")
        if abs(offset[k]) > GYRO_MOST_OFFSET_DEG_S:
            faults.append(f"gyro {axis} reads {offset[k]:.1f} deg/s at rest")
        if not _accel_answers(accel_ratio[k], accel[k]):
            faults.append(f"accelerometer {axis} answers with {accel[k]:.3f} g")
    off_by_g = abs(float(np.linalg.norm(still)) - 1.0)
    if off_by_g > ACCEL_MOST_OFFSET_G:
        faults.append(f"the accelerometer is {off_by_g:.2f} g off at rest")
    return SelfTest(
        vector(gyro_ratio),
        vector(accel_ratio),
        vector(gyro),
        vector(accel),
        vector(offset),
        tuple(faults),
    )


def measure_self_test(bus: Bus, address: int) -> SelfTest:
    """Run the test on a chip at rest; it must be set up anew afterwards.

    Raises `DeviceFaultError` where the chip gives no data, `OSError` where the bus fails.
    """
    for register, value in (
        (reg.FIFO_EN, 0x00),
        (reg.USER_CTRL, 0x00),
        (reg.SMPLRT_DIV, 0x00),
        (reg.CONFIG, FILTER),
        (reg.ACCEL_CONFIG2, FILTER),
        (reg.INT_ENABLE, reg.DATA_READY),
    ):
        bus.write_byte(address, register, value)
    codes = bus.read_block(address, reg.SELF_TEST_GYRO, 3)
    codes += bus.read_block(address, reg.SELF_TEST_ACCEL, 3)
    means = []
    for bits in (0x00, reg.SELF_TEST_ON):
        bus.write_byte(address, reg.GYRO_CONFIG, bits)
        bus.write_byte(address, reg.ACCEL_CONFIG, bits)
        bus.pause(SETTLE_S)
        means.append(_mean_counts(bus, address))
    return judge_self_test(codes, means[0], means[1])


def _mean_counts(bus: Bus, address: int) -> Counts:
    """(6,) mean of the accelerometer's and the gyro's counts over the samples to come."""
    rows = []
    for _ in range(SAMPLES):
        _await_data(bus, address)
        burst = bus.read_block(address, reg.ACCEL_OUT, reg.FRAME_BYTES)
        ax, ay, az, _, gx, gy, gz = struct.unpack(">7h", burst)
        rows.append((ax, ay, az, gx, gy, gz))
    return np.asarray(np.mean(rows, axis=0), float)


def _await_data(bus: Bus, address: int) -> None:
    end_ns = bus.now_ns() + 100_000_000
    while not bus.read_block(address, reg.INT_STATUS, 1)[0] & reg.DATA_READY:
        if bus.now_ns() > end_ns:
            raise DeviceFaultError(
                f"MPU-9250 at 0x{address:02x} on {bus.name}: gives no data in its self test; take "
                "its power away for a moment and try again"
            )
        bus.pause(0.0002)


def _gyro_answers(ratio: float, answer_deg_s: float) -> bool:
    if np.isnan(ratio):
        return abs(answer_deg_s) > GYRO_LEAST_DEG_S
    return ratio > GYRO_LEAST_RATIO


def _accel_answers(ratio: float, answer_g: float) -> bool:
    if np.isnan(ratio):
        return ACCEL_LIMITS_G[0] <= abs(answer_g) <= ACCEL_LIMITS_G[1]
    return ACCEL_RATIOS[0] < ratio < ACCEL_RATIOS[1]
