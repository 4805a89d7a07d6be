"""Is a recording good? One function, for the recorder, for `trackside check`, for `recover`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from capture.recording.facts import RecordingFacts, StreamFacts

SILENT_S = 2.0
"""A stream that is silent for so long is an alarm while recording, and a bad recording later."""
MIN_RATE = 0.9
"""Of the rate asked for."""
MAX_BAD_FRAMES = 0.01
NOTED_GAP_PERIODS, NOTED_GAP_S = 5, 0.1
NOTED_STEP_S = 0.05
MIN_DURATION_S = 1.0


@dataclass(frozen=True)
class Verdict:
    """`good` or `bad`; `reasons` make it bad, `remarks` are worth knowing all the same."""

    verdict: Literal["good", "bad"]
    reasons: tuple[str, ...]
    remarks: tuple[str, ...]

    @property
    def text(self) -> str:
        """Reasons and remarks in one line, as `session.yaml` keeps them."""
        return "; ".join([*self.reasons, *self.remarks]) or "every stream complete"


def judged(facts: RecordingFacts) -> Verdict:
    """The verdict on a recording."""
    reasons: list[str] = []
    remarks: list[str] = []
    for stream in facts.streams:
        bad, noted = _stream_faults(stream)
        reasons += bad
        remarks += noted
    if not facts.streams:
        reasons.append("no stream was recorded")
    elif facts.duration_s < MIN_DURATION_S:
        reasons.append(f"only {facts.duration_s:.1f} s long")
    if facts.ended_because:
        remarks.append(f"ended because {facts.ended_because}")
    if facts.recovered:
        remarks.append("recovered after a power cut or kill: up to the last second is missing")
    if abs(facts.utc_step_s) >= NOTED_STEP_S:
        remarks.append(
            f"the system clock jumped by {facts.utc_step_s:+.1f} s; the log keeps the time it "
            "began with"
        )
    remarks += facts.remarks
    return Verdict("bad" if reasons else "good", tuple(reasons), tuple(remarks))


def _stream_faults(stream: StreamFacts) -> tuple[list[str], list[str]]:
    """What makes the recording bad, and what is only remarked."""
    name, losses = stream.device, stream.losses
    if not stream.messages:
        last = f" ({losses.last_error})" if losses.last_error else ""
        return [f"{name}: nothing was recorded{last}"], []
    bad: list[str] = []
    noted: list[str] = []
    gap = f"{name}: silent for {stream.longest_gap_s:.2f} s at {stream.longest_gap_at_s:.1f} s"
    if stream.longest_gap_s >= SILENT_S:
        bad.append(gap)
    elif stream.asked_hz and stream.longest_gap_s > max(
        NOTED_GAP_PERIODS / stream.asked_hz, NOTED_GAP_S
    ):
        noted.append(gap)
    if stream.asked_hz and stream.rate_hz < MIN_RATE * stream.asked_hz:
        bad.append(f"{name}: {stream.rate_hz:.1f} Hz of {stream.asked_hz:g} Hz asked")
    if losses.refused:
        bad.append(f"{name}: {losses.refused} readings lost, the disk did not keep up")
    frames = max(stream.messages, 1)
    share = losses.bad_frames / (losses.bad_frames + frames)
    if losses.bad_frames:
        text = f"{name}: {losses.bad_frames} bad frames"
        (bad if share > MAX_BAD_FRAMES else noted).append(text)
    if losses.disconnects:
        times = "once" if losses.disconnects == 1 else f"{losses.disconnects} times"
        noted.append(f"{name}: gone {times}, at last because {losses.last_error}")
    counts = (
        (losses.lost_samples, "samples lost by the device"),
        (losses.timeouts, "questions without an answer"),
    )
    noted += [f"{name}: {count} {what}" for count, what in counts if count]
    return bad, noted
