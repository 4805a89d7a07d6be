from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lidar_streams import assert_same, dense, fed, legacy, parts, ultra
from pyrplidar import (
    PyRPlidarScanCapsule,
    PyRPlidarScanUltraCapsule,
)
from rplidar_vectors import LEGACY_BEAMS, LEGACY_CAPSULES, ULTRA_BEAMS, ULTRA_CAPSULES, beams

from drivers.rplidar import Decoder, DenseDecoder, LegacyDecoder, UltraDecoder
from drivers.rplidar.ultra import optics_q16, scale_decode

MAKE: dict[type[Decoder], Callable[[int], list[bytes]]] = {
    LegacyDecoder: legacy,
    UltraDecoder: ultra,
    DenseDecoder: dense,
}
kinds = pytest.mark.parametrize("kind", list(MAKE))


def test_real_legacy_capsules_to_the_bit() -> None:
    decoder = LegacyDecoder()
    got = decoder.feed(b"".join(LEGACY_CAPSULES))
    values = zip(got.angle_q6, got.distance_q2 >> 2, got.start, strict=True)
    assert [tuple(map(int, one)) for one in values] == beams(LEGACY_BEAMS)
    assert (got.distance_q2 % 4 == 0).all()
    assert got.index.tolist() == list(range(96))
    assert set(got.quality.tolist()) == {47}
    assert decoder.bad_bytes == 0
    assert decoder.newest is not None
    assert decoder.newest.index == 127


def test_real_ultra_capsules_to_the_bit() -> None:
    decoder = UltraDecoder()
    got = decoder.feed(b"".join(ULTRA_CAPSULES))
    values = zip(got.angle_q6, got.distance_q2, got.start, strict=True)
    assert [tuple(map(int, one)) for one in values] == beams(ULTRA_BEAMS)
    assert (got.quality == np.where(got.distance_q2 > 0, 47, 0)).all()


def test_a_dense_capsule() -> None:
    # Layout of reference/protocols.md A.9: 40 distances of 16 bits, little endian, in millimetres.
    first = bytes.fromhex("A0 50 00 2D") + bytes.fromhex("E8 03") * 39 + bytes.fromhex("00 00")
    check = int(np.bitwise_xor.reduce(np.frombuffer(first[2:], np.uint8)))
    capsule = bytes((0xA0 | check & 15, 0x50 | check >> 4)) + first[2:]
    following = dense(1)[0]
    got = DenseDecoder().feed(capsule + following)
    start_q6, step_q16 = 0x2D00, ((1000 - 0x2D00) % 23040 << 10) // 40
    expected = [((start_q6 << 10) + step_q16 * place >> 10) % 23040 for place in range(40)]
    assert got.angle_q6.tolist() == expected
    assert got.distance_q2.tolist() == [4000] * 39 + [0]


@pytest.mark.parametrize(
    ("code", "mm", "shift"),
    # The variable bit scale of the test suite of PyPI pyrplidar 0.1.2 (reference/protocols.md A.8).
    [
        (0x1E0, 0x1E0, 0),
        (0x20B, 0x216, 1),
        (0x219, 0x232, 1),
        (0x504, 0x810, 2),
        (0x507, 0x81C, 2),
        (0x51E, 0x878, 2),
        (1792, 4096, 3),
        (3328, 16384, 4),
    ],
)
def test_the_scale_of_ultra_capsules(code: int, mm: int, shift: int) -> None:
    assert scale_decode(code) == (mm, shift)


def test_the_optics_turn_far_beams_by_eight_degrees_and_near_ones_by_less() -> None:
    assert optics_q16(30_000) / 65536 == pytest.approx(8.0, abs=1e-3)
    assert optics_q16(600) / 65536 == pytest.approx(5.8, abs=0.1)
    assert optics_q16(20) / 65536 == pytest.approx(7.5, abs=1e-3)


@pytest.mark.parametrize(
    ("decoder", "theirs", "capsules"),
    [
        (LegacyDecoder(), PyRPlidarScanCapsule, legacy(60, seed=1)),
        (UltraDecoder(), PyRPlidarScanUltraCapsule, ultra(60, seed=2)),
    ],
)
def test_many_turns_as_pyrplidar_decodes_them(
    decoder: Decoder, theirs: type, capsules: list[bytes]
) -> None:
    read = [theirs(capsule) for capsule in capsules]
    nodes = [
        node
        for one, following in pairwise(read)
        for node in theirs._parse_capsule(one, following)  # type: ignore[attr-defined]  # untyped
    ]
    got = decoder.feed(b"".join(capsules))
    assert [node.dist_mm_q2 for node in nodes] == got.distance_q2.tolist()
    assert [node.angle_z_q14 for node in nodes] == ((got.angle_q6.astype(int) << 8) // 90).tolist()
    assert [bool(node.start_flag & 1) for node in nodes] == got.start.tolist()
    assert got.start.sum() >= 4


@kinds
@given(
    cuts=st.lists(st.integers(0, 5000), max_size=12),
    junk=st.binary(max_size=200),
    at=st.integers(0, 2000),
    lost=st.integers(0, 300),
)
def test_how_a_stream_is_cut_does_not_matter(
    kind: type[Decoder], cuts: list[int], junk: bytes, at: int, lost: int
) -> None:
    data = b"".join(MAKE[kind](20))
    data = data[:at] + junk + data[at + lost :]
    whole, pieces = kind(), kind()
    assert_same(whole.feed(data), fed(pieces, parts(data, cuts)))
    for name in ("bad_frames", "bad_bytes", "lost_samples"):
        assert getattr(whole, name) == getattr(pieces, name)


@kinds
@given(pieces=st.lists(st.binary(max_size=400), max_size=6), at=st.integers(0, 500))
def test_no_bytes_raise_anything(kind: type[Decoder], pieces: list[bytes], at: int) -> None:
    decoder = kind()
    good = b"".join(MAKE[kind](5))
    for piece in [*pieces, good[at:], *pieces, good[:at]]:
        got = decoder.feed(piece)
        assert ((got.angle_q6 >= 0) & (got.angle_q6 < 23040)).all()
        assert (got.distance_q2 >= 0).all()
        assert len(decoder.flush()) == 0


@kinds
def test_fed_byte_by_byte_it_is_the_same(kind: type[Decoder]) -> None:
    data = b"".join(MAKE[kind](30))
    single = fed(kind(), [data[at : at + 1] for at in range(len(data))])
    assert_same(kind().feed(data), single)
    assert len(single) == 29 * kind.packet_samples


@kinds
@pytest.mark.parametrize("lost", [1, 2, 5])
def test_lost_capsules_are_counted_by_the_angle(kind: type[Decoder], lost: int) -> None:
    capsules, size = MAKE[kind](30), kind.packet_samples
    decoder = kind()
    got = decoder.feed(b"".join(capsules[:10] + capsules[10 + lost :]))
    whole = kind().feed(b"".join(capsules))
    assert decoder.lost_samples == lost * size
    assert got.index.tolist() == [*range(10 * size), *range((10 + lost) * size, 29 * size)]
    assert got.epoch.max() == 0
    # The capsule before the gap is finished at the running rate: no stretched angles.
    there = np.isin(whole.index, got.index)
    away = (got.angle_q6 - whole.angle_q6[there] + 11520) % 23040 - 11520
    assert np.abs(away[: 10 * size - 2]).max() <= 1
    np.testing.assert_array_equal(away[10 * size :], 0)


@kinds
def test_a_damaged_capsule_costs_itself_only(kind: type[Decoder]) -> None:
    capsules, size = MAKE[kind](30), kind.packet_samples
    broken = bytearray(capsules[12])
    broken[40] ^= 4
    decoder = kind()
    got = decoder.feed(b"".join([*capsules[:12], bytes(broken), *capsules[13:]]))
    assert (decoder.bad_frames, decoder.bad_bytes) == (1, kind.packet_bytes)
    assert decoder.lost_samples == size
    assert got.index.tolist() == [*range(12 * size), *range(13 * size, 29 * size)]


@kinds
def test_a_damaged_capsule_at_the_start_is_counted_by_its_place(kind: type[Decoder]) -> None:
    capsules, size = MAKE[kind](10), kind.packet_samples
    got = kind().feed(capsules[0] + bytes(kind.packet_bytes) + b"".join(capsules[2:]))
    whole = kind().feed(b"".join(capsules))
    there = np.isin(whole.index, got.index)
    assert got.index.tolist() == [*range(size), *range(2 * size, 9 * size)]
    away = (got.angle_q6 - whole.angle_q6[there] + 11520) % 23040 - 11520
    assert np.abs(away[: size - 2]).max() <= 1


@kinds
@given(at=st.integers(0, 1200), lost=st.integers(1, 83))
def test_lost_bytes_cost_one_capsule(kind: type[Decoder], at: int, lost: int) -> None:
    data = b"".join(MAKE[kind](30))
    decoder = kind()
    got = decoder.feed(data[:at] + data[at + lost :])
    # What is lost touches two capsules at most, one of which may be the first.
    assert len(got) >= 27 * kind.packet_samples
    whole = kind().feed(data)
    tail = 10 * kind.packet_samples
    np.testing.assert_array_equal(got.distance_q2[-tail:], whole.distance_q2[-tail:])
    np.testing.assert_array_equal(got.angle_q6[-tail:], whole.angle_q6[-tail:])


@pytest.mark.parametrize(("kind", "make"), [(LegacyDecoder, legacy), (UltraDecoder, ultra)])
def test_the_s_bit_begins_a_new_epoch_and_gives_up_the_capsule_before_it(
    kind: type[Decoder], make: Callable[..., list[bytes]]
) -> None:
    capsules = make(20, s_at=8)
    size = kind.packet_samples
    decoder = kind()
    got = decoder.feed(b"".join(capsules))
    assert got.index.tolist() == [*range(7 * size), *range(8 * size, 19 * size)]
    assert got.epoch.tolist() == [0] * 7 * size + [1] * 11 * size
    assert decoder.lost_samples == size
    assert decoder.newest is not None
    assert decoder.newest.epoch == 1


def test_the_s_bit_of_the_first_capsule_is_no_restart() -> None:
    got = LegacyDecoder().feed(b"".join(legacy(5, s_at=0)))
    assert got.epoch.max() == 0
    assert len(got) == 4 * 32


def test_a_count_that_the_caller_breaks() -> None:
    capsules = legacy(20)
    decoder = LegacyDecoder()
    first = decoder.feed(b"".join(capsules[:8]))
    decoder.break_count()
    second = decoder.feed(b"".join(capsules[15:]))
    assert (len(first), len(second)) == (7 * 32, 4 * 32)
    assert second.epoch.tolist() == [1] * 4 * 32
    assert second.index[0] == 8 * 32


def test_each_turn_has_one_start_even_where_capsules_are_lost_at_zero() -> None:
    capsules = ultra(60)
    whole = UltraDecoder().feed(b"".join(capsules))
    turn = int(np.flatnonzero(whole.start)[2]) // 96
    got = UltraDecoder().feed(b"".join(capsules[:turn] + capsules[turn + 1 :]))
    assert got.start.sum() == whole.start.sum()


def test_a_turn_that_begins_exactly_with_a_capsule_has_its_start() -> None:
    # Rounded steps end just short of zero; the SDK's own test then finds no start in this turn.
    capsules = ultra(9, advance_q6=23040 // 8 - 125)
    assert UltraDecoder().feed(b"".join(capsules)).start.sum() == 1
    start = 23040 - 1000
    assert start % (23040 // 8 - 125) == 0
