"""A path in space: what a hand-held camera walks, for scoring paths that leave the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry.angles import Floats, wrap
from geometry.errors import TrajectoryError
from geometry.trajectory import (
    Stamps,
    Trajectory,
    bracket,
    check_column,
    check_stamps,
    covers,
    frozen,
    rate_hz,
)


@dataclass(frozen=True, eq=False)
class SpacePath:
    """Poses in space at strictly increasing times.

    t_ns : (n,) int64; positions : (n, 3) metres; quaternions : (n, 4) as x, y, z, w (TUM order),
    normalised on construction. Raises `TrajectoryError` when that cannot be.
    """

    t_ns: Stamps
    positions: Floats
    quaternions: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "t_ns", frozen(self.t_ns, np.int64))
        object.__setattr__(self, "positions", frozen(self.positions, np.float64))
        raw = np.asarray(self.quaternions, dtype=np.float64)
        check_stamps(self.t_ns)
        check_column("positions", self.positions, (len(self), 3))
        check_column("quaternions", raw, (len(self), 4))
        norms = np.linalg.norm(raw, axis=1)
        off = np.flatnonzero(np.abs(norms - 1.0) > 0.01)
        if off.size:
            raise TrajectoryError(
                f"the quaternion of pose {off[0]} has length {norms[off[0]]:.3f}, expected 1"
            )
        object.__setattr__(self, "quaternions", frozen(raw / norms[:, None], np.float64))

    def __len__(self) -> int:
        return int(self.t_ns.size)

    @property
    def rotations(self) -> Floats:
        """(n, 3, 3) rotation matrices."""
        return rotation_matrices(self.quaternions)

    @property
    def rate_hz(self) -> float:
        """Poses per second, from the median period; 0 for a single pose."""
        return rate_hz(self.t_ns)

    def selected(self, mask: npt.NDArray[np.bool_]) -> SpacePath:
        """The poses where `mask` (n,) is true."""
        return SpacePath(self.t_ns[mask], self.positions[mask], self.quaternions[mask])

    def interpolated(self, t_ns: Stamps) -> SpacePath:
        """Poses at other times: positions linear, rotations along the great arc.

        `t_ns` (m,), increasing, must lie within the first and last stamp: nothing is extrapolated
        (`TrajectoryError`). Ask `covers` first which of your stamps have data near them.
        """
        before, after, fraction = bracket(self.t_ns, t_ns)
        weights = fraction[:, None]
        positions = (1 - weights) * self.positions[before] + weights * self.positions[after]
        turned = _slerp(self.quaternions[before], self.quaternions[after], weights)
        return SpacePath(t_ns, positions, turned)

    def covers(self, t_ns: Stamps, max_gap_s: float) -> npt.NDArray[np.bool_]:
        """(m,): true where a stamp lies inside and not in a gap longer than `max_gap_s`.

        A stamp that coincides with one of ours is covered whatever the gaps around it.
        """
        return covers(self.t_ns, t_ns, max_gap_s)

    def out_of_plane(self) -> tuple[float, float]:
        """How far the path leaves the plane: height range in metres, largest tilt in radians."""
        height_m = float(np.ptp(self.positions[:, 2]))
        up = self.rotations[:, :, 2]
        # Not the arccos of the last: it would lose every tilt below 1e-8.
        tilt_rad = np.arctan2(np.hypot(up[:, 0], up[:, 1]), up[:, 2])
        return height_m, float(tilt_rad.max())

    def planar(self) -> Trajectory:
        """The shadow on the floor: x, y and the yaw of each pose."""
        rotations = self.rotations
        heading = wrap(np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0]))
        return Trajectory(self.t_ns, self.positions[:, 0], self.positions[:, 1], heading)


def rotation_matrices(quaternions: Floats) -> Floats:
    """(n, 3, 3) from unit quaternions (n, 4) in the order x, y, z, w."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _slerp(start: Floats, end: Floats, fraction: Floats) -> Floats:
    """Unit quaternions (n, 4) between two, at fractions (n, 1). Shoemake, SIGGRAPH 1985."""
    cosine = np.sum(start * end, axis=1, keepdims=True)
    # q and -q are one rotation: take the end on the near side, or the path would turn the long way.
    end = np.where(cosine < 0, -end, end)
    half_turns = np.arccos(np.minimum(np.abs(cosine), 1.0)) / np.pi
    # sin(k a) = k a sinc(k a / pi): the common factor a cancels in the norm, so a = 0 is no case.
    rest = 1 - fraction
    mixed = (
        rest * np.sinc(rest * half_turns) * start + fraction * np.sinc(fraction * half_turns) * end
    )
    unit: Floats = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return unit
