from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lidar_streams import nodes, parts, ultra

from drivers.rplidar import (
    Beams,
    Revolution,
    RevolutionSplitter,
    StandardDecoder,
    UltraDecoder,
    bearing_rad,
    range_m,
)

US_Q8 = 508 * 256


def turns_of(beams: Beams) -> tuple[tuple[Revolution, ...], RevolutionSplitter]:
    splitter = RevolutionSplitter(US_Q8)
    return splitter.feed(beams), splitter


def test_turns_go_from_start_to_start_and_the_first_piece_is_dropped() -> None:
    beams = StandardDecoder().feed(nodes(2000))
    turns, splitter = turns_of(beams)
    starts = np.flatnonzero(beams.start)
    assert [len(turn) for turn in turns] == np.diff(starts).tolist()
    first = slice(starts[0], starts[1])
    np.testing.assert_array_equal(turns[0].device_ns, beams.index[first] * 508_000)
    np.testing.assert_array_equal(turns[0].bearing_rad, bearing_rad(beams.angle_q6[first]))
    np.testing.assert_array_equal(turns[0].range_m, range_m(beams.distance_q2[first]))
    np.testing.assert_array_equal(turns[0].quality, beams.quality[first])
    assert splitter.torn == 0


def test_the_period_is_that_of_all_beams() -> None:
    turns, _ = turns_of(StandardDecoder().feed(nodes(2000)))
    assert turns[0].period_s == pytest.approx(len(turns[0]) * 508e-6, rel=1e-9)
    single = Revolution(np.zeros(1, np.int64), np.zeros(1), np.zeros(1), np.zeros(1, np.uint8))
    assert np.isnan(single.period_s)


@given(st.lists(st.integers(0, 20_000), max_size=20))
def test_how_the_beams_come_does_not_matter(cuts: list[int]) -> None:
    data = b"".join(ultra(40))
    whole, _ = turns_of(UltraDecoder().feed(data))
    decoder, splitter = UltraDecoder(), RevolutionSplitter(US_Q8)
    pieces = [turn for part in parts(data, cuts) for turn in splitter.feed(decoder.feed(part))]
    assert len(pieces) == len(whole) > 2
    for one, other in zip(pieces, whole, strict=True):
        np.testing.assert_array_equal(one.device_ns, other.device_ns)
        np.testing.assert_array_equal(one.bearing_rad, other.bearing_rad)


@pytest.mark.parametrize("step_q6", [10, 600])
def test_a_turn_holds_as_many_beams_as_it_has(step_q6: int) -> None:
    turns, _ = turns_of(StandardDecoder().feed(nodes(12_000, step_q6=step_q6)))
    assert {len(turn) for turn in turns} <= {23040 // step_q6, 23040 // step_q6 + 1}
    assert len(turns) >= 4


def test_a_turn_never_spans_two_epochs() -> None:
    decoder, splitter = UltraDecoder(), RevolutionSplitter(US_Q8, first_epoch=5)
    turns = splitter.feed(decoder.feed(b"".join(ultra(60, s_at=30))))
    whole = RevolutionSplitter(US_Q8).feed(UltraDecoder().feed(b"".join(ultra(60))))
    assert len(turns) == len(whole) - 1
    assert [turn.epoch for turn in turns] == sorted(turn.epoch for turn in turns)
    assert {turn.epoch for turn in turns} == {5, 6}


def test_two_turns_whose_start_was_lost_are_dropped_and_counted() -> None:
    beams = StandardDecoder().feed(nodes(3000))
    starts = np.flatnonzero(beams.start)
    beams.start[starts[2]] = False
    turns, splitter = turns_of(beams)
    assert len(turns) == len(starts) - 3
    assert splitter.torn == 1


def test_a_start_flag_out_of_noise_makes_no_turn() -> None:
    beams = StandardDecoder().feed(nodes(3000))
    starts = np.flatnonzero(beams.start)
    beams.start[starts[2] + 30] = True
    turns, splitter = turns_of(beams)
    assert splitter.torn == 1
    assert len(turns) == len(starts) - 1
    assert sorted(map(len, turns))[0] > 400


def test_without_starts_memory_does_not_grow() -> None:
    beams = StandardDecoder().feed(nodes(12_000))
    beams.start[:] = False
    beams.start[0] = True
    turns, splitter = turns_of(beams)
    assert turns == ()
    assert splitter.torn == 1
