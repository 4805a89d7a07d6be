from __future__ import annotations

from dataclasses import replace

import pytest

from capture.recording.facts import Losses, RecordingFacts, RecordingWatch, StreamFacts
from capture.recording.verdict import judged
from capture.topics import DIAGNOSTICS_TOPIC

GOOD = StreamFacts("lidar", "/lidar/points", 10.0, 300, 10.0, 0.11, 3.0)
S = 10**9


def recording(*streams: StreamFacts) -> RecordingFacts:
    return RecordingFacts(streams, 30.0)


def test_a_complete_recording_is_good() -> None:
    verdict = judged(recording(GOOD))
    assert (verdict.verdict, verdict.text) == ("good", "every stream complete")


@pytest.mark.parametrize(
    ("stream", "why"),
    [
        (replace(GOOD, messages=0), "lidar: nothing was recorded"),
        (replace(GOOD, rate_hz=8.9), "lidar: 8.9 Hz of 10 Hz asked"),
        (replace(GOOD, longest_gap_s=2.0), "lidar: silent for 2.00 s at 3.0 s"),
        (replace(GOOD, losses=Losses(refused=3)), "lidar: 3 readings lost"),
        (replace(GOOD, losses=Losses(bad_frames=4)), "lidar: 4 bad frames"),
    ],
)
def test_what_makes_a_recording_bad(stream: StreamFacts, why: str) -> None:
    verdict = judged(recording(stream))
    assert verdict.verdict == "bad"
    assert any(why in reason for reason in verdict.reasons)


@pytest.mark.parametrize(
    ("stream", "what"),
    [
        (replace(GOOD, longest_gap_s=0.6), "silent for 0.60 s"),
        (replace(GOOD, losses=Losses(bad_frames=2)), "2 bad frames"),
        (
            replace(GOOD, losses=Losses(disconnects=1, last_error="cable")),
            "gone once, at last because cable",
        ),
        (replace(GOOD, losses=Losses(disconnects=3)), "gone 3 times"),
        (replace(GOOD, losses=Losses(lost_samples=5)), "5 samples lost by the device"),
        (replace(GOOD, losses=Losses(timeouts=5)), "5 questions without an answer"),
    ],
)
def test_what_is_only_remarked(stream: StreamFacts, what: str) -> None:
    verdict = judged(recording(stream))
    assert verdict.verdict == "good"
    assert any(what in remark for remark in verdict.remarks)


def test_an_error_is_told_with_a_stream_that_never_came() -> None:
    stream = replace(GOOD, messages=0, losses=Losses(last_error="no answer on /dev/ttyUSB0"))
    assert "no answer on /dev/ttyUSB0" in judged(recording(stream)).text


def test_what_happened_to_the_whole_recording_is_told() -> None:
    facts = replace(
        recording(GOOD),
        recovered=True,
        utc_step_s=3600.0,
        ended_because="the disk is full: 400 MB left",
        remarks=("car.mcap: 1 damaged chunks",),
    )
    text = judged(facts).text
    for part in ("recovered", "jumped by +3600.0 s", "disk is full", "damaged chunks"):
        assert part in text


def test_a_recording_of_nothing_or_of_a_moment_is_bad() -> None:
    assert judged(recording()).verdict == "bad"
    assert judged(replace(recording(GOOD), duration_s=0.5)).verdict == "bad"


def watch(*times_s: float, start_s: float = 0.0, end_s: float = 10.0) -> StreamFacts:
    watched = RecordingWatch(round(start_s * S))
    for time_s in times_s:
        watched.note("/t", round(time_s * S))
    watched.note(DIAGNOSTICS_TOPIC, round(end_s * S))
    return watched.facts("device", "/t", 10.0, Losses())


def test_gaps_are_found_within_and_at_the_end() -> None:
    within = watch(0.1, 1.0, 4.0, 5.0, 9.9)
    assert within.longest_gap_s == pytest.approx(4.9)
    assert within.longest_gap_at_s == 5.0
    at_end = watch(0.1, 1.0, 2.0, end_s=10.0)
    assert (at_end.longest_gap_s, at_end.longest_gap_at_s) == (8.0, 2.0)


def test_a_device_may_take_a_second_to_its_first_message() -> None:
    assert watch(0.9, 1.0, 1.1, end_s=1.2).longest_gap_s == pytest.approx(0.1)
    late = watch(3.0, 3.1, 3.2, end_s=3.3)
    assert (late.longest_gap_s, late.longest_gap_at_s) == (3.0, 0.0)


def test_the_rate_is_that_between_the_first_and_the_last_message() -> None:
    assert watch(1.0, 1.5, 2.0, 2.5, end_s=2.6).rate_hz == pytest.approx(2.0)
    assert watch(1.0, end_s=1.1).rate_hz == 0.0


def test_a_stream_without_a_message_is_one_long_gap() -> None:
    facts = watch(end_s=7.0)
    assert (facts.messages, facts.longest_gap_s) == (0, 7.0)
