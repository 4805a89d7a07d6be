"""Which parameters scored best, how sure that is, and the preset with its evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dialogue import Cell, Table
from scoring.comparison import Bootstrap, Interval, interval, mean
from slam.preset_file import PresetFile, text_of
from trackside.tuning.jobs import Job, Outcome
from trackside.tuning.plan import Trial
from trackside.workers import Failure

HOW = Bootstrap()
FEWEST_SESSIONS = 3
"""With fewer, single runs are resampled instead of sessions."""
_COLUMNS = {
    "false_negatives": "false_negatives",
    "false_positives": "false_positives",
    "pose": "pose [m]",
}


@dataclass(frozen=True)
class Run:
    """A trial on one session with one seed."""

    trial: Trial
    session: str
    job: Job


@dataclass(frozen=True)
class Standing:
    """How a trial did: means over its runs, those of one session first; None where undefined."""

    trial: Trial
    runs: int
    failed: int
    total: float | None
    interval: Interval | None
    errors: Mapping[str, float | None]

    @property
    def order(self) -> tuple[bool, bool, float, int]:
        """Complete ones first, then the lowest Total, then the fewest changes."""
        undefined = self.total is None
        total = self.total if self.total is not None else 0.0
        return bool(self.failed), undefined, total, self.trial.number


def standings(runs: Sequence[Run], results: Mapping[str, Outcome | Failure]) -> list[Standing]:
    """Every trial with its runs (job key -> result), best first."""
    by_trial: dict[tuple[str, int], list[Run]] = {}
    for run in runs:
        by_trial.setdefault((run.trial.request.algorithm, run.trial.number), []).append(run)
    return sorted((_standing(own, results) for own in by_trial.values()), key=lambda s: s.order)


def table(ranked: Sequence[Standing], sessions: int, impossible: int) -> Table:
    """One row per trial, best first; a cell of a parameter is empty where the preset's holds."""
    keys = sorted({key for standing in ranked for key in standing.trial.parameters})
    columns = ("algorithm", "set", *keys, "runs", "failed", "Total", "low", "high")
    unit = "sessions" if sessions >= FEWEST_SESSIONS else "runs, as there are few sessions"
    notes = [
        f"set 0 is the preset as it is; low, high: {100 * HOW.level:g} % bootstrap interval over "
        f"the {unit}",
        f"the best of {len(ranked)} on the same data flatters itself: judge it on other sessions",
    ]
    if impossible:
        notes.append(f"{impossible} sets were left out, their values contradict each other")
    return Table(
        (*columns, *_COLUMNS.values()),
        tuple(_row(standing, keys) for standing in ranked),
        note="\n".join(notes),
    )


def best_preset(ranked: Sequence[Standing], evidence: Mapping[str, object]) -> PresetFile:
    """The first of the ranking, with the numbers that put it there beside the evidence given."""
    best = ranked[0]
    request = best.trial.request
    settings = {key: _value(text) for key, text in (w.split("=", 1) for w in request.settings)}
    own = [s for s in ranked if s.trial.request.algorithm == request.algorithm]
    preset = next((s for s in own if s.trial.number == 0), None)
    found = {
        "total": best.total,
        "interval": _plain(best.interval),
        "level": HOW.level,
        "runs": best.runs,
        **best.errors,
        "preset_total": preset.total if preset else None,
        "preset_interval": _plain(preset.interval) if preset else None,
        "sets_tried": len(ranked),
    }
    return PresetFile(
        algorithm=request.algorithm,
        preset=request.preset,
        odometry=request.odometry,
        association=request.association,
        settings=settings,
        evidence={**found, **evidence},
    )


def _standing(runs: Sequence[Run], results: Mapping[str, Outcome | Failure]) -> Standing:
    done = [(run, r) for run in runs if isinstance(r := results.get(run.job.key), Outcome)]
    totals = [(run.session, outcome.total) for run, outcome in done]
    failed = len(runs) - len(done)
    return Standing(
        runs[0].trial,
        len(done),
        failed,
        _mean_of_sessions(totals),
        _interval(totals),
        {
            name: _mean_of_sessions([(run.session, o.errors.get(name)) for run, o in done])
            for name in _COLUMNS
        },
    )


def _by_session(values: Sequence[tuple[str, float | None]]) -> list[list[float]] | None:
    """The values of each session; None where one is undefined, which no mean may hide."""
    found: dict[str, list[float]] = {}
    for session, value in values:
        if value is None:
            return None
        found.setdefault(session, []).append(value)
    return list(found.values()) or None


def _mean_of_sessions(values: Sequence[tuple[str, float | None]]) -> float | None:
    sessions = _by_session(values)
    return float(np.mean([np.mean(own) for own in sessions])) if sessions else None


def _interval(values: Sequence[tuple[str, float | None]]) -> Interval | None:
    sessions = _by_session(values)
    if sessions is None:
        return None
    if len(sessions) >= FEWEST_SESSIONS:
        samples = [float(np.mean(own)) for own in sessions]
    else:
        samples = [value for own in sessions for value in own]
    return interval(mean, np.array([samples]), HOW)


def _row(standing: Standing, keys: Sequence[str]) -> tuple[Cell, ...]:
    trial, bounds = standing.trial, standing.interval
    return (
        trial.request.algorithm,
        trial.number,
        *(trial.parameters.get(key, "") for key in keys),
        standing.runs,
        standing.failed,
        standing.total,
        bounds.low if bounds else None,
        bounds.high if bounds else None,
        *(standing.errors[name] for name in _COLUMNS),
    )


def _plain(bounds: Interval | None) -> list[float] | None:
    return [bounds.low, bounds.high] if bounds else None


def _value(text: str) -> object:
    """The value as YAML shows it best; read again it is the same text."""
    for kind in (int, float):
        try:
            value = kind(text)
        except ValueError:
            continue
        return value if text_of(value) == text else text
    return text
