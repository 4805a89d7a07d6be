from __future__ import annotations

import math
from typing import Any

import pytest

from capture.clock import UtcLine
from capture.messages import typestore
from capture.recording.translation import LogMessage
from capture.recording.vesc import ODOMETRY_TOPIC, VescTranslator, telemetry_fields
from capture.topics import DRIVE_TOPIC, DRIVE_TYPE, ODOMETRY_TYPE, RAW_VESC_TOPIC, VESC_STATE_TOPIC
from drivers import Chunk, Reading
from drivers.vesc import DriveCommand, VescCalibration, VescValues

UTC = UtcLine(0, 10**18)
CALIBRATION = VescCalibration(
    speed_to_erpm_gain=4614.0,
    steering_angle_to_servo_gain=-1.2135,
    steering_angle_to_servo_offset=0.5304,
    wheelbase_m=0.25,
)


def values(t_ns: int, tachometer: int, erpm: float = 4614.0) -> VescValues:
    return VescValues(t_ns, 0, erpm=erpm, tachometer=tachometer, tachometer_abs=abs(tachometer))


def messages(translator: VescTranslator, *samples: VescValues | DriveCommand) -> list[LogMessage]:
    return list(translator.messages(Reading((Chunk(10**9, b"x"),), (), samples)))


def test_telemetry_is_in_the_units_of_f1tenth() -> None:
    told = VescValues(0, 0, charge_drawn_coulomb=3600.0, energy_drawn_joule=7200.0, fault=2)
    fields = telemetry_fields(told)
    assert (fields["charge_drawn"], fields["energy_drawn"], fields["fault_code"]) == (1.0, 2.0, 2)
    assert "displacement" not in fields
    assert telemetry_fields(VescValues(0, 0, position_rad=math.pi))["pid_pos_now"] == 180.0


def test_a_state_is_stamped_when_it_was_true() -> None:
    raw, state = messages(VescTranslator(UTC, CALIBRATION), values(5, 0))
    assert (raw.topic, state.topic) == (RAW_VESC_TOPIC, VESC_STATE_TOPIC)
    assert (state.stamp_ns, state.arrival_ns) == (10**18 + 5, 10**9)


def test_without_the_servo_nobody_knows_how_the_car_turned_and_no_odometry_is_made() -> None:
    translator = VescTranslator(UTC, CALIBRATION)
    topics = {m.topic for k in range(5) for m in messages(translator, values(k, 100 * k))}
    assert topics == {RAW_VESC_TOPIC, VESC_STATE_TOPIC}


def test_with_the_servo_odometry_bends_and_the_command_is_kept() -> None:
    translator = VescTranslator(UTC, CALIBRATION)
    servo = DriveCommand(0, "servo", 0.4, 0.4)
    _, drive = messages(translator, servo)
    command: Any = typestore().deserialize_cdr(drive.data, DRIVE_TYPE)
    assert drive.topic == DRIVE_TOPIC
    assert command.drive.steering_angle == pytest.approx(0.107458, abs=1e-6)
    assert math.isnan(command.drive.speed)
    last: Any = None
    for k in range(11):  # a metre in ten steps
        found = messages(translator, values(k * 10**8, round(46.14 * k)))
        last = next((m for m in found if m.topic == ODOMETRY_TOPIC), None)
    odometry: Any = typestore().deserialize_cdr(last.data, ODOMETRY_TYPE)
    assert odometry.twist.twist.linear.x == pytest.approx(1.0)
    assert odometry.twist.twist.angular.z == pytest.approx(0.431493, abs=1e-5)
    z, w = odometry.pose.pose.orientation.z, odometry.pose.pose.orientation.w
    assert 2 * math.atan2(z, w) == pytest.approx(0.4315 * 461 / 461.4, abs=1e-3)


def test_a_commanded_speed_is_kept_in_metres_a_second() -> None:
    translator = VescTranslator(UTC, CALIBRATION)
    _, drive = messages(translator, DriveCommand(0, "rpm", 9228.0, 9228.0))
    command: Any = typestore().deserialize_cdr(drive.data, DRIVE_TYPE)
    assert command.drive.speed == pytest.approx(2.0)
    _, stop = messages(translator, DriveCommand(0, "stop", 0.0, 0.0, "the program asked"))
    stopped: Any = typestore().deserialize_cdr(stop.data, DRIVE_TYPE)
    assert math.isnan(stopped.drive.speed)
