from __future__ import annotations

import contextlib
import math
from dataclasses import asdict

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import ProtocolError
from drivers.vesc import (
    Firmware,
    FrameReceiver,
    VescValues,
    decode_imu,
    decode_setup,
    decode_values,
    encode_frame,
)
from drivers.vesc.emulated_replies import encode_setup, encode_values

OLD, NEW = Firmware(2, 18), Firmware(5, 3)

# Unit tests of the `vesc` crate of Rust: two real frames of firmware from 5.03 on.
FORWARD = """
    02 4A 04 01 14 00 00 00 00 00 25 00 00 00 03 00 00 00 00 00 00 00 20 00 6E 00 00 03 FB 01 7D
    00 00 00 11 00 00 00 00 00 00 02 89 00 00 00 00 FF FF 6F 4B 00 02 9F C7 00 04 6A 7C 28 01 01 15
    FC 4C FC 0D 00 00 00 E5 00 00 08 D6 00 3A 97 03"""
REVERSE = """
    02 4A 04 01 0D 00 00 00 00 00 5C 00 00 00 0C 00 00 00 00 FF FF FF A9 FF 13 FF FF F7 5E 01 75
    00 00 00 07 00 00 00 00 00 00 01 12 00 00 00 00 FF FF 91 BA 00 02 0B 40 00 0D E4 E6 F0 14 01 0D
    FC 73 FC 4C 00 00 00 E6 FF FF F0 81 00 0C 33 03"""
# Computed for reference/protocols.md B.6 from the layouts in vedderb/bldc.
OF_2_18 = """
    02 38 04 00 FB 00 FC 00 FD 00 FE 00 FF 01 00 01 2D 00 00 00 7B 00 00 00 2D 00 6E 00 00 03 FB
    00 76 00 00 00 11 00 00 00 00 00 00 02 89 00 00 00 00 FF FF 6F 4B 00 02 9F C7 00 CB E7 03"""
OF_3_40 = """
    02 3B 04 01 14 00 00 00 00 00 25 00 00 00 03 00 00 00 00 00 00 00 20 00 6E 00 00 03 FB 00 76
    00 00 00 11 00 00 00 00 00 00 02 89 00 00 00 00 FF FF 6F 4B 00 02 9F C7 00 04 6A 7C 28 01 F4 80
    03"""
# The `vesc` crate again: a real selective reply, mask 0x0002A18A.
SELECTED = "02 17 32 00 02 A1 8A 00 00 00 00 00 04 00 00 03 DD 01 77 FF FF AA 2B 00 14 2D 3A 03"


def payload_of(frame: str) -> bytes:
    (only,) = FrameReceiver().feed(bytes.fromhex(frame))
    return only.payload


def told(values: object) -> dict[str, float]:
    """The fields that a reply brought."""
    fields = asdict(values).items()  # type: ignore[call-overload]  # a dataclass of either kind
    return {name: v for name, v in fields if v is not None and not math.isnan(v)}


def test_the_frame_of_a_car_that_goes_forward() -> None:
    values = decode_values(payload_of(FORWARD), NEW, 7, 3)
    expected = {
        "t_ns": 7,
        "uncertainty_ns": 3,
        "fet_celsius": 27.6,
        "motor_celsius": 0.0,
        "motor_current_a": 0.37,
        "input_current_a": 0.03,
        "d_current_a": 0.0,
        "q_current_a": 0.32,
        "duty": 0.110,
        "erpm": 1019.0,
        "input_voltage_v": 38.1,
        "charge_drawn_coulomb": pytest.approx(0.0017 * 3600, rel=1e-14),
        "charge_regained_coulomb": 0.0,
        "energy_drawn_joule": pytest.approx(0.0649 * 3600, rel=1e-14),
        "energy_regained_joule": 0.0,
        "tachometer": -37045,
        "tachometer_abs": 171975,
        "fault": 0,
        "position_rad": pytest.approx(math.radians(74.08746), abs=1e-7),
        "controller_id": 1,
        "mosfet_1_celsius": 27.7,
        "mosfet_2_celsius": -94.8,
        "mosfet_3_celsius": -101.1,
        "d_voltage_v": 0.229,
        "q_voltage_v": 2.262,
        "status": 0,
    }
    assert told(values) == expected
    assert (values.timed_out, values.kill_switch) == (False, False)


@pytest.mark.parametrize(
    ("status", "timed_out", "kill_switch"), [(1, True, False), (2, False, True), (3, True, True)]
)
def test_the_bits_of_the_status(status: int, timed_out: bool, kill_switch: bool) -> None:
    values = decode_values(payload_of(FORWARD)[:-1] + bytes((status,)), NEW)
    assert (values.timed_out, values.kill_switch) == (timed_out, kill_switch)


def test_the_frame_of_a_car_that_goes_backward() -> None:
    values = decode_values(payload_of(REVERSE), NEW)
    assert values.fet_celsius == 26.9
    assert (values.motor_current_a, values.input_current_a) == (0.92, 0.12)
    assert (values.q_current_a, values.duty, values.erpm) == (-0.87, -0.237, -2210.0)
    assert values.input_voltage_v == 37.3
    assert values.charge_drawn_coulomb == pytest.approx(0.0007 * 3600)
    assert values.energy_drawn_joule == pytest.approx(0.0274 * 3600)
    assert (values.tachometer, values.tachometer_abs) == (-28230, 133952)
    assert (values.fault, values.controller_id, values.q_voltage_v) == (0, 20, -3.967)


def test_the_same_frame_with_a_fault() -> None:
    """B.6: with fault byte 02 the CRC is B7 FE."""
    payload = bytearray(payload_of(REVERSE))
    payload[53] = 2
    assert encode_frame(bytes(payload))[-3:] == bytes.fromhex("B7 FE 03")
    assert decode_values(bytes(payload), NEW).fault == 2


def test_the_frame_of_firmware_2_18() -> None:
    values = decode_values(payload_of(OF_2_18), OLD)
    expected = {f"mosfet_{number}_celsius": 25.0 + number / 10 for number in range(1, 7)}
    expected |= {
        "t_ns": 0,
        "uncertainty_ns": 0,
        "board_celsius": 30.1,
        "motor_current_a": 1.23,
        "input_current_a": 0.45,
        "duty": 0.110,
        "erpm": 1019.0,
        "input_voltage_v": 11.8,
        "charge_drawn_coulomb": 0.0017 * 3600,
        "charge_regained_coulomb": 0.0,
        "energy_drawn_joule": 0.0649 * 3600,
        "energy_regained_joule": 0.0,
        "tachometer": -37045,
        "tachometer_abs": 171975,
        "fault": 0,
    }
    assert told(values) == pytest.approx(expected, rel=1e-14)
    assert (values.timed_out, values.kill_switch) == (None, None)


def test_the_frame_of_firmware_3_40() -> None:
    values = told(decode_values(payload_of(OF_3_40), Firmware(3, 40)))
    forward = told(decode_values(payload_of(FORWARD), NEW))
    later = {"mosfet_1_celsius", "mosfet_2_celsius", "mosfet_3_celsius"}
    later |= {"d_voltage_v", "q_voltage_v", "status"}
    assert values == {
        **{name: number for name, number in forward.items() if name not in later},
        "input_voltage_v": 11.8,
    }


@pytest.mark.parametrize(
    ("size", "last", "not_told"),
    [
        (54, "fault", "position_rad"),
        (58, "position_rad", "controller_id"),
        (59, "controller_id", "mosfet_1_celsius"),
        (65, "mosfet_3_celsius", "d_voltage_v"),
        (73, "q_voltage_v", "status"),
        (74, "status", "mosfet_4_celsius"),
        (80, "status", "mosfet_4_celsius"),
    ],
)
def test_the_seven_layouts_and_longer(size: int, last: str, not_told: str) -> None:
    payload = (payload_of(FORWARD) + bytes(10))[:size]
    fields = told(decode_values(payload, NEW))
    assert fields["tachometer"] == -37045
    assert last in fields
    assert not_told not in fields


@given(st.integers(0, 90))
def test_other_lengths_are_refused_with_their_bytes(size: int) -> None:
    payload = (payload_of(FORWARD) + bytes(20))[:size]
    for firmware, lengths in ((NEW, {54, 58, 59, 65, 73, *range(74, 91)}), (OLD, {56})):
        if size in lengths:
            assert decode_values(payload, firmware).fault is not None
        else:
            with pytest.raises(ProtocolError, match=f"{size} bytes are no state"):
                decode_values(payload, firmware)


def test_a_selective_reply() -> None:
    values = told(decode_values(payload_of(SELECTED), NEW))
    assert values == {
        "t_ns": 0,
        "uncertainty_ns": 0,
        "motor_celsius": 0.0,
        "input_current_a": 0.04,
        "erpm": 989.0,
        "input_voltage_v": 37.5,
        "tachometer": -21973,
        "fault": 0,
        "controller_id": 20,
    }


@pytest.mark.parametrize(
    "payload", ["32", "32 00 00", "32 00 40 00 00", "32 00 00 00 01 00", "32 00 00 00 01 00 00 00"]
)
def test_selective_replies_that_cannot_be(payload: str) -> None:
    with pytest.raises(ProtocolError):
        decode_values(bytes.fromhex(payload), NEW)


@given(st.sampled_from([b"", b"\4", b"\x32\0\0", b"\x2f", b"\x33\0\0", b"\x41"]), st.binary())
def test_no_payload_does_more_than_a_protocol_error(start: bytes, rest: bytes) -> None:
    for decode in (lambda data: decode_values(data, NEW), decode_setup, decode_imu):
        with contextlib.suppress(ProtocolError):
            decode(start + rest)


@pytest.mark.parametrize("version", [(2, 18), (3, 7), (3, 34), (3, 40), (3, 48), (3, 60), (5, 3)])
def test_what_the_emulator_encodes_is_what_it_was(version: tuple[int, int]) -> None:
    firmware = Firmware(*version)
    before = decode_values(payload_of(FORWARD), NEW)
    payload = encode_values(before, firmware)
    lengths = {(2, 18): 56, (3, 7): 54, (3, 34): 58, (3, 40): 59, (3, 48): 65, (3, 60): 73}
    assert len(payload) == lengths.get(version, 74)
    after = told(decode_values(payload, firmware))
    common = {name: number for name, number in told(before).items() if name in after}
    assert common.items() <= after.items()


def test_the_emulator_encodes_the_real_frames_to_the_byte() -> None:
    for frame in (FORWARD, REVERSE):
        assert encode_values(decode_values(payload_of(frame), NEW), NEW) == payload_of(frame)
    old = decode_values(payload_of(OF_2_18), OLD)
    assert encode_values(old, OLD) == payload_of(OF_2_18)


def test_setup_values_in_order_and_units() -> None:
    """Built by hand from the table in B.7."""
    fields = (
        *("0114 00C8", "0000007B", "0000002D", "006E", "000003FB", "000003E8"),  # 1 m/s
        *("0076", "02EE", "00000011", "00000000", "00000289", "00000000"),  # 75 % full
        *("000007D0", "00000BB8", "055D4A80", "02", "07", "01"),  # 2 m, 3 m, 90 degrees
        *("000186A0", "000004D2", "0000EA60"),  # 100 Wh, 1234 m, 60 s
    )
    setup = decode_setup(bytes.fromhex("2f" + "".join(fields)))
    assert (setup.fet_celsius, setup.motor_celsius) == (27.6, 20.0)
    assert (setup.motor_current_a, setup.input_current_a) == (1.23, 0.45)
    assert (setup.duty, setup.erpm, setup.speed_m_s) == (0.11, 1019.0, 1.0)
    assert (setup.input_voltage_v, setup.battery_level) == (11.8, 0.75)
    assert (setup.distance_m, setup.distance_abs_m) == (2.0, 3.0)
    assert setup.position_rad == pytest.approx(math.pi / 2)
    assert (setup.fault, setup.controller_id, setup.vescs) == (2, 7, 1)
    assert setup.energy_left_joule == pytest.approx(360_000.0)
    assert (setup.odometer_m, setup.uptime_s) == (1234.0, 60.0)


def test_setup_values_of_firmware_that_tells_less_and_of_a_mask() -> None:
    values = VescValues(0, 0, erpm=4614.0, tachometer=4614, fault=0)
    whole = encode_setup(values, None)
    shorter = decode_setup(whole[:-8])  # before the odometer and the uptime
    assert shorter.speed_m_s == 1.0
    assert shorter.energy_left_joule == 0.0
    assert math.isnan(shorter.odometer_m)
    chosen = decode_setup(encode_setup(values, 1 << 6 | 1 << 13))
    assert told(chosen) == {"speed_m_s": 1.0, "distance_m": 10.0}
    for wrong in (whole[:-1], whole[:0], encode_setup(values, 1 << 6) + b"\0"):
        with pytest.raises(ProtocolError, match="no setup values"):
            decode_setup(wrong)


def test_imu_data_in_si_units() -> None:
    """B.7: 1 g and 90 deg/s, IEEE 754 big endian."""
    imu = decode_imu(bytes.fromhex("41 01 08 3F800000 42B40000"))
    assert told(imu) == {
        "acceleration_x_m_s2": 9.80665,
        "gyro_z_rad_s": pytest.approx(math.pi / 2),
    }
    assert decode_imu(bytes.fromhex("41 00 04 40490FDB 05")).controller_id == 5
    assert decode_imu(bytes.fromhex("41 00 04 40490FDB")).yaw_rad == pytest.approx(math.pi)
    with pytest.raises(ProtocolError, match="no IMU data"):
        decode_imu(bytes.fromhex("41 00 0C 40490FDB"))
