from __future__ import annotations

import pytest

from drivers import DeviceFaultError, ProtocolError
from drivers.vesc import (
    Firmware,
    FrameReceiver,
    ReadId,
    ReadRequest,
    encode_command,
    fault_name,
    parse_firmware,
)
from drivers.vesc.commands import Kind
from drivers.vesc.requests import ASK_SETUP, ASK_VALUES, ASK_VERSION, ODOMETRY_MASK

# Computed for reference/protocols.md B.5 from the layouts in vedderb/bldc.
REPLIES = {
    (2, 18): "02 03 00 02 12 54 11 03",
    (3, 40): "02 13 00 03 28 34 31 30 00 01 02 03 04 05 06 07 08 09 0A 0B 0C FC 27 03",
    (5, 2): "02 15 00 05 02 34 31 30 00 01 02 03 04 05 06 07 08 09 0A 0B 0C 00 00 E3 18 03",
}
OLD, NEW = Firmware(2, 18), Firmware(5, 2)


def payload_of(frame: str) -> bytes:
    (only,) = FrameReceiver().feed(bytes.fromhex(frame))
    return only.payload


@pytest.mark.parametrize("version", REPLIES)
def test_the_version_replies(version: tuple[int, int]) -> None:
    firmware = parse_firmware(payload_of(REPLIES[version]))
    assert firmware.version == version
    told = version != (2, 18)
    assert firmware.hardware == ("410" if told else "")
    assert firmware.uuid == ("0102030405060708090a0b0c" if told else "")
    assert (firmware.paired, firmware.beta) == ((False, 0) if version == (5, 2) else (None, None))
    assert str(firmware) == {(2, 18): "2.18", (3, 40): "3.40", (5, 2): "5.02"}[version]


def test_what_later_firmware_appends_is_ignored() -> None:
    firmware = parse_firmware(b"\0\6\2" + b"60\0" + bytes(12) + bytes((1, 3)) + b"more")
    assert (firmware.version, firmware.hardware) == ((6, 2), "60")
    assert (firmware.paired, firmware.beta) == (True, 3)


@pytest.mark.parametrize("payload", [b"", b"\0", b"\0\5", b"\4\5\2"])
def test_what_is_no_version_reply(payload: bytes) -> None:
    with pytest.raises(ProtocolError, match="no FW_VERSION reply"):
        parse_firmware(payload)


def test_3_7_is_older_than_3_40() -> None:
    assert Firmware(3, 7).version < Firmware(3, 40).version
    assert not Firmware(3, 7).is_old
    assert Firmware(3, 0).is_old


# B.4, computed there; SET_RPM 0 and 1723 stand in MegaC-C/VescNano too.
COMMANDS: list[tuple[Firmware, Kind, float, str]] = [
    (NEW, "rpm", 0, "02 05 08 00 00 00 00 02 2D 03"),
    (OLD, "rpm", 1723, "02 05 08 00 00 06 BB BE 3B 03"),
    (NEW, "rpm", 4614, "02 05 08 00 00 12 06 07 FA 03"),
    (NEW, "rpm", -3000, "02 05 08 FF FF F4 48 90 24 03"),
    (NEW, "duty", 0.05, "02 05 05 00 00 13 88 65 F7 03"),
    (OLD, "duty", -0.05, "02 05 05 FF FF EC 78 0D D7 03"),
    (NEW, "current", 0, "02 05 06 00 00 00 00 CD 85 03"),
    (OLD, "current", 2.5, "02 05 06 00 00 09 C4 EE D5 03"),
    (NEW, "brake", 5, "02 05 07 00 00 13 88 21 74 03"),
    (NEW, "handbrake", 5, "02 05 0A 00 00 13 88 00 0E 03"),
    (NEW, "servo", 0.5, "02 03 0C 01 F4 E9 CB 03"),
    (Firmware(3, 7), "servo", 0.5304, "02 03 0C 02 12 21 70 03"),
    (OLD, "servo", 0.5, "02 03 0B 01 F4 6C 5B 03"),
    (Firmware(3, 0), "servo", 0.5, "02 03 0B 01 F4 6C 5B 03"),
    (NEW, "alive", 0, "02 01 1E F3 FF 03"),
    (OLD, "alive", 0, "02 01 1D C3 9C 03"),
]


@pytest.mark.parametrize(("firmware", "kind", "value", "frame"), COMMANDS)
def test_the_command_frames(firmware: Firmware, kind: Kind, value: float, frame: str) -> None:
    command = encode_command(firmware, kind, value)
    assert command.frame == bytes.fromhex(frame)
    assert (command.kind, command.value) == (kind, value)


def test_a_value_is_sent_as_its_nearest_step() -> None:
    """0.00007 * 100000 is 6.99... in binary: truncation would lose a step."""
    assert encode_command(NEW, "duty", 0.00007).frame[3:7] == (7).to_bytes(4, "big")
    assert encode_command(NEW, "servo", 0.5306).frame[3:5] == (531).to_bytes(2, "big")


@pytest.mark.parametrize("version", [(1, 13), (2, 7), (3, 1), (3, 6), (7, 0), (255, 255)])
@pytest.mark.parametrize("kind", ["servo", "alive", "handbrake"])
def test_an_unknown_firmware_gets_no_command_whose_id_moved(
    version: tuple[int, int], kind: Kind
) -> None:
    with pytest.raises(DeviceFaultError, match=r"packet ids are known .* will not be commanded"):
        encode_command(Firmware(*version), kind, 0.5)


def test_old_firmware_has_no_handbrake() -> None:
    with pytest.raises(DeviceFaultError, match=r"no handbrake .* use brake"):
        encode_command(OLD, "handbrake", 1.0)


def test_no_known_firmware_gets_an_id_that_does_harm_there() -> None:
    """Danger list of B.3: old 10 SET_DETECT, 12 SET_MCCONF, 28 REBOOT; new 11, 13, 29."""
    kinds: list[Kind] = ["duty", "current", "brake", "handbrake", "rpm", "servo", "alive"]
    for major in range(8):
        for minor in range(100):
            firmware = Firmware(major, minor)
            harmful = {10, 12, 28} if firmware.version <= (3, 0) else {11, 13, 29}
            for kind in kinds:
                try:
                    number = encode_command(firmware, kind, 0.5).frame[2]
                except DeviceFaultError:
                    continue
                assert number not in harmful | {1, 2, 3}


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 40.0, -1e9])
def test_a_value_that_is_no_number_or_does_not_fit(value: float) -> None:
    with pytest.raises(ValueError, match="servo"):
        encode_command(NEW, "servo", value)


@pytest.mark.parametrize(
    ("request_", "frame"),
    [
        (ASK_VERSION, "02 01 00 00 00 03"),
        (ASK_VALUES, "02 01 04 40 84 03"),
        (ASK_SETUP, "02 01 2F D5 8D 03"),
        (ReadRequest(ReadId.VALUES_SELECTIVE, ODOMETRY_MASK), "02 05 32 00 00 E1 80 FA 66 03"),
        (ReadRequest(ReadId.IMU, 0x01F8), "02 03 41 01 F8 77 BB 03"),
        (ReadRequest(ReadId.IMU, 0xFFFF), "02 03 41 FF FF 37 92 03"),
    ],
)
def test_the_questions_of_b4(request_: ReadRequest, frame: str) -> None:
    assert request_.frame == bytes.fromhex(frame)


def test_a_question_is_of_an_id_that_only_asks() -> None:
    for number in set(range(256)) - {0, 4, 47, 50, 51, 65}:
        with pytest.raises(ValueError, match=str(number)):
            ReadRequest(number, 1)  # type: ignore[arg-type]  # the point of the test


@pytest.mark.parametrize(
    ("kind", "mask"),
    [
        (ReadId.VALUES, 1),
        (ReadId.IMU, None),
        (ReadId.IMU, 0),
        (ReadId.IMU, 0x10000),
        (ReadId.VALUES_SELECTIVE, -1),
    ],
)
def test_masks_that_cannot_be(kind: ReadId, mask: int | None) -> None:
    with pytest.raises(ValueError, match=kind.name):
        ReadRequest(kind, mask)


def test_a_question_that_the_firmware_does_not_know() -> None:
    with pytest.raises(DeviceFaultError, match=r"firmware 3.40 does not answer VALUES_SELECTIVE"):
        ReadRequest(ReadId.VALUES_SELECTIVE, 1).check(Firmware(3, 40))
    ReadRequest(ReadId.VALUES_SELECTIVE, 1).check(Firmware(3, 48))
    with pytest.raises(DeviceFaultError, match=r"from 3\.52"):
        ReadRequest(ReadId.IMU, 1).check(Firmware(3, 51))
    ReadRequest(ReadId.IMU, 1).check(Firmware(3, 52))
    ASK_VALUES.check(OLD)


def test_faults_have_names() -> None:
    names = {0: "none", 2: "under-voltage", 6: "over-temperature of the motor", 33: "absolute"}
    assert all(fault_name(code).startswith(name) for code, name in names.items())
    assert fault_name(18) == "unbalanced currents"
    assert fault_name(27) == "phase filter"
    assert fault_name(34) == "fault 34"
    assert fault_name(-1) == "fault -1"
