from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lidar_bench import scene
from rplidar_vectors import LEGACY_CAPSULES, ULTRA_CAPSULES

from dialogue import UsageError
from drivers import Chunk, DeviceLostError
from drivers.rplidar import (
    LegacyDecoder,
    LidarPort,
    Revolution,
    RPLidar,
    RPLidarConfig,
    RPLidarModel,
    UltraDecoder,
    a2m8,
    emulated_lidar,
    read_capture,
    replay,
    room,
)
from drivers.rplidar.emulator import BOOST, DENSE, EXPRESS, STANDARD
from drivers.rplidar.encoding import encode_legacy, encode_ultra
from drivers.rplidar.protocol import (
    Command,
    Conf,
    conf_request,
    is_banner,
    pwm_request,
    request,
    scan_request,
)
from drivers.rplidar.scene import Rotor

INFO = bytes.fromhex("A5 5A 14 00 00 00 04 28 1D 01 05")


def port(**rest: object) -> LidarPort:
    return LidarPort(RPLidarModel(**rest))  # type: ignore[arg-type]  # named by each test


def heard(of: LidarPort, seconds: float) -> bytes:
    """All that comes within so long."""
    end_ns, got = of.now_ns() + round(seconds * 1e9), b""
    while (left_ns := end_ns - of.now_ns()) > 0:
        chunk = of.read(left_ns * 1e-9)
        got += chunk.data if chunk else b""
    return got


def test_it_answers_at_the_pace_of_its_line() -> None:
    one = port()
    one.write(request(Command.GET_INFO))
    chunk = one.read(1.0)
    assert chunk is not None
    assert chunk.data.startswith(INFO)
    assert chunk.t_ns == 27 * 10_000_000_000 // 115200


@pytest.mark.parametrize(
    ("firmware", "conf", "value"),
    [
        ((1, 29), conf_request(Conf.MODE_COUNT), "A5 5A 06 00 00 00 20 70 00 00 00 05 00"),
        ((1, 27), conf_request(Conf.MODE_COUNT), "A5 5A 06 00 00 00 20 70 00 00 00 03 00"),
        (
            (1, 27),
            conf_request(Conf.US_PER_SAMPLE, 2),
            "A5 5A 08 00 00 00 20 71 00 00 00 00 7F 00 00",
        ),
        (
            (1, 29),
            conf_request(Conf.MODE_NAME, 2),
            "A5 5A 0A 00 00 00 20 7F 00 00 00 42 6F 6F 73 74 00",
        ),
        ((1, 29), conf_request(Conf.TYPICAL_MODE), "A5 5A 06 00 00 00 20 7C 00 00 00 04 00"),
        ((1, 29), conf_request(Conf.MODE_NAME, 9), ""),
        ((1, 23), conf_request(Conf.MODE_COUNT), ""),  # older firmware does not answer
        ((1, 29), request(Command.GET_SAMPLERATE), "A5 5A 04 00 00 00 15 FC 01 FE 00"),
        ((1, 16), request(Command.GET_SAMPLERATE), ""),
    ],
)
def test_answers_are_those_of_the_reference(
    firmware: tuple[int, int], conf: bytes, value: str
) -> None:
    one = port(spec=a2m8(firmware))
    one.write(conf)
    assert heard(one, 0.5) == bytes.fromhex(value)


def test_requests_may_be_cut_and_noise_is_passed_over() -> None:
    one = port()
    ask = b"\x00\xff" + conf_request(Conf.MODE_COUNT)
    for at in range(len(ask)):
        one.write(ask[at : at + 1])
    assert heard(one, 0.1).endswith(b"\x05\x00")
    damaged = bytearray(conf_request(Conf.MODE_COUNT))
    damaged[-1] ^= 1
    one.write(bytes(damaged))
    assert heard(one, 0.1) == b""
    one.write(request(Command.GET_INFO)[:1])
    one.pause(6.0)  # a request that is not whole within five seconds is dropped
    one.write(b"\x50")
    assert heard(one, 0.1) == b""


@given(st.lists(st.binary(max_size=40), max_size=10))
def test_no_bytes_upset_it(pieces: list[bytes]) -> None:
    one = port()
    for piece in pieces:
        one.write(piece)
        heard(one, 0.01)
    one.pause(6.0)
    one.write(request(Command.STOP))
    heard(one, 1.5)
    one.write(request(Command.GET_INFO))
    assert heard(one, 0.1).startswith(INFO)


def test_a_reset_prints_a_banner_after_its_time_and_hears_nothing_before() -> None:
    one = port()
    one.write(request(Command.RESET))
    one.write(request(Command.GET_INFO))
    assert heard(one, 0.67) == b""
    banner = heard(one, 0.1)
    assert is_banner(banner)
    one.write(request(Command.GET_INFO))
    assert heard(one, 0.1).startswith(INFO)


def test_data_comes_when_the_head_turns_and_a_question_ends_the_scan() -> None:
    one = port()
    one.write(request(Command.SCAN))
    assert heard(one, 3.0) == bytes.fromhex("A5 5A 05 00 00 40 81")
    one.write(pwm_request(600))
    assert heard(one, 1.9) == b""
    assert len(heard(one, 1.0)) == pytest.approx(5 * 1968 * 0.9, rel=0.02)
    one.write(pwm_request(500))  # the accessory board's own: it goes on
    assert len(heard(one, 0.5)) > 4000
    one.write(request(Command.GET_HEALTH))
    assert heard(one, 0.5).endswith(bytes.fromhex("A5 5A 03 00 00 00 06 00 00 00"))
    assert one.model.state == "idle"


def test_a_forced_scan_does_not_wait_for_the_head() -> None:
    one = port()
    one.write(request(Command.FORCE_SCAN))
    assert len(heard(one, 0.5)) == pytest.approx(5 * 1968 * 0.5, rel=0.02)


@pytest.mark.parametrize("number", [0, 1])
def test_express_modes_0_and_1_are_both_legacy(number: int) -> None:
    one = port()
    one.write(scan_request(replace(EXPRESS, number=number)))
    assert heard(one, 0.1) == bytes.fromhex("A5 5A 54 00 00 40 82")


def test_in_protection_stop_it_refuses_to_scan() -> None:
    one = port()
    one.model.faults.protection_stop = True
    one.write(pwm_request(600) + request(Command.SCAN))
    assert heard(one, 4.0) == b""
    with pytest.raises(RuntimeError, match="no scan"):
        one.model.true_ns(np.arange(3))


def test_at_another_speed_there_is_only_garbage() -> None:
    one = port()
    one.set_baud(256000)
    one.write(request(Command.GET_INFO))
    assert heard(one, 0.5) == b""
    one.model.left_scanning(STANDARD, one.now_ns())
    garbage = heard(one, 0.5)
    one.set_baud(115200)
    clear = heard(one, 0.5)
    assert len(garbage) > 4000
    flags = np.frombuffer(clear[: len(clear) // 5 * 5], np.uint8).reshape(-1, 5)
    assert len({tuple(column & 1) for column in flags.T}) == 5
    assert garbage[:100] != clear[:100]


def test_a_line_that_cannot_carry_a_mode_is_refused() -> None:
    with pytest.raises(ValueError, match="DenseBoost needs 165354 baud, the line has 115200"):
        replace(a2m8(), modes=(DENSE,))


def test_the_head_follows_in_two_seconds_and_never_jumps() -> None:
    rotor = Rotor()
    rotor.drive(10.0, 0)
    rotor.drive(10.0, 500_000_000)  # nothing new
    rotor.drive(5.0, 3_000_000_000)
    t_ns = np.arange(0, 6_000_000_000, 1_000_000)
    turns, speed = rotor.turns(t_ns), rotor.speed_hz(t_ns)
    np.testing.assert_allclose(np.gradient(turns, 1e-3)[1:-1], speed[1:-1], atol=0.02)
    assert speed[1000] == pytest.approx(10.0 * (1.0 - 0.05**0.5), rel=1e-6)
    assert speed[2000] == pytest.approx(9.5, rel=1e-6)
    assert speed[-1] == pytest.approx(5.0, rel=0.02)
    off = (float(rotor.speed_hz(np.array([3_000_000_000]))[0]) - 5.0) / (0.05 * 5.0)
    expected_ns = 3e9 + 2e9 * np.log(off) / np.log(20.0)
    assert rotor.steady_ns(0) == pytest.approx(expected_ns, rel=1e-9)


@given(st.integers(0, 2**31))
def test_capsules_survive_encoding_and_decoding(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mm, back = rng.integers(0, 16_384, 32), rng.integers(0, 64, 32)
    first = encode_legacy(1000, False, mm << 2, back)
    got = LegacyDecoder().feed(first + encode_legacy(1640, False, mm << 2, back))
    assert (got.distance_q2 >> 2).tolist() == mm.tolist()
    expected = ((1000 << 10) + 20 * 1024 * np.arange(32) - (back << 13) >> 10) % 23040
    assert got.angle_q6.tolist() == expected.tolist()


@given(st.integers(0, 2**31), st.integers(200, 12_000), st.integers(0, 30))
def test_an_ultra_capsule_keeps_what_its_scale_can_hold(seed: int, near: int, rough: int) -> None:
    rng = np.random.default_rng(seed)
    mm = near + np.cumsum(rng.integers(-rough, rough + 1, 97))
    mm = np.maximum(mm, 100)
    # A beam is told from the first of its cabin and of the next: those have their echo here.
    mm[(rng.random(97) < 0.1) & (np.arange(97) % 3 > 0)] = 0
    following = encode_ultra(2000, False, np.full(97, mm[96]) << 2)
    got = UltraDecoder().feed(encode_ultra(1000, False, mm << 2) + following).distance_q2 >> 2
    seen = got > 0
    np.testing.assert_array_equal(seen, mm[:96] > 0)
    step = np.select([mm[:96] >= 4096, mm[:96] >= 2048, mm[:96] >= 512], [8, 4, 2], 1)
    assert (np.abs(got - mm[:96])[seen] < 2 * step[seen]).all()


def test_encoders_make_the_real_capsules_again() -> None:
    """What was decoded from a real capsule is encoded to the same bytes."""
    decoder = LegacyDecoder()
    beams = decoder.feed(b"".join(LEGACY_CAPSULES))
    words = np.frombuffer(LEGACY_CAPSULES[0][4:], np.uint8).reshape(16, 5).astype(int)
    low = np.stack([words[:, 0] & 3, words[:, 2] & 3], axis=1).ravel() << 4
    back = np.stack([words[:, 4] & 15, words[:, 4] >> 4], axis=1).ravel() | low
    start = int.from_bytes(LEGACY_CAPSULES[0][2:4], "little")
    distance = beams.distance_q2[:32].astype(np.int64)
    assert encode_legacy(start, False, distance, back) == LEGACY_CAPSULES[0]
    # Ultra: the scale's steps are kept, so decoding what was encoded gives the same distances.
    ultra = UltraDecoder().feed(b"".join(ULTRA_CAPSULES)).distance_q2.astype(np.int64)
    after = int.from_bytes(ULTRA_CAPSULES[1][4:6], "little") & 0xFFF
    again = encode_ultra(1000, False, np.append(ultra, after << 2))
    twice = UltraDecoder().feed(again + ULTRA_CAPSULES[1])
    assert twice.distance_q2.tolist() == ultra.tolist()


def test_a_source_is_asked_at_each_beams_own_time_and_place() -> None:
    asked: list[np.ndarray[tuple[int], np.dtype[np.int64]]] = []

    def source(
        t_ns: np.ndarray[tuple[int], np.dtype[np.int64]],
        bearing: np.ndarray[tuple[int], np.dtype[np.float64]],
    ) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        asked.append(t_ns)
        return np.where(bearing > 0.0, 2.0, np.nan)  # a wall on the left side only

    model = RPLidarModel(source=source)
    lidar = RPLidar(RPLidarConfig("/dev/lidar"), lambda _path, baud: LidarPort(model, baud=baud))
    lidar.connect()
    turns: list[Revolution] = []
    while len(turns) < 3:
        reading = lidar.read(0.1)
        turns += reading.samples if reading else []
    # An ultra capsule tells nothing of a beam whose neighbours have no echo: two at the edges.
    left = (turns[2].bearing_rad > 0.05) & (turns[2].bearing_rad < np.pi - 0.05)
    right = (turns[2].bearing_rad < -0.05) & (turns[2].bearing_rad > -np.pi + 0.05)
    assert np.isnan(turns[2].range_m[right]).all()
    np.testing.assert_allclose(turns[2].range_m[left], 2.0, atol=0.005)
    assert (np.diff(asked[0]) == 127_000).all()


def test_a_room_is_a_rectangle() -> None:
    bearing = np.array([0.0, np.pi / 2, np.pi, -np.pi / 2, np.arctan2(2.0, 3.0)])
    ranges = room(6.0, 4.0)(np.zeros(5, np.int64), bearing)
    np.testing.assert_allclose(ranges, [3.0, 2.0, 3.0, 2.0, np.hypot(2.0, 3.0)])


def test_recorded_chunks_come_again_in_their_own_time() -> None:
    chunks = [Chunk(5_000_000_000 + i * 20_000_000, bytes([i] * 10)) for i in range(5)]
    one = port(replay=replay(chunks, loop=True))
    one.write(request(Command.SCAN))
    got: list[Chunk] = []
    while len(got) < 12 and (chunk := one.read(1.0)):
        got.append(chunk)
    assert [chunk.data[0] for chunk in got[1:]] == [0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0]
    # The first waits behind the descriptor.
    assert {b.t_ns - a.t_ns for a, b in pairwise(got[2:])} == {20_000_000}
    once = port(replay=replay(chunks))
    once.write(request(Command.SCAN))
    assert len(heard(once, 2.0)) == 7 + 50
    assert heard(port(replay=replay([])), 0.1) == b""


def test_what_a_driver_recorded_can_be_replayed_to_the_same_turns() -> None:
    model = RPLidarModel(source=scene(lambda bearing: 2.0 + np.cos(bearing)))
    lidar = RPLidar(RPLidarConfig("/dev/lidar"), lambda _path, baud: LidarPort(model, baud=baud))
    lidar.connect()
    chunks: list[Chunk] = []
    first: list[Revolution] = []
    while len(first) < 5:
        reading = lidar.read(0.1)
        chunks += reading.raw if reading else []
        first += reading.samples if reading else []
    again = RPLidarModel(replace(a2m8(), modes=(BOOST,)), replay=replay(chunks))
    other = RPLidar(RPLidarConfig("/dev/lidar"), lambda _path, baud: LidarPort(again, baud=baud))
    other.connect()
    second: list[Revolution] = []
    while len(second) < 5:
        reading = other.read(0.1)
        second += reading.samples if reading else []
    for one, two in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.range_m, two.range_m)
        np.testing.assert_array_equal(one.device_ns, two.device_ns)


def test_capture_files_bytes_or_text_with_descriptor_or_without(tmp_path: Path) -> None:
    nodes = bytes.fromhex("3E 9B 64 00 00") * 3
    whole = bytes.fromhex("FF FF A5 5A 03 00 00 00 06 00 00 00 A5 5A 05 00 00 40 81") + nodes
    binary, text, bare = tmp_path / "binary", tmp_path / "text", tmp_path / "bare"
    binary.write_bytes(whole)
    text.write_text("\n".join(f"0x{byte:02x}" for byte in whole))
    bare.write_bytes(nodes)
    assert read_capture(binary) == read_capture(text) == (0x81, nodes)
    assert read_capture(bare) == (None, nodes)
    modes = {"Boost": 132, "Express": 84, "DenseBoost": 84, None: 5}
    for mode, size in modes.items():
        model = emulated_lidar(replay_file=bare, mode=mode)
        assert len(model.spec.modes) == 1
        one = LidarPort(model, baud=model.spec.baud)
        one.write(scan_request(replace(model.spec.modes[0], number=0)))
        assert heard(one, 0.02)[2] == size


def test_the_emulated_lidar_of_the_command(tmp_path: Path) -> None:
    assert [mode.name for mode in emulated_lidar().spec.modes][-1] == "Stability"
    assert [mode.name for mode in emulated_lidar(mode="Express").spec.modes] == ["Express"]
    with pytest.raises(UsageError, match="did you mean 'Boost'"):
        emulated_lidar(mode="Bost")
    with pytest.raises(UsageError, match="no capture"):
        emulated_lidar(replay_file=tmp_path / "nothing")


@pytest.mark.realdata
def test_a_real_capture_is_replayed_through_the_driver(data_dir: Path) -> None:
    file = data_dir / "rplidar/standard_scan/sample_data_pyserial_1.txt"
    model = emulated_lidar(replay_file=file, loop=False)
    lidar = RPLidar(RPLidarConfig("/dev/lidar"), lambda _path, baud: LidarPort(model, baud=baud))
    lidar.connect()
    turns: list[Revolution] = []
    silent = ""
    while not silent:
        try:
            reading = lidar.read(0.1)
            turns += reading.samples if reading else []
        except DeviceLostError as err:
            silent = str(err)
    assert "silent for 1 s" in silent
    assert len(turns) == 32
    # All nodes but the last, for which the decoder would want more than the file has.
    assert lidar.counters.samples == 10_435
    assert all(300 < len(turn) < 330 for turn in turns)
