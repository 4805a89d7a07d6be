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
        check_columns(self.t_ns, {"x": self.x, "y": self.y, "heading": self.heading})

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
        return float(self.t_ns[-1] - self.t_ns[0]) * 1e-9

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
        """Poses at other times: x and y linear, heading along the shorter arc.

        `t_ns` (m,) must lie within the first and last stamp: nothing is extrapolated
        (`TrajectoryError`). Ask `covers` first which of your stamps have data near them.
        """
        outside = (t_ns < self.t_ns[0]) | (t_ns > self.t_ns[-1])
        if np.any(outside):
            raise TrajectoryError(
                f"{int(outside.sum())} of {t_ns.size} stamps lie outside the trajectory's "
                f"{self.duration_s:.3f} s; poses are never extrapolated: select the covered ones"
            )
        # Relative seconds: float64 holds nanoseconds exactly over days, not over decades.
        t_s, own_s = (t_ns - self.t_ns[0]) * 1e-9, (self.t_ns - self.t_ns[0]) * 1e-9
        unwrapped = np.unwrap(self.heading)
        return Trajectory(
            t_ns,
            np.interp(t_s, own_s, self.x),
            np.interp(t_s, own_s, self.y),
            wrap(np.interp(t_s, own_s, unwrapped)),
        )

    def covers(self, t_ns: Stamps, max_gap_s: float) -> npt.NDArray[np.bool_]:
        """(m,): true where a stamp lies inside and not in a gap longer than `max_gap_s`.

        A stamp that coincides with one of ours is covered whatever the gaps around it.
        """
        return covers(self.t_ns, t_ns, max_gap_s)


def covers(own_ns: Stamps, t_ns: Stamps, max_gap_s: float) -> npt.NDArray[np.bool_]:
    """(m,): true where a stamp lies within `own_ns` (increasing) and not in too long a gap."""
    after = np.clip(np.searchsorted(own_ns, t_ns, side="left"), 0, own_ns.size - 1)
    before = np.clip(after - 1, 0, None)
    exact = own_ns[after] == t_ns
    inside = (t_ns >= own_ns[0]) & (t_ns <= own_ns[-1])
    short = (own_ns[after] - own_ns[before]) <= max_gap_s * 1e9
    covered: npt.NDArray[np.bool_] = exact | (inside & short)
    return covered


def rate_hz(t_ns: Stamps) -> float:
    """Stamps per second, from the median period; 0 for a single stamp."""
    return 0.0 if t_ns.size < 2 else float(1e9 / np.median(np.diff(t_ns)))


def frozen(values: npt.ArrayLike, dtype: npt.DTypeLike) -> npt.NDArray[np.generic]:
    """A read-only copy, so that the caller's array stays the caller's."""
    array: npt.NDArray[np.generic] = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


def check_columns(t_ns: Stamps, columns: dict[str, Floats]) -> None:
    """Raise `TrajectoryError` unless stamps increase and columns are finite and as long as they."""
    if t_ns.ndim != 1 or t_ns.size == 0:
        raise TrajectoryError("a trajectory needs at least one pose, this one has none")
    for name, column in columns.items():
        if column.shape[0] != t_ns.size:
            raise TrajectoryError(f"{name} has {column.shape[0]} values for {t_ns.size} stamps")
        bad = np.flatnonzero(~np.isfinite(column.reshape(t_ns.size, -1)).all(axis=1))
        if bad.size:
            raise TrajectoryError(
                f"{name} is not finite in pose {bad[0]} (and {bad.size - 1} more); drop such poses"
            )
    late = np.flatnonzero(np.diff(t_ns) <= 0)
    if late.size:
        raise TrajectoryError(
            f"stamps must increase: pose {late[0] + 1} is stamped {t_ns[late[0] + 1]} ns, "
            f"not after {t_ns[late[0]]} ns"
        )
