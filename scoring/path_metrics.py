"""How far an aligned path is from the true one, in the plane or in space.

d is 2 or 3, n the number of paired poses. The absolute and the relative pose error are those of
Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012, and agree with evo.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats, Stamps, Trajectory, wrap
from scoring.options import ScoreOptions
from scoring.result import PathErrors

CHI2_95 = {2: -2.0 * math.log(0.05), 3: 7.814727903251179}
"""95 % quantiles of chi-square by degrees of freedom; the closed form exists for two only."""

STATISTICS = ("rmse", "mean", "median", "std", "min", "max", "sse")

_JUST_REACHED = 1.0 - 1e-9


@dataclass(frozen=True, eq=False)
class PosedPath:
    """Poses of any dimension: t_ns (n,), positions (n, d), rotations (n, d, d)."""

    t_ns: Stamps
    positions: Floats
    rotations: Floats

    @classmethod
    def planar(cls, path: Trajectory) -> PosedPath:
        """The same poses, headings as rotations."""
        cos, sin = np.cos(path.heading), np.sin(path.heading)
        rotations = np.stack([cos, -sin, sin, cos], axis=1).reshape(-1, 2, 2)
        return cls(path.t_ns, path.positions, rotations)


def statistics(prefix: str, errors: Floats) -> dict[str, float | None]:
    """`PREFIX_rmse`, mean, median, std, min, max and sse of errors (n,); None where n = 0."""
    if errors.size == 0:
        return {f"{prefix}_{name}": None for name in STATISTICS}
    squares = float(np.dot(errors, errors))
    values = (
        math.sqrt(squares / errors.size),
        float(errors.mean()),
        _median(errors),
        float(errors.std()),
        float(errors.min()),
        float(errors.max()),
        squares,
    )
    return {f"{prefix}_{name}": value for name, value in zip(STATISTICS, values, strict=True)}


def _median(values: Floats) -> float:
    # np.median imports numpy.ma, a tenth of the whole command's time.
    low, high = (values.size - 1) // 2, values.size // 2
    ordered = np.partition(values, [low, high])
    return float(ordered[low] + ordered[high]) / 2.0


def planar_errors(truth: Trajectory, estimate: Trajectory) -> PathErrors:
    """Errors of an aligned estimate at the stamps it shares with the truth.

    Along and cross track are those of the true heading: ahead and to the left are positive.
    """
    error = estimate.positions - truth.positions
    cos, sin = np.cos(truth.heading), np.sin(truth.heading)
    return PathErrors(
        t_ns=truth.t_ns,
        truth=truth.positions,
        estimate=estimate.positions,
        position_m=np.hypot(error[:, 0], error[:, 1]),
        along_m=cos * error[:, 0] + sin * error[:, 1],
        cross_m=-sin * error[:, 0] + cos * error[:, 1],
        heading_rad=wrap(estimate.heading - truth.heading),
    )


def space_errors(truth: PosedPath, estimate: PosedPath) -> PathErrors:
    """The same in space, where along, cross and heading have no meaning and are NaN."""
    nothing = np.full(truth.t_ns.size, np.nan)
    return PathErrors(
        t_ns=truth.t_ns,
        truth=truth.positions,
        estimate=estimate.positions,
        position_m=np.linalg.norm(estimate.positions - truth.positions, axis=1),
        along_m=nothing,
        cross_m=nothing,
        heading_rad=nothing,
    )


def heading_metrics(heading_rad: Floats) -> dict[str, float | None]:
    """`heading_rmse`, mean and max of the absolute error in radians, and the same as `_deg`."""
    names = ("heading_rmse", "heading_mean", "heading_max")
    if not np.isfinite(heading_rad).all():
        return {name + suffix: None for suffix in ("", "_deg") for name in names}
    absolute = np.abs(heading_rad)
    values = (math.sqrt(float(np.mean(absolute**2))), float(absolute.mean()), float(absolute.max()))
    radians = dict(zip(names, values, strict=True))
    degrees = {f"{name}_deg": math.degrees(value) for name, value in radians.items()}
    return {**radians, **degrees}


def relative_metrics(
    truth: PosedPath, estimate: PosedPath, options: ScoreOptions
) -> dict[str, float | None]:
    """Relative pose error over consecutive steps: `rpe_*` in metres, `rpe_rotation_*` in radians.

    A step ends at the first pose that is `rpe_delta` frames, seconds or metres of the estimated
    path after its beginning. All None when the path is shorter than one step.
    """
    knots = _step_knots(estimate, options)
    moved_truth, turned_truth = _steps(truth, knots)
    moved, turned = _steps(estimate, knots)
    return {
        **statistics("rpe", np.linalg.norm(moved - moved_truth, axis=1)),
        **statistics("rpe_rotation", angles_between(turned_truth, turned)),
    }


def _step_knots(path: PosedPath, options: ScoreOptions) -> npt.NDArray[np.int64]:
    if options.rpe_unit == "f":
        return np.arange(0, path.t_ns.size, int(options.rpe_delta))
    if options.rpe_unit == "s":
        progress = (path.t_ns - path.t_ns[0]) * 1e-9
    else:
        lengths = np.linalg.norm(np.diff(path.positions, axis=0), axis=1)
        progress = np.concatenate([[0.0], np.cumsum(lengths)])
    knots = [0]
    while True:
        # Ten steps of 0.1 m sum to a rounding error less than 1 m and are 1 m.
        goal = progress[knots[-1]] + options.rpe_delta * _JUST_REACHED
        following = int(np.searchsorted(progress, goal))
        if following == progress.size:
            return np.array(knots)
        knots.append(following)


def _steps(path: PosedPath, knots: npt.NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Translation (k, d) and rotation (k, d, d) of each knot as the one before sees it."""
    rotations, shift = path.rotations[knots], np.diff(path.positions[knots], axis=0)
    before, after = rotations[:-1], rotations[1:]
    moved, turned = np.zeros_like(shift), np.zeros_like(before)
    # Sums over the two or three axes by hand: matmul of many small matrices takes longer.
    for axis in range(shift.shape[1]):
        moved += before[:, axis, :] * shift[:, axis, None]
        turned += before[:, axis, :, None] * after[:, axis, None, :]
    return moved, turned


def angles_between(first: Floats, second: Floats) -> Floats:
    """(k,) radians in [0, pi] that turn rotations (k, d, d) into others, d = 2 or 3.

    From the chord ||R1 - R2|| = 2 sqrt(2) sin(angle / 2) (Frobenius), which is exact near zero.
    """
    difference = second - first
    chord = np.sqrt(np.einsum("kij,kij->k", difference, difference))
    angles: Floats = 2.0 * np.arcsin(np.minimum(chord / math.sqrt(8.0), 1.0))
    return angles


def normalised_squares(errors: Floats, covariances: Floats) -> Floats:
    """NEES (k,): e^T P^-1 e of errors (n, d) under covariances (n, d, d).

    Bar-Shalom, Li, Kirubarajan 2001, section 5.4. Covariances that cannot be inverted (a start that
    is certain) are left out, so k <= n.
    """
    # Scaled to a unit diagonal, so that metres and radians count alike in the test for rank.
    scale = np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 0.0))
    certain = np.any(scale == 0.0, axis=1)
    scale = np.where(certain[:, None], 1.0, scale)
    unit = covariances / (scale[:, :, None] * scale[:, None, :])
    smallest = np.linalg.eigvalsh(unit)[:, 0]
    good = ~certain & (smallest > 1e-12)
    scaled = (errors / scale)[good, :, None]
    nees: Floats = (np.swapaxes(scaled, 1, 2) @ np.linalg.solve(unit[good], scaled))[:, 0, 0]
    return nees


def consistency(prefix: str, nees: Floats, degrees: int) -> dict[str, float | None]:
    """Mean NEES and the share of it within the 95 % quantile of chi-square; None where n = 0."""
    if nees.size == 0:
        return {f"{prefix}_nees": None, f"{prefix}_nees_within": None}
    return {
        f"{prefix}_nees": float(nees.mean()),
        f"{prefix}_nees_within": float(np.mean(nees <= CHI2_95[degrees])),
    }
