"""Which pose of the estimate belongs to which pose of the truth: pairing by time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from geometry import SpacePath, Stamps, Trajectory
from scoring.errors import TooFewPosesError
from scoring.options import ScoreOptions

Path = TypeVar("Path", Trajectory, SpacePath)
Rows = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PairedPaths(Generic[Path]):
    """Truth and estimate pose by pose.

    truth, estimate : n poses each; rows : (n,) which poses of the whole estimate these are;
    given : how many poses the estimate has; span : share of the truth's time that the pairs span.
    """

    truth: Path
    estimate: Path
    rows: Rows
    given: int
    span: float

    @property
    def coverage(self) -> float:
        """Share of the estimate's poses that have a true pose, 0 to 1."""
        return self.rows.size / self.given

    @property
    def dropped(self) -> int:
        """Poses of the estimate without a true pose."""
        return self.given - int(self.rows.size)


def synchronise(truth: Path, estimate: Path, options: ScoreOptions) -> PairedPaths[Path]:
    """Both paths at common times, by `options.sync`; the estimate's stamps are already shifted.

    interpolate: the truth at the stamps of the estimate, never outside the truth and never in a gap
    longer than `max_gap_s`. nearest: stamps that are each other's nearest and at most `max_diff_s`
    apart, so that every stamp is used once and the order is kept; of two equally near the earlier.
    Raises `TooFewPosesError` below `min_poses`.
    """
    if options.sync == "interpolate":
        rows = np.flatnonzero(truth.covers(estimate.t_ns, options.max_gap_s))
        true_rows = None
    else:
        true_rows, rows = _mutual_nearest(truth.t_ns, estimate.t_ns, options.max_diff_s)
    if rows.size < options.min_poses:
        raise TooFewPosesError(_too_few(truth, estimate, int(rows.size), options))
    kept = estimate.selected(_mask(rows, len(estimate)))
    matched = (
        truth.interpolated(kept.t_ns)
        if true_rows is None
        else truth.selected(_mask(true_rows, len(truth)))
    )
    duration_ns = int(truth.t_ns[-1] - truth.t_ns[0])
    span = 1.0 if duration_ns == 0 else float(np.ptp(matched.t_ns)) / duration_ns
    return PairedPaths(matched, kept, rows, len(estimate), span)


def _mask(rows: Rows, size: int) -> npt.NDArray[np.bool_]:
    mask = np.zeros(size, dtype=np.bool_)
    mask[rows] = True
    return mask


def _mutual_nearest(first: Stamps, second: Stamps, max_diff_s: float) -> tuple[Rows, Rows]:
    """Rows of both, increasing, whose stamps are each other's nearest."""
    nearest_in_first = _nearest(first, second)
    back = _nearest(second, first)[nearest_in_first]
    close = np.abs(first[nearest_in_first] - second) <= round(max_diff_s * 1e9)
    rows = np.flatnonzero((back == np.arange(second.size)) & close)
    return nearest_in_first[rows], rows


def _nearest(own: Stamps, asked: Stamps) -> Rows:
    """For each asked stamp the row of the nearest own one, the earlier of two."""
    after = np.clip(np.searchsorted(own, asked), 1, max(own.size - 1, 1))
    if own.size == 1:
        return np.zeros(asked.size, dtype=np.int64)
    before = after - 1
    nearest: Rows = np.where(own[after] - asked < asked - own[before], after, before)
    return nearest


def _too_few(truth: Path, estimate: Path, paired: int, options: ScoreOptions) -> str:
    apart_s = float(np.abs(truth.t_ns[_nearest(truth.t_ns, estimate.t_ns)] - estimate.t_ns).min())
    return (
        f"{paired} of {len(estimate)} poses of the estimate have a true pose at their time, "
        f"at least {options.min_poses} are needed: truth {_range_text(truth)}, "
        f"estimate {_range_text(estimate)} with offset {options.offset_s:g} s, "
        f"nearest stamps {apart_s * 1e-9:.6g} s apart; {_remedy(truth, estimate, options)}"
    )


def _range_text(path: Path) -> str:
    first_s, last_s = float(path.t_ns[0]) * 1e-9, float(path.t_ns[-1]) * 1e-9
    return f"{first_s:.3f} to {last_s:.3f} s ({len(path)} poses, {path.rate_hz:.1f} Hz)"


def _remedy(truth: Path, estimate: Path, options: ScoreOptions) -> str:
    if len(truth) == 1:
        return "the truth is a single pose: is that the right file?"
    late_ns = int(estimate.t_ns[0]) - int(truth.t_ns[-1])
    early_ns = int(truth.t_ns[0]) - int(estimate.t_ns[-1])
    if max(late_ns, early_ns) > 0:
        start_s = (int(truth.t_ns[0]) - int(estimate.t_ns[0])) * 1e-9 + options.offset_s
        return (
            f"their ranges do not overlap, they are {max(late_ns, early_ns) * 1e-9:.1f} s apart; "
            f"a clock set to another zone? --offset {start_s:.3f} makes them start together"
        )
    if options.sync == "nearest":
        return f"try --sync interpolate, --max-diff above {options.max_diff_s:g} or --min-poses"
    return f"try --max-gap above {options.max_gap_s:g}, --offset or --min-poses"
