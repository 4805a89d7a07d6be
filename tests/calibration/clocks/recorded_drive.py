"""A drive as two sessions: of the car, as `record` leaves it, and of the film, tracked or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from synthetic_drives import METRES_PER_COUNT, Drive

from capture import Session, SessionInfo
from capture.log_writer import LogWriter
from capture.sensor_messages import image_message, imu_message, vesc_telemetry_message
from capture.session_writer import new_session
from capture.topics import (
    IMAGE_TYPE,
    IMU_TOPIC,
    IMU_TYPE,
    OVERHEAD_TOPIC,
    VESC_STATE_TOPIC,
    VESC_STATE_TYPE,
)

RIG = {
    "vesc_calibration": {
        "speed_to_erpm_gain": 10.0 / METRES_PER_COUNT,
        "steering_angle_to_servo_gain": -1.2,
        "steering_angle_to_servo_offset": 0.5,
        "wheelbase_m": 0.26,
    }
}


def car_session(folder: Path, drive: Drive, info: SessionInfo | None = None) -> Path:
    """Gyro and counts of a drive."""
    imu, vesc = drive.imu(), drive.vesc()
    turned = [
        imu_message(t_ns, "imu", (0.0, 0.0, rate), (0.0, 0.0, 9.81))
        for t_ns, rate in zip(
            imu.t_ns.tolist(), imu.angular_velocity_rad_s[:, 2].tolist(), strict=True
        )
    ]
    counted = [
        vesc_telemetry_message(t_ns, {"displacement": counts})
        for t_ns, counts in zip(vesc.t_ns.tolist(), vesc.tachometer.tolist(), strict=True)
    ]
    usual = SessionInfo(map="eight", devices={"imu": {"model": "toy"}}, configuration={"rig": RIG})
    with new_session(folder, info or usual) as writer:
        writer.add_messages(IMU_TOPIC, IMU_TYPE, turned, imu.t_ns)
        writer.add_messages(VESC_STATE_TOPIC, VESC_STATE_TYPE, counted, vesc.t_ns)
    return folder


def film_session(
    folder: Path,
    drive: Drive,
    info: SessionInfo | None = None,
    provenance: Mapping[str, object] | None = None,
) -> Path:
    """A film that was tracked: a few pictures, and the truth on the film's clock."""
    truth = replace(drive.truth(), provenance=provenance or {})
    usual = SessionInfo(map="eight", devices={"overhead": {"card": "toy"}}, verdict="good")
    with Session.create(folder, info or usual) as writer:
        writer.add_ground_truth(truth)
    (folder / "ground_truth" / "track.html").write_text("a page")
    with LogWriter(folder / "overhead.mcap", sync_period_s=None) as log:
        for t_ns in truth.path.t_ns[:20].tolist():
            message = image_message(t_ns, "overhead", "jpeg", b"\xff\xd8 a picture \xff\xd9")
            log.write(OVERHEAD_TOPIC, IMAGE_TYPE, message, log_t_ns=t_ns + 9, stamp_ns=t_ns)
    return folder
