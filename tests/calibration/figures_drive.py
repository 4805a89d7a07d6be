"""A car that drives lines and circles to both sides: exact truth and its sensors."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from capture import GroundTruth, Imu, Session, SessionInfo, point_cloud_message
from capture.sensor_messages import (
    drive_message,
    imu_message,
    magnetic_field_message,
    vesc_telemetry_message,
)
from capture.topics import (
    DRIVE_TOPIC,
    DRIVE_TYPE,
    IMU_TOPIC,
    IMU_TYPE,
    MAGNETIC_FIELD_TOPIC,
    MAGNETIC_FIELD_TYPE,
    POINTS_TOPIC,
    POINTS_TYPE,
    VESC_STATE_TOPIC,
    VESC_STATE_TYPE,
)
from drivers.vesc import VescCalibration
from geometry import (
    Floats,
    LandmarkMap,
    Stamps,
    Trajectory,
    compose,
    inverse,
    transform_points,
    wrap,
)

START_NS = 1_700_000_000_000_000_000
STEP_S = 0.002
STAND_S = 2.0
Plan = tuple[tuple[float, float, float], ...]
FIGURES: Plan = (
    (2.0, 0.0, 0.7),
    (9.0, 0.30, 0.7),
    (9.0, -0.30, 0.7),
    (4.0, 0.20, 1.2),
    (4.0, -0.20, 1.2),
    (3.0, 0.38, 0.6),
    (3.0, -0.38, 0.6),
    (2.0, 0.0, 1.0),
)
"""Seconds, steering angle, speed."""
BELIEVED = VescCalibration(
    speed_to_erpm_gain=4614.0,
    steering_angle_to_servo_gain=-1.2135,
    steering_angle_to_servo_offset=0.5304,
    wheelbase_m=0.27,
)
CONES = np.array([[1.0, 0.6], [2.2, -0.8], [-0.6, 1.3], [0.2, -1.2], [1.6, 2.0], [-1.5, 0.1]])


@dataclass(frozen=True)
class Truth:
    """How the car is; noise of what looks at it."""

    car: VescCalibration = field(
        default_factory=lambda: VescCalibration(
            speed_to_erpm_gain=4480.0,
            steering_angle_to_servo_gain=-1.16,
            steering_angle_to_servo_offset=0.512,
            wheelbase_m=0.26,
        )
    )
    servo_lag_s: float = 0.06
    understeer_s2_per_m2: float = 0.01
    slip: float = 0.012
    gyro_scale: float = 1.012
    gyro_bias_rad_s: float = 0.02
    gyro_late_s: float = 0.004
    xy_noise_m: float = 0.0006
    heading_noise_rad: float = 0.004
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose of the true base_link in that of the written truth."""
    lidar: tuple[float, float, float] = (0.13, 0.0, 0.02618)
    lidar_late_s: float = 0.0
    range_bias_m: float = 0.0
    range_noise_m: float = 0.005


@dataclass(frozen=True)
class Motion:
    """Every `STEP_S`: pose of the rear axle's middle, distance, turn rate, commands."""

    t_s: Floats
    pose: Floats
    distance_m: Floats
    rate_rad_s: Floats
    servo: Floats
    speed_m_s: Floats

    def at(self, t_s: Floats) -> Floats:
        """Poses (k, 3)."""
        return np.stack([np.interp(t_s, self.t_s, column) for column in self.pose.T], axis=1)


def driven(plan: Plan, truth: Truth) -> Motion:
    total = STAND_S + sum(seconds for seconds, _, _ in plan) + 1.0
    t_s = np.arange(0.0, total, STEP_S)
    angle, speed, at = np.zeros(t_s.size), np.zeros(t_s.size), STAND_S
    for seconds, steering, goal in plan:
        rows = (t_s >= at) & (t_s < at + seconds)
        angle[rows], speed[rows] = steering, goal
        at += seconds
    speed = np.convolve(speed, np.ones(150) / 150, mode="same")  # a motor takes 0.3 s
    car = truth.car
    servo = car.steering_angle_to_servo_gain * angle + car.steering_angle_to_servo_offset
    # It turns over twice half the lag, so that the mean of its delays is the lag.
    late = round(0.5 * truth.servo_lag_s / STEP_S)
    moved = np.concatenate([np.repeat(servo[:1], 2 * late), servo])[: servo.size]
    moved = np.convolve(np.pad(moved, (late, late), mode="edge"), np.ones(2 * late + 1), "valid")
    moved = moved / (2 * late + 1)
    real = (moved - car.steering_angle_to_servo_offset) / car.steering_angle_to_servo_gain
    stiff = car.wheelbase_m * (1.0 + truth.understeer_s2_per_m2 * speed**2)
    rate = speed * np.tan(real) / stiff
    heading = np.concatenate([[0.3], 0.3 + np.cumsum(rate[:-1]) * STEP_S])
    course = heading + 0.5 * rate * STEP_S - truth.slip * speed * rate
    x, y = (np.concatenate([[0.0], np.cumsum(speed[:-1] * f(course[:-1])) * STEP_S])
            for f in (np.cos, np.sin))  # fmt: skip
    distance = np.concatenate([[0.0], np.cumsum(speed[:-1]) * STEP_S])
    return Motion(t_s, np.stack([x, y, heading], axis=1), distance, rate, servo, speed)


def stamps(t_s: Floats) -> Stamps:
    return START_NS + np.rint(t_s * 1e9).astype(np.int64)


def ground_truth(motion: Motion, truth: Truth, rng: np.random.Generator) -> GroundTruth:
    """The film's: 30 Hz, from rings whose lever arm is believed wrong by `truth.lever`."""
    t_s = np.arange(0.1, motion.t_s[-1] - 0.1, 1.0 / 30.0)
    poses = compose(motion.at(t_s), inverse(np.array(truth.lever)))
    poses[:, :2] += rng.normal(0.0, truth.xy_noise_m, (t_s.size, 2))
    poses[:, 2] = wrap(poses[:, 2] + rng.normal(0.0, truth.heading_noise_rad, t_s.size))
    scene = {"car": {"front_x_m": 0.25, "rear_x_m": 0.05, "side_m": 0.0, "lever_sigma_m": 0.001}}
    cones = LandmarkMap(np.arange(1, len(CONES) + 1), CONES)
    return GroundTruth(Trajectory.from_poses(stamps(t_s), poses), cones, {"scene": scene})


def imu_of(motion: Motion, truth: Truth, rng: np.random.Generator) -> Imu:
    t_s = np.arange(0.0, motion.t_s[-1], 0.005)
    # A step's rate is that of its middle.
    rate = np.interp(t_s - truth.gyro_late_s, motion.t_s + STEP_S / 2, motion.rate_rad_s)
    rate = rate / truth.gyro_scale
    gyro = rng.normal(0.0, 0.002, (t_s.size, 3))
    gyro[:, 2] += rate + truth.gyro_bias_rad_s
    speed = np.interp(t_s, motion.t_s, motion.speed_m_s)
    force = rng.normal(0.0, 0.03, (t_s.size, 3)) * (1.0 + 10.0 * (speed > 0))[:, None]
    force[:, 2] += 9.80665
    return Imu(stamps(t_s), gyro, force)


def write_session(
    folder: Path,
    plan: Plan = FIGURES,
    truth: Truth = Truth(),
    seed: int = 0,
    *,
    drive: bool = True,
    motor: bool = True,
    gyro: bool = True,
    scans: bool = False,
    clutter: bool = True,
) -> Session:
    """A session as `record`, `join` and `track` leave it."""
    rng, motion = np.random.default_rng(seed), driven(plan, truth)
    info = SessionInfo(
        map="figures", power="low", configuration={"rig": {"vesc_calibration": vars(BELIEVED)}}
    )
    with Session.create(folder, info) as writer:
        writer.add_ground_truth(ground_truth(motion, truth, rng))
        if motor:
            t_ns, data = _motor(motion, truth)
            writer.add_messages(VESC_STATE_TOPIC, VESC_STATE_TYPE, data, t_ns)
        if drive:
            t_ns, data = _drive(motion)
            writer.add_messages(DRIVE_TOPIC, DRIVE_TYPE, data, t_ns)
        if gyro:
            imu = imu_of(motion, truth, rng)
            writer.add_messages(IMU_TOPIC, IMU_TYPE, imu_messages(imu), imu.t_ns)
        if scans:
            t_ns, data = _scans(motion, truth, rng, clutter=clutter)
            writer.add_messages(POINTS_TOPIC, POINTS_TYPE, data, t_ns)
    return Session.open(folder)


def imu_messages(imu: Imu) -> list[bytes]:
    rows = zip(
        imu.t_ns.tolist(),
        imu.angular_velocity_rad_s.tolist(),
        imu.linear_acceleration_m_s2.tolist(),
        strict=True,
    )
    return [imu_message(t, "imu", tuple(w), tuple(a)) for t, w, a in rows]


def write_imu_session(folder: Path, imu: Imu, field_t: Floats | None = None) -> Session:
    """A session of an IMU alone."""
    with Session.create(folder, SessionInfo(map="bench")) as writer:
        writer.add_messages(IMU_TOPIC, IMU_TYPE, imu_messages(imu), imu.t_ns)
        if field_t is not None:
            data = [
                magnetic_field_message(t, "imu", tuple(b))
                for t, b in zip(imu.t_ns.tolist(), field_t.tolist(), strict=True)
            ]
            writer.add_messages(MAGNETIC_FIELD_TOPIC, MAGNETIC_FIELD_TYPE, data, imu.t_ns)
    return Session.open(folder)


def _motor(motion: Motion, truth: Truth) -> tuple[Stamps, list[bytes]]:
    t_s = np.arange(0.013, motion.t_s[-1], 0.02)
    gain = truth.car.speed_to_erpm_gain
    counts = np.interp(t_s, motion.t_s, motion.distance_m) * gain / 10.0
    erpm = np.interp(t_s, motion.t_s, motion.speed_m_s) * gain
    data = [
        vesc_telemetry_message(t, {"displacement": round(c), "speed": e})
        for t, c, e in zip(stamps(t_s).tolist(), counts.tolist(), erpm.tolist(), strict=True)
    ]
    return stamps(t_s), data


def _drive(motion: Motion) -> tuple[Stamps, list[bytes]]:
    """What the recorder makes of servo values with the calibration it believed."""
    t_s = np.arange(0.0, motion.t_s[-1], 0.02)
    row = np.searchsorted(motion.t_s, t_s + 1e-9) - 1
    data = [
        drive_message(t, BELIEVED.steering_angle_rad(servo), speed)
        for t, servo, speed in zip(
            stamps(t_s).tolist(), motion.servo[row].tolist(), motion.speed_m_s[row].tolist(),
            strict=True,
        )
    ]  # fmt: skip
    return stamps(t_s), data


def _scans(
    motion: Motion, truth: Truth, rng: np.random.Generator, *, clutter: bool, beams: int = 720
) -> tuple[Stamps, list[bytes]]:
    """Revolutions of 15 Hz among cones, and things that only look like some."""
    things = [*CONES.tolist(), *([[0.9, -0.4], [-0.9, 0.8]] if clutter else [])]
    mounting = np.array(truth.lidar)
    found, t_all = [], []
    for first_s in np.arange(0.2, motion.t_s[-1] - 0.3, 1.0 / 15.0).tolist():
        shot_s = first_s + np.arange(beams) / beams / 15.0
        bearing = wrap(-2.0 * np.pi * np.arange(beams) / beams)
        pose = compose(motion.at(shot_s), mounting)
        reach = np.full(beams, np.inf)
        for thing in things:
            seen = transform_points(inverse(pose), np.tile(thing, (beams, 1)))
            along = seen[:, 0] * np.cos(bearing) + seen[:, 1] * np.sin(bearing)
            aside = seen[:, 1] * np.cos(bearing) - seen[:, 0] * np.sin(bearing)
            hit = (along > 0) & (np.abs(aside) < 0.05)
            depth = np.sqrt(np.maximum(0.05**2 - aside**2, 0.0))
            reach = np.where(hit, np.minimum(reach, along - depth), reach)
        noise = rng.normal(0.0, truth.range_noise_m, beams) + truth.range_bias_m
        told = np.where(np.isfinite(reach) & (reach < 4.0), reach + noise, np.nan)
        t_ns = stamps(shot_s + truth.lidar_late_s)
        found.append(point_cloud_message(int(t_ns[0]), t_ns, told, bearing, np.full(beams, 40.0)))
        t_all.append(int(t_ns[0]))
    return np.array(t_all, np.int64), found
