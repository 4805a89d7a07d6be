"""A path of the car over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry.angles import Floats, wrap
from geometry.errors import TrajectoryError
from geometry.se2 import compose

Stamps = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Planar poses at strictly increasing times.

    t_ns : (n,) int64, nanoseconds; x, y : (n,) metres; heading : (n,) radians, counter-clockwise.
    n >= 1. Arrays are frozen with the object. Raises `TrajectoryError` when that does not hold.
    """

    t_ns: Stamps
    x: Floats
    y: Floats
    heading: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "t_ns", frozen(self.t_ns, np.int64))
        for name in ("x", "y", "heading"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.float64))
        check_stamps(self.t_ns)
        for name in ("x", "y", "heading"):
            check_column(name, getattr(self, name), (len(self),))

    @classmethod
    def from_poses(cls, t_ns: Stamps, poses: Floats) -> Trajectory:
        """A trajectory from stamps (n,) and poses (n, 3)."""
        return cls(t_ns, poses[:, 0], poses[:, 1], poses[:, 2])

    def __len__(self) -> int:
        return int(self.t_ns.size)

    @property
    def positions(self) -> Floats:
        """(n, 2), metres."""
        return np.stack([self.x, self.y], axis=1)

    @property
    def poses(self) -> Floats:
        """(n, 3): x, y, heading."""
        return np.stack([self.x, self.y, self.heading], axis=1)

    @property
    def duration_s(self) -> float:
        """Time from the first pose to the last."""
        return duration_s(self.t_ns)

    @property
    def rate_hz(self) -> float:
        """Poses per second, from the median period; 0 for a single pose."""
        return rate_hz(self.t_ns)

    @property
    def travelled_m(self) -> Floats:
        """(n,): path length from the first pose up to each pose."""
        steps = np.hypot(np.diff(self.x), np.diff(self.y))
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def length_m(self) -> float:
        """Path length from the first pose to the last."""
        return float(self.travelled_m[-1])

    @property
    def speed_m_s(self) -> Floats:
        """(n,): central differences of the path length; 0 for a single pose."""
        if len(self) < 2:
            return np.zeros(1)
        return np.gradient(self.travelled_m, (self.t_ns - self.t_ns[0]) * 1e-9)

    def transformed(self, pose_a_b: Floats) -> Trajectory:
        """The trajectory, given in b, expressed in a."""
        return Trajectory.from_poses(self.t_ns, compose(pose_a_b, self.poses))

    def selected(self, mask: npt.NDArray[np.bool_]) -> Trajectory:
        """The poses where `mask` (n,) is true."""
        return Trajectory(self.t_ns[mask], self.x[mask], self.y[mask], self.heading[mask])

    def interpolated(self, t_ns: Stamps) -> Trajectory:
        """Poses at other times: x and y linear, heading along the shorter arc, wrapped.

        `t_ns` (m,), increasing, must lie within the first and last stamp: nothing is extrapolated
        (`TrajectoryError`). Ask `covers` first which of your stamps have data near them.
        """
        before, after, fraction = bracket(self.t_ns, t_ns)
        weights = fraction[:, None]
        xy = (1 - weights) * self.positions[before] + weights * self.positions[after]
        arc = wrap(self.heading[after] - self.heading[before])
        heading = wrap(self.heading[before] + fraction * arc)
        return Trajectory(t_ns, xy[:, 0], xy[:, 1], heading)

    def covers(self, t_ns: Stamps, max_gap_s: float) -> npt.NDArray[np.bool_]:
        """(m,): true where a stamp lies inside and not in a gap longer than `max_gap_s`.

        A stamp that coincides with one of ours is covered whatever the gaps around it.
        """
        return covers(self.t_ns, t_ns, max_gap_s)


def covers(own_ns: Stamps, t_ns: Stamps, max_gap_s: float) -> npt.NDArray[np.bool_]:
    """(m,): true where a stamp lies within `own_ns` (increasing) and not in too long a gap."""
    after = np.minimum(np.searchsorted(own_ns, t_ns), own_ns.size - 1)
    before = np.maximum(after - 1, 0)
    exact = own_ns[after] == t_ns
    inside = (t_ns >= own_ns[0]) & (t_ns <= own_ns[-1])
    short = (own_ns[after] - own_ns[before]) <= max_gap_s * 1e9
    covered: npt.NDArray[np.bool_] = exact | (inside & short)
    return covered


def bracket(
    own_ns: Stamps, t_ns: Stamps
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Floats]:
    """Rows of `own_ns` (increasing) before and after each stamp, and how far between them, 0 to 1.

    All (m,). Raises `TrajectoryError` when a stamp lies outside `own_ns`.
    """
    outside = np.count_nonzero((t_ns < own_ns[0]) | (t_ns > own_ns[-1]))
    if outside:
        raise TrajectoryError(
            f"{outside} of {t_ns.size} stamps lie outside the path's {duration_s(own_ns):.3f} s; "
            "poses are never extrapolated: select the covered ones"
        )
    after = np.searchsorted(own_ns, t_ns)
    before = np.maximum(after - 1, 0)
    # Whole nanoseconds are subtracted: as float64 they would not be exact over decades.
    span_ns = np.maximum(own_ns[after] - own_ns[before], 1)
    return before, after, (t_ns - own_ns[before]) / span_ns


def duration_s(t_ns: Stamps) -> float:
    """Seconds from the first stamp to the last."""
    return float(t_ns[-1] - t_ns[0]) / 1e9


def rate_hz(t_ns: Stamps) -> float:
    """Stamps per second, from the median period; 0 for a single stamp."""
    return 0.0 if t_ns.size < 2 else float(1e9 / np.median(np.diff(t_ns)))


def frozen(values: npt.ArrayLike, dtype: npt.DTypeLike) -> npt.NDArray[np.generic]:
    """A read-only copy, so that the caller's array stays the caller's."""
    array: npt.NDArray[np.generic] = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


def check_stamps(t_ns: Stamps) -> None:
    """Raise `TrajectoryError` unless `t_ns` is (n,), n >= 1, and increases."""
    if t_ns.ndim != 1:
        raise TrajectoryError(f"stamps have shape {t_ns.shape}, expected (n,)")
    if t_ns.size == 0:
        raise TrajectoryError("a trajectory needs at least one pose, this one has none")
    late = np.flatnonzero(np.diff(t_ns) <= 0)
    if late.size:
        raise TrajectoryError(
            f"stamps must increase: pose {late[0] + 1} is stamped {t_ns[late[0] + 1]} ns, "
            f"not after {t_ns[late[0]]} ns"
        )


def check_column(name: str, column: Floats, shape: tuple[int, ...]) -> None:
    """Raise `TrajectoryError` unless a column has `shape` (n, ...) and is finite."""
    if column.shape != shape:
        raise TrajectoryError(
            f"{name} has shape {column.shape}, expected {shape}: one row for each stamp"
        )
    bad = np.flatnonzero(~np.isfinite(column).reshape(shape[0], -1).all(axis=1))
    if bad.size:
        raise TrajectoryError(
            f"{name} is not finite in pose {bad[0]} (and {bad.size - 1} more); drop such poses"
        )
