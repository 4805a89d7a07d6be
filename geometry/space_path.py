"""A path in space: what a hand-held camera walks, for scoring paths that leave the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry.angles import Floats
from geometry.errors import TrajectoryError
from geometry.trajectory import Stamps, Trajectory, check_columns, covers, frozen, rate_hz


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
        columns = {"position": self.positions, "quaternion": np.asarray(self.quaternions)}
        check_columns(self.t_ns, columns)
        norms = np.linalg.norm(self.quaternions, axis=1)
        off = np.flatnonzero(np.abs(norms - 1.0) > 0.01)
        if off.size:
            raise TrajectoryError(
                f"the quaternion of pose {off[0]} has length {norms[off[0]]:.3f}, expected 1"
            )
        quaternions = self.quaternions / norms[:, None]
        object.__setattr__(self, "quaternions", frozen(quaternions, np.float64))

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
        """Poses at other times within ours: positions linear, rotations along the great arc."""
        right = np.clip(np.searchsorted(self.t_ns, t_ns, side="left"), 1, max(len(self) - 1, 1))
        if len(self) == 1:
            right = np.zeros_like(right)
        left = np.maximum(right - 1, 0)
        span = np.maximum(self.t_ns[right] - self.t_ns[left], 1)
        fraction = ((t_ns - self.t_ns[left]) / span)[:, None]
        if np.any((fraction < 0) | (fraction > 1)):
            raise TrajectoryError("stamps outside the path; poses are never extrapolated")
        positions = (1 - fraction) * self.positions[left] + fraction * self.positions[right]
        return SpacePath(
            t_ns, positions, _slerp(self.quaternions[left], self.quaternions[right], fraction)
        )

    def covers(self, t_ns: Stamps, max_gap_s: float) -> npt.NDArray[np.bool_]:
        """(m,): true where a stamp lies inside and not in a gap longer than `max_gap_s`."""
        return covers(self.t_ns, t_ns, max_gap_s)

    def out_of_plane(self) -> tuple[float, float]:
        """How far the path leaves the plane: height range in metres, largest tilt in radians."""
        height_m = float(np.ptp(self.positions[:, 2]))
        # The z axis of the body against the vertical: element (2, 2) is the cosine of the tilt.
        tilt = float(np.arccos(np.clip(self.rotations[:, 2, 2], -1.0, 1.0)).max())
        return height_m, tilt

    def planar(self) -> Trajectory:
        """The shadow on the floor: x, y and the yaw of each pose."""
        rotations = self.rotations
        heading = np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0])
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
    end = np.where(cosine < 0, -end, end)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(angle)
    # Nearly equal rotations: the chord is the arc, and the division by the sine would be 0/0.
    near = sine < 1e-9
    safe = np.where(near, 1.0, sine)
    first = np.where(near, 1 - fraction, np.sin((1 - fraction) * angle) / safe)
    second = np.where(near, fraction, np.sin(fraction * angle) / safe)
    mixed = first * start + second * end
    unit: Floats = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return unit
