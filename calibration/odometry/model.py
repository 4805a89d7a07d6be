"""From counts and servo to motion: a bicycle with a servo that is late and tyres that give way.

    distance  = metres_per_count * counts
    u         = (servo(t - lag) - offset) / gain
    curvature = tan(u + linkage * u^3) / (wheelbase * (1 + understeer * v^2))

For small angles only gain * wheelbase shows: the two are told apart by the bend of the tangent
alone (u^2 / 3, 5 % at 0.4 rad), and a steering linkage bends, too. One percent of wheelbase looks
like 0.007 / rad^2 of linkage, which nobody knows that well, so the drive does not tell the
wheelbase: a tape measure does, and enters as what it is, a measurement with a sigma. (Rajamani,
Vehicle Dynamics and Control, 2.2 and 3.3, for the bicycle and its understeer.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.driven import Driven, window_sums
from calibration.lever.model import SLIP_MEAN, displacement_residuals
from geometry import Floats

NAMES = (
    "metres_per_count",
    "clock_s",
    "side_m",
    "steering_angle_to_servo_gain",
    "steering_angle_to_servo_offset",
    "wheelbase_m",
    "understeer_s2_per_m2",
    "servo_lag_s",
    "linkage_per_rad2",
)
SPEED_NAMES = NAMES[:3]
MAX_STEERING_RAD = 1.2


@dataclass(frozen=True)
class Model:
    """The parameters in the order of `NAMES`.

    clock_s : by how much the stamps of the counts are late against the film; side_m : how far the
    truth's point is to the right of the line along which the counts are driven.
    """

    metres_per_count: float
    clock_s: float
    side_m: float
    gain: float = 1.0
    offset: float = 0.0
    wheelbase_m: float = 1.0
    understeer_s2_per_m2: float = 0.0
    lag_s: float = 0.0
    linkage_per_rad2: float = 0.0


def distance_residuals(drive: Driven, model: Model) -> Floats:
    """(w,) metres left over along the car."""
    left = displacement_residuals(drive, 0.0, model.side_m, 0.0, SLIP_MEAN, model.metres_per_count)[
        :, 0
    ]
    # Counts that are late tell the speed of before: what is missing is the change of speed.
    i, j = drive.pairs.T
    assert drive.counts is not None
    rate = np.gradient(drive.counts, drive.t_s) * model.metres_per_count
    return np.asarray(left - model.clock_s * (rate[j] - rate[i]))


def turn_residuals(drive: Driven, model: Model) -> Floats:
    """(w,) radians left over."""
    return drive.turn_rad - window_sums(drive.pairs, step_turns(drive, model))


def step_turns(drive: Driven, model: Model) -> Floats:
    """(n - 1,) how far the car turns in each step."""
    assert drive.counts is not None
    gone = model.metres_per_count * np.diff(drive.counts)
    speed = gone / np.diff(drive.t_s)
    angle = (drive.servo_means(model.lag_s) - model.offset) / model.gain
    angle = angle + model.linkage_per_rad2 * angle**3
    angle = np.clip(angle, -MAX_STEERING_RAD, MAX_STEERING_RAD)
    stiff = model.wheelbase_m * np.maximum(1.0 + model.understeer_s2_per_m2 * speed**2, 0.1)
    return np.asarray(np.tan(angle) / stiff * gone)


def dead_reckoned(drive: Driven, model: Model) -> Floats:
    """(n, 2) where counts and servo take the car from where the truth began."""
    assert drive.counts is not None
    turn = step_turns(drive, model)
    heading = np.concatenate([[0.0], np.cumsum(turn)]) + drive.heading[0]
    middle = 0.5 * (heading[1:] + heading[:-1])
    gone = model.metres_per_count * np.diff(drive.counts)
    steps = gone[:, None] * np.stack([np.cos(middle), np.sin(middle)], axis=1)
    return np.asarray(drive.xy[0] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]))


def joined_distances(drives: Sequence[Driven], model: Model) -> Floats:
    """Residuals of all drives, one after the other."""
    return np.concatenate([distance_residuals(drive, model) for drive in drives])


def joined_turns(drives: Sequence[Driven], model: Model) -> Floats:
    """Residuals of all drives, one after the other."""
    return np.concatenate([turn_residuals(drive, model) for drive in drives])
