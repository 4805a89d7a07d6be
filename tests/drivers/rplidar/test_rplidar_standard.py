from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lidar_streams import assert_same, fed, nodes, parts

from drivers.rplidar import Beams, Newest, StandardDecoder, read_capture
from drivers.rplidar.beams import joined

TEXT = Path("rplidar/standard_scan/sample_data_pyserial_1.txt")


def decoded(data: bytes) -> tuple[Beams, StandardDecoder]:
    decoder = StandardDecoder()
    return joined([decoder.feed(data), decoder.flush()]), decoder


@pytest.mark.parametrize(
    ("text", "start", "quality", "degrees", "mm"),
    [
        # Seen on the wire, Adafruit_CircuitPython_RPLIDAR issue 28 (reference/protocols.md A.6).
        ("02 8F 63 00 00", False, 0, 199.109375, 0.0),
        ("3E 9B 64 00 00", False, 15, 201.203125, 0.0),
        # Computed from the layout.
        ("3D 01 00 49 13", True, 15, 0.0, 1234.25),
        ("BE 41 2D E8 03", False, 47, 90.5, 250.0),
        ("2A FF B3 80 BB", False, 10, 359.984375, 12000.0),
        ("02 01 5A 00 00", False, 0, 180.0, 0.0),
        ("02 01 00 FF FF", False, 0, 0.0, 16383.75),
    ],
)
def test_a_node(text: str, start: bool, quality: int, degrees: float, mm: float) -> None:
    beams, _ = decoded(bytes.fromhex(text))
    assert beams.start.tolist() == [start]
    assert beams.quality.tolist() == [quality]
    assert (beams.angle_q6 / 64.0).tolist() == [degrees]
    assert (beams.distance_q2 / 4.0).tolist() == [mm]


@pytest.mark.parametrize(
    "text",
    [
        "03 01 00 00 00",  # S and its inverse are both set
        "00 01 00 00 00",  # neither
        "02 00 00 00 00",  # C is not set
        "02 01 B4 00 00",  # 360 degrees
    ],
)
def test_what_is_no_node_is_skipped_and_counted(text: str) -> None:
    good = nodes(40)
    beams, decoder = decoded(good[:50] + bytes.fromhex(text) + good[50:])
    whole, _ = decoded(good)
    np.testing.assert_array_equal(beams.angle_q6, whole.angle_q6)
    assert (decoder.bad_frames, decoder.bad_bytes) == (1, 5)
    assert decoder.lost_samples == 1
    assert beams.index.tolist() == [*range(10), *range(11, 41)]
    assert beams.epoch.max() == 0


@given(st.lists(st.integers(0, 5000), max_size=12), st.integers(0, 3), st.binary(max_size=60))
def test_how_a_stream_is_cut_does_not_matter(cuts: list[int], seed: int, junk: bytes) -> None:
    good = nodes(200, seed=seed)
    data = good[:333] + junk + good[390:700] + good[712:]
    whole, pieces = StandardDecoder(), StandardDecoder()
    assert_same(whole.feed(data), fed(pieces, parts(data, cuts)))
    for name in ("bad_frames", "bad_bytes", "lost_samples"):
        assert getattr(whole, name) == getattr(pieces, name)
    assert_same(whole.flush(), pieces.flush())


@given(st.lists(st.binary(max_size=300), max_size=8))
def test_no_bytes_raise_anything(pieces: list[bytes]) -> None:
    decoder = StandardDecoder()
    beams = joined([*map(decoder.feed, pieces), decoder.flush()])
    assert ((beams.angle_q6 >= 0) & (beams.angle_q6 < 23040)).all()
    assert (np.diff(beams.index) > 0).all()
    assert 5 * len(beams) + decoder.bad_bytes <= sum(map(len, pieces))


@given(st.integers(0, 400), st.integers(1, 40), st.integers(0, 9))
def test_after_lost_bytes_it_stands_on_the_nodes_again_at_once(
    place: int, lost: int, seed: int
) -> None:
    good = nodes(300, seed=seed)
    torn = good[: 5 * place // 2] + good[5 * place // 2 + lost :]
    beams, _ = decoded(torn)
    whole, _ = decoded(good)
    # All nodes but the 20 from the damage on are there, and no other besides at most one.
    after = (5 * place // 2 + lost) // 5 + 20
    kept = (5 * place // 2) // 5
    np.testing.assert_array_equal(beams.angle_q6[:kept], whole.angle_q6[:kept])
    np.testing.assert_array_equal(
        beams.distance_q2[-(300 - after) :], whole.distance_q2[-(300 - after) :]
    )
    assert len(beams) <= 300


def test_lost_bytes_break_the_count() -> None:
    good = nodes(100)
    beams, decoder = decoded(good[:100] + good[103:])
    assert beams.epoch.tolist() == [0] * 20 + [1] * (len(beams) - 20)
    assert decoder.bad_bytes == 2


def test_whole_nodes_that_are_lost_show_by_the_angle_and_break_the_count() -> None:
    good = nodes(300)
    beams, decoder = decoded(good[:500] + good[1000:])
    assert len(beams) == 200
    assert beams.epoch.tolist() == [0] * 100 + [1] * 100
    assert decoder.bad_bytes == 0


@given(st.integers(0, 299), st.integers(0, 39))
def test_a_turned_bit_costs_one_node_at_most(node: int, bit: int) -> None:
    good = bytearray(nodes(300))
    good[5 * node + bit // 8] ^= 1 << bit % 8
    beams, decoder = decoded(bytes(good))
    whole, _ = decoded(nodes(300))
    assert len(beams) >= 299 - (node > 295)  # of the last four none can be sure
    same = np.isin(whole.index, beams.index)
    differs = whole.angle_q6[same] != beams.angle_q6[np.isin(beams.index, whole.index)]
    assert differs.sum() <= 1
    assert decoder.bad_bytes <= 5


def test_the_newest_sample_is_known_with_the_bytes_that_follow_it() -> None:
    decoder, data, newest = StandardDecoder(), nodes(20), []
    for piece in (data[:53], data[53:54], data[54:]):
        decoder.feed(piece)
        newest.append(decoder.newest)
    assert newest == [Newest(9, 0, 3), None, Newest(19, 0, 0)]
    decoder.break_count()
    decoder.feed(nodes(3))
    assert decoder.newest == Newest(22, 1, 0)


@pytest.mark.realdata
def test_the_recording_of_a_real_lidar(data_dir: Path) -> None:
    answer, data = read_capture(data_dir / TEXT)
    assert answer == 0x81
    beams, decoder = decoded(data)
    # data/README.md. The junk stands where the host's STOP was echoed into the stream.
    assert (len(beams), int(beams.start.sum()), decoder.bad_bytes) == (10_436, 33, 1)
    assert set(np.unique(beams.quality)) <= set(range(16))


@pytest.mark.realdata
@pytest.mark.parametrize("size", [1, 2, 3, 4, 6, 7, 999, 4096])
def test_the_recording_cut_at_every_byte_and_otherwise(data_dir: Path, size: int) -> None:
    _, data = read_capture(data_dir / TEXT)
    whole, _ = decoded(data)
    decoder = StandardDecoder()
    pieces = [data[at : at + size] for at in range(0, len(data), size)]
    assert_same(whole, joined([fed(decoder, pieces), decoder.flush()]))


@pytest.mark.realdata
def test_raw_captures_agree_with_a_plain_reading_of_their_nodes(data_dir: Path) -> None:
    for path in sorted((data_dir / TEXT).parent.glob("frame_*.bin")):
        _, data = read_capture(path)
        beams, decoder = decoded(data)
        # The plainest reading there is: a byte on where the bits are wrong.
        plain, at = [], 0
        while at + 5 <= len(data):
            if (data[at] ^ data[at] >> 1) & data[at + 1] & 1:
                plain.append((data[at + 1] | data[at + 2] << 8) >> 1)
                at += 5
            else:
                at += 1
        assert 0 <= len(plain) - len(beams) <= decoder.bad_bytes // 5
        assert decoder.bad_bytes <= 31
        assert set(beams.angle_q6.tolist()) <= set(plain)


@pytest.mark.realdata
@pytest.mark.parametrize("seed", range(5))
def test_the_recording_with_one_byte_in_a_hundred_damaged(data_dir: Path, seed: int) -> None:
    _, data = read_capture(data_dir / TEXT)
    data = data[: 5 * 10_435]  # its whole nodes without the junk byte behind them
    rng = np.random.default_rng(seed)
    damaged = np.frombuffer(data, np.uint8).copy()
    hit = rng.random(len(data)) < 0.01
    damaged[hit] ^= rng.integers(1, 256, int(hit.sum()), np.uint8)
    truth, _ = decoded(data)
    beams, _ = decoded(damaged.tobytes())
    # A node with 20 undamaged ones before it is there, with its values and its number.
    clean = hit.reshape(-1, 5).sum(axis=1) == 0
    settled = np.array([at > 20 and clean[at - 20 : at + 1].all() for at in range(len(clean))])
    assert settled.sum() > 2000
    rows = np.searchsorted(beams.index, np.flatnonzero(settled))
    for name in ("index", "angle_q6", "distance_q2", "quality", "start"):
        ours, theirs = getattr(beams, name), getattr(truth, name)
        np.testing.assert_array_equal(ours[rows], theirs[settled], name)
