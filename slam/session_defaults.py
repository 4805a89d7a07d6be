"""What a session itself says of how it is to be read, where a person said nothing."""

from __future__ import annotations

from dataclasses import replace

from capture import Session
from slam.algorithms import ODOMETRY, Request
from slam.sources import IMU_PREFIX, TACHOMETER

IMU_DEVICES = ("mpu9250", "razor")


def for_session(request: Request, session: Session) -> Request:
    """The request with what was recorded: the motor's calibration, and whose word on turning.

    A recorder that only listens does not know the servo, so it makes no odometry of the motor
    controller: there the counted distance with the turning of the gyro is taken, or without an IMU
    with that of the commands. What a person said goes before.
    """
    calibration = session.motor_calibration()
    if calibration is None:
        return request
    known = (
        f"{ODOMETRY}metres_per_count={calibration.metres_per_count!r}",
        f"{ODOMETRY}wheelbase_m={calibration.wheelbase_m!r}",
    )
    source = request.odometry
    if source is None and "vesc" in session.info.devices and not session.odometry_sources:
        has_imu = any(name in session.info.devices for name in IMU_DEVICES)
        source = f"{IMU_PREFIX}{TACHOMETER}" if has_imu else TACHOMETER
    return replace(request, odometry=source, settings=(*known, *request.settings))
