"""What a motor controller reads -> `/raw/vesc`, `/vesc/state`, `/vesc/odom`, `/drive`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from capture.clock import UtcLine
from capture.recording.translation import LogMessage, raw_messages
from capture.sensor_messages import drive_message, odometry_message, vesc_telemetry_message
from capture.topics import (
    DRIVE_TOPIC,
    DRIVE_TYPE,
    LOG_NAME,
    ODOMETRY_TYPE,
    RAW_VESC_TOPIC,
    VESC_STATE_TOPIC,
    VESC_STATE_TYPE,
    odometry_topic,
)
from drivers import Reading
from drivers.vesc import (
    DriveCommand,
    VescCalibration,
    VescOdometry,
    VescValues,
    advance_odometry,
    begin_odometry,
)

COULOMB_PER_AH = JOULE_PER_WH = 3600.0
ODOMETRY_TOPIC = odometry_topic("vesc")


class VescTranslator:
    """Messages of one motor controller.

    calibration : makes the odometry; it is written only while the servo's position is known, for
    without it nobody knows how the car turned (`slam --odometry imu+tachometer` asks the gyro).
    """

    log_name = LOG_NAME
    topic = VESC_STATE_TOPIC

    def __init__(self, utc: UtcLine, calibration: VescCalibration | None = None) -> None:
        self._utc, self._calibration = utc, calibration
        self._odometry: VescOdometry | None = None
        self._servo: float | None = None
        self._erpm = math.nan

    def messages(self, reading: Reading[VescValues | DriveCommand]) -> Iterator[LogMessage]:
        """The raw bytes, then each state and, where the servo is known, the odometry."""
        yield from raw_messages(reading, RAW_VESC_TOPIC, self._utc)
        for sample in reading.samples:
            if isinstance(sample, DriveCommand):
                yield self._command(sample)
                continue
            stamp_ns = self._utc.utc(sample.t_ns)
            arrival_ns = reading.raw[-1].t_ns if reading.raw else sample.t_ns
            data = vesc_telemetry_message(stamp_ns, telemetry_fields(sample))
            yield LogMessage(VESC_STATE_TOPIC, VESC_STATE_TYPE, data, arrival_ns, stamp_ns)
            driven = self._driven(sample)
            if driven is not None:
                pose = (driven.x_m, driven.y_m, driven.heading_rad)
                data = odometry_message(stamp_ns, pose, driven.speed_m_s, driven.yaw_rate_rad_s)
                yield LogMessage(ODOMETRY_TOPIC, ODOMETRY_TYPE, data, arrival_ns, stamp_ns)

    def _command(self, command: DriveCommand) -> LogMessage:
        """What was commanded last of steering and speed; NaN for what never was."""
        if command.kind == "servo":
            self._servo = command.sent
        else:
            self._erpm = command.sent if command.kind == "rpm" else math.nan
        angle_rad, speed_m_s = math.nan, math.nan
        if self._calibration is not None:
            speed_m_s = self._calibration.speed_m_s(self._erpm)
            if self._servo is not None:
                angle_rad = self._calibration.steering_angle_rad(self._servo)
        stamp_ns = self._utc.utc(command.t_ns)
        data = drive_message(stamp_ns, angle_rad, speed_m_s)
        return LogMessage(DRIVE_TOPIC, DRIVE_TYPE, data, command.t_ns, stamp_ns)

    def state(self) -> Mapping[str, object]:
        """Whether odometry is being made."""
        return {"servo": "unknown" if self._servo is None else f"{self._servo:.3f}"}

    def _driven(self, values: VescValues) -> VescOdometry | None:
        """The odometry since the servo is known; None before."""
        if self._calibration is None or values.tachometer is None or self._servo is None:
            return None
        if self._odometry is None:
            self._odometry = begin_odometry(values, self._calibration)
            return None
        self._odometry = advance_odometry(
            self._odometry, values, self._calibration, servo=self._servo
        )
        return self._odometry


def telemetry_fields(values: VescValues) -> dict[str, float]:
    """The state by the names and in the units of f1tenth's `vesc_msgs/VescState`.

    Degrees Celsius, amperes, volts, ampere hours, watt hours, `speed` in ERPM, `pid_pos_now` in
    degrees. What the firmware does not tell is left out.
    """
    fields: dict[str, float | None] = {
        "temp_fet": values.fet_celsius,
        "temp_motor": values.motor_celsius,
        "current_motor": values.motor_current_a,
        "current_input": values.input_current_a,
        "avg_id": values.d_current_a,
        "avg_iq": values.q_current_a,
        "duty_cycle": values.duty,
        "speed": values.erpm,
        "voltage_input": values.input_voltage_v,
        "charge_drawn": values.charge_drawn_coulomb / COULOMB_PER_AH,
        "charge_regen": values.charge_regained_coulomb / COULOMB_PER_AH,
        "energy_drawn": values.energy_drawn_joule / JOULE_PER_WH,
        "energy_regen": values.energy_regained_joule / JOULE_PER_WH,
        "displacement": values.tachometer,
        "distance_traveled": values.tachometer_abs,
        "fault_code": values.fault,
        "pid_pos_now": math.degrees(values.position_rad),
        "controller_id": values.controller_id,
        "ntc_temp_mos1": values.mosfet_1_celsius,
        "ntc_temp_mos2": values.mosfet_2_celsius,
        "ntc_temp_mos3": values.mosfet_3_celsius,
        "avg_vd": values.d_voltage_v,
        "avg_vq": values.q_voltage_v,
    }
    return {name: value for name, value in fields.items() if value is not None}
