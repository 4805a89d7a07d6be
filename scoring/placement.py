"""An estimate on the clock and in the frame of the truth: path, map and covariances together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from capture import NO_STAMP, Estimate, EstimatedMap
from geometry import Floats, Stamps, Trajectory, transform_points


def shifted_stamps(t_ns: Stamps, offset_s: float) -> Stamps:
    """The same times on a clock that is `offset_s` ahead; unknown ones stay unknown."""
    return np.where(t_ns == NO_STAMP, NO_STAMP, t_ns + round(offset_s * 1e9))


def on_clock(estimate: Estimate, offset_s: float) -> Estimate:
    """The estimate with `offset_s` added to all its stamps, those of its landmarks included."""
    path, own = estimate.path, estimate.map
    if offset_s == 0.0:
        return estimate
    if own is not None:
        own = replace(
            own,
            t_added_ns=_optional(own.t_added_ns, offset_s),
            t_first_ns=_optional(own.t_first_ns, offset_s),
        )
    path = Trajectory.from_poses(shifted_stamps(path.t_ns, offset_s), path.poses)
    return replace(estimate, path=path, map=own)


def in_frame(estimate: Estimate, pose: Floats) -> Estimate:
    """The estimate, given in its own frame, in the frame where that stands at `pose` (3,)."""
    own = estimate.map
    return replace(
        estimate,
        path=estimate.path.transformed(pose),
        map=None if own is None else _map_in_frame(own, pose),
        path_covariances=_turned(estimate.path_covariances, float(pose[2])),
    )


def _map_in_frame(own: EstimatedMap, pose: Floats) -> EstimatedMap:
    added_from = own.added_from
    if added_from is not None:
        added_from = transform_points(pose, added_from)
    return replace(own, landmarks=own.landmarks.transformed(pose), added_from=added_from)


def _optional(t_ns: Stamps | None, offset_s: float) -> Stamps | None:
    return None if t_ns is None else shifted_stamps(t_ns, offset_s)


def _turned(covariances: Floats | None, heading: float) -> Floats | None:
    """Covariances (n, 3, 3) of x, y, heading in a frame turned by `heading`."""
    if covariances is None:
        return None
    cos, sin = np.cos(heading), np.sin(heading)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    turned: Floats = turn @ covariances @ turn.T
    return turned
