"""What a session itself says of how it is to be read, where a person said nothing."""

from __future__ import annotations

from dataclasses import replace

from capture import Session
from drivers.vesc import VescCalibration
from slam.algorithms import CONES, ODOMETRY, Request
from slam.sources import IMU_PREFIX, TACHOMETER

IMU_DEVICES = ("mpu9250", "razor")


def for_session(request: Request, session: Session) -> Request:
    """The request with what the session holds: its calibrations, and whose word on turning.

    A recorder that only listens does not know the servo, so it makes no odometry of the motor
    controller: there the counted distance with the turning of the gyro is taken, or without an IMU
    with that of the commands. So it is where the motor was calibrated after the recording: its
    `/vesc/odom` was made by the words of the rig. What a person said goes before.
    """
    known = [*_lidar_pose(session), *_gyro(session)]
    calibration = session.motor_calibration()
    if calibration is not None:
        known += [
            f"{ODOMETRY}metres_per_count={calibration.metres_per_count!r}",
            f"{ODOMETRY}wheelbase_m={calibration.wheelbase_m!r}",
            *_steering(calibration, session.recorded_motor_calibration()),
        ]
    source = request.odometry
    if source is None and calibration is not None and _counts(session, calibration):
        has_imu = any(name in session.info.devices for name in IMU_DEVICES)
        source = f"{IMU_PREFIX}{TACHOMETER}" if has_imu else TACHOMETER
    if not known:
        return request
    return replace(request, odometry=source, settings=(*known, *request.settings))


def _counts(session: Session, calibration: VescCalibration) -> bool:
    """Whether the counts tell more than the odometry that was recorded."""
    if "vesc" not in session.info.devices:
        return False
    sources = session.odometry_sources
    made_anew = calibration != session.recorded_motor_calibration()
    return not sources or (made_anew and sources[0] == "vesc")


def _steering(calibration: VescCalibration, believed: VescCalibration | None) -> list[str]:
    """How the angles of `/drive`, which the rig made of the servo, become those of the wheels."""
    if believed is None or believed == calibration:
        return []
    gain = believed.steering_angle_to_servo_gain
    straight = calibration.steering_angle_to_servo_offset - believed.steering_angle_to_servo_offset
    return [
        f"{ODOMETRY}steering_offset_rad={straight / gain!r}",
        f"{ODOMETRY}steering_scale={gain / calibration.steering_angle_to_servo_gain!r}",
    ]


def _lidar_pose(session: Session) -> list[str]:
    """Where the lidar sits on the car, if that was calibrated."""
    found = session.measured("lidar")
    names = ("x_m", "y_m", "yaw_rad")
    return [f"{CONES}mounting.{name}={found[name]!r}" for name in names if name in found]


def _gyro(session: Session) -> list[str]:
    """Scale and delay of the gyro, and its bias for when the car never stands."""
    found = session.measured("imu")
    scale = found.get("gyro_scale", 1.0)
    told = {"gyro_scale": scale} if "gyro_scale" in found else {}
    if "gyro_bias_z_rad_s" in found:
        told["gyro_usual_bias_rad_s"] = scale * found["gyro_bias_z_rad_s"]
    if "gyro_late_s" in found:
        told["imu_offset_s"] = -found["gyro_late_s"]
    return [f"{ODOMETRY}{name}={value!r}" for name, value in told.items()]
