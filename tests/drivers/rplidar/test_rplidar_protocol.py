from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import ProtocolError
from drivers.rplidar.protocol import (
    ANSWER_BYTES,
    SCAN_ANSWERS,
    Answer,
    Command,
    Conf,
    Descriptor,
    Health,
    Info,
    ScanMode,
    acc_board_request,
    banner_of,
    conf_request,
    decode_acc_board,
    decode_conf,
    decode_health,
    decode_info,
    decode_number,
    decode_samplerate,
    find_descriptor,
    is_banner,
    pwm_request,
    request,
    rpm_request,
    scan_request,
)


def mode(number: int, answer: Answer = Answer.ULTRA) -> ScanMode:
    return ScanMode(number, "any", answer, 127 * 256, 12.0)


# reference/protocols.md A.2; PWM 660 and the legacy express also in the manual and Adafruit #28.
REQUESTS = [
    (request(Command.STOP), "A5 25"),
    (request(Command.RESET), "A5 40"),
    (request(Command.SCAN), "A5 20"),
    (request(Command.FORCE_SCAN), "A5 21"),
    (request(Command.GET_INFO), "A5 50"),
    (request(Command.GET_HEALTH), "A5 52"),
    (request(Command.GET_SAMPLERATE), "A5 59"),
    (acc_board_request(), "A5 FF 04 00 00 00 00 5E"),
    (scan_request(mode(0, Answer.STANDARD)), "A5 20"),
    (scan_request(mode(0)), "A5 82 05 00 00 00 00 00 22"),
    (scan_request(mode(1)), "A5 82 05 01 00 00 00 00 23"),
    (scan_request(mode(2)), "A5 82 05 02 00 00 00 00 20"),
    (scan_request(mode(3)), "A5 82 05 03 00 00 00 00 21"),
    (scan_request(mode(4)), "A5 82 05 04 00 00 00 00 26"),
    (pwm_request(0), "A5 F0 02 00 00 57"),
    (pwm_request(600), "A5 F0 02 58 02 0D"),
    (pwm_request(660), "A5 F0 02 94 02 C1"),
    (pwm_request(1023), "A5 F0 02 FF 03 AB"),
    (conf_request(Conf.MODE_COUNT), "A5 84 04 70 00 00 00 55"),
    (conf_request(Conf.TYPICAL_MODE), "A5 84 04 7C 00 00 00 59"),
    (conf_request(Conf.US_PER_SAMPLE, 0), "A5 84 06 71 00 00 00 00 00 56"),
    (conf_request(Conf.US_PER_SAMPLE, 1), "A5 84 06 71 00 00 00 01 00 57"),
    (conf_request(Conf.US_PER_SAMPLE, 2), "A5 84 06 71 00 00 00 02 00 54"),
    (conf_request(Conf.MAX_DISTANCE, 2), "A5 84 06 74 00 00 00 02 00 51"),
    (conf_request(Conf.ANSWER_TYPE, 2), "A5 84 06 75 00 00 00 02 00 50"),
    (conf_request(Conf.MODE_NAME, 2), "A5 84 06 7F 00 00 00 02 00 5A"),
]
# reference/protocols.md A.3.
DESCRIPTORS = [
    (Answer.INFO, "A5 5A 14 00 00 00 04"),
    (Answer.HEALTH, "A5 5A 03 00 00 00 06"),
    (Answer.SAMPLERATE, "A5 5A 04 00 00 00 15"),
    (Answer.ACC_BOARD_FLAG, "A5 5A 04 00 00 00 FF"),
    (Answer.STANDARD, "A5 5A 05 00 00 40 81"),
    (Answer.LEGACY, "A5 5A 54 00 00 40 82"),
    (Answer.ULTRA, "A5 5A 84 00 00 40 84"),
    (Answer.DENSE, "A5 5A 54 00 00 40 85"),
]


@pytest.mark.parametrize(("made", "expected"), REQUESTS)
def test_a_request_is_these_bytes(made: bytes, expected: str) -> None:
    assert made == bytes.fromhex(expected)


def test_a_speed_command_ends_with_its_checksum() -> None:
    assert rpm_request(600) == bytes.fromhex("A5 A8 02 58 02 55")


@pytest.mark.parametrize("pwm", [-1, 1024])
def test_a_motor_pwm_is_never_clipped(pwm: int) -> None:
    with pytest.raises(ValueError, match="not within"):
        pwm_request(pwm)


@pytest.mark.parametrize(("kind", "text"), DESCRIPTORS)
def test_a_descriptor_is_these_bytes(kind: Answer, text: str) -> None:
    data = bytes.fromhex(text)
    expected = Descriptor(kind, ANSWER_BYTES[kind], many=kind in SCAN_ANSWERS)
    assert find_descriptor(data, (kind,)) == (0, expected)
    assert expected.encode() == data


def test_a_descriptor_is_found_behind_a_scan_that_still_runs() -> None:
    stale = bytes.fromhex("3E 1D 95 9F 07 A5 5A 05 A5 A5 5A 14 00 00 00 06")
    answer = bytes.fromhex("A5 5A 14 00 00 00 04")
    found = find_descriptor(stale + answer + b"rest", (Answer.INFO,))
    assert found == (len(stale), Descriptor(Answer.INFO, 20, many=False))


@pytest.mark.parametrize(
    "text",
    [
        "A5 5A 15 00 00 00 04",  # another length
        "A5 5A 14 00 00 40 04",  # many packets of a single answer
        "A5 5A 05 00 00 00 81",  # one packet of a scan
        "A5 5A 03 00 00 00 20",  # too short to repeat the question
        "A5 5A 14 00 00 00",  # not whole
    ],
)
def test_what_only_looks_like_a_descriptor_is_none(text: str) -> None:
    kinds = (Answer.INFO, Answer.STANDARD, Answer.LIDAR_CONF)
    assert find_descriptor(bytes.fromhex(text), kinds) is None


@given(st.binary(max_size=200))
def test_no_bytes_upset_the_search_for_a_descriptor(data: bytes) -> None:
    found = find_descriptor(data, tuple(Answer))
    assert found is None or data[found[0] : found[0] + 7] == found[1].encode()


def test_info_of_a_real_a1() -> None:
    # Adafruit_CircuitPython_RPLIDAR issue 28; reference/protocols.md A.4.
    data = bytes.fromhex("18 1D 01 07 92 D8 ED 93 C0 EA 98 C9 A5 E6 98 F2 07 06 46 69")
    info = decode_info(data)
    assert info == Info(0x18, (1, 29), 7, "92D8ED93C0EA98C9A5E698F207064669")
    assert (info.series, info.model_name) == (1, "A1M8")
    assert info.encode() == data


def test_names_of_models() -> None:
    assert Info(0x28, (1, 27), 5, "").model_name == "A2M8"
    assert Info(0x2C, (1, 27), 5, "").model_name == "A2M12"
    assert Info(0x61, (1, 1), 1, "").model_name == "model 0x61"


def test_the_code_of_health_is_little_endian() -> None:
    # Manual and SDK; SkoltechRobotics, pyrplidar and Adafruit read it the other way round.
    health = decode_health(bytes.fromhex("02 01 80"))
    assert health == Health(2, 0x8001)
    assert health.protection_stop
    assert str(health) == "protection stop (code 0x8001)"
    assert health.encode() == bytes.fromhex("02 01 80")


def test_a_warning_is_no_protection_stop() -> None:
    assert not Health(1, 7).protection_stop
    assert str(Health(1, 7)) == "warning (code 0x0007)"
    assert str(Health(0, 0)) == "good"


def test_samplerates_of_firmware_1_27() -> None:
    assert decode_samplerate(bytes.fromhex("F4 01 FA 00")) == (500, 250)


def test_configuration_values() -> None:
    # reference/protocols.md A.4: count 5, 127 us of mode 2, its name.
    count = decode_conf(bytes.fromhex("70 00 00 00 05 00"), Conf.MODE_COUNT)
    us_q8 = decode_conf(bytes.fromhex("71 00 00 00 00 7F 00 00"), Conf.US_PER_SAMPLE)
    name = decode_conf(bytes.fromhex("7F 00 00 00 42 6F 6F 73 74 00"), Conf.MODE_NAME)
    assert decode_number(count) == 5
    assert decode_number(us_q8) == 32512
    assert ScanMode(2, "Boost", Answer.ULTRA, decode_number(us_q8), 12.0).us_per_sample == 127.0
    assert name == b"Boost\0"


@pytest.mark.parametrize("data", [b"", b"\x70", bytes.fromhex("71 00 00 00 05 00")])
def test_a_configuration_answer_to_another_question_is_refused(data: bytes) -> None:
    with pytest.raises(ProtocolError, match="repeats another question"):
        decode_conf(data, Conf.MODE_COUNT)


def test_the_flag_of_the_accessory_board_is_its_lowest_bit() -> None:
    assert decode_acc_board(bytes.fromhex("01 00 00 00"))
    assert not decode_acc_board(bytes.fromhex("02 00 00 00"))


def test_the_banner_after_a_reset_is_known() -> None:
    banner = banner_of(Info(0x28, (1, 27), 5, ""))
    # reference/protocols.md A.10.1.
    expected = b"RP LIDAR System.\r\nFirmware Ver 1.27 - rc9, HW Ver 5\r\nModel: 28\r\n"
    assert banner == expected
    assert is_banner(b"\x00\x3e" + banner[:20])
    assert not is_banner(b"A5 5A")
