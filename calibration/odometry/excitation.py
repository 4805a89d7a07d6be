"""Did the drive show what shall be found? Every fault at once, each with what to drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from calibration.driven import Driven
from calibration.lever.model import forward_m
from geometry import Floats


@dataclass(frozen=True, kw_only=True)
class DriveLimits:
    """What a drive must have shown."""

    least_m: float = field(default=5.0, metadata={"min": 0.1})
    least_turn_rad: float = field(default=float(1.5 * np.pi), metadata={"min": 0.0})
    """To either side."""
    least_curvature_range_per_m: float = field(default=0.8, metadata={"min": 0.0})
    """From the sharpest turn to the right to the sharpest to the left."""
    most_slow_share: float = field(default=0.2, metadata={"min": 0.0, "max": 1.0})
    """Of the distance, below the ERPM from which a motor without sensors is sure of itself."""


def lateral_m_s2(drive: Driven) -> Floats:
    """(w,) size of the lateral acceleration in each window."""
    period = np.diff(drive.t_s[drive.pairs], axis=1)[:, 0]
    return np.asarray(drive.speed_m_s * np.abs(drive.turn_rad) / period)


def slow_windows(
    drive: Driven, low_speed_erpm: float
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(w,) windows in which the tachometer may only guess."""
    assert drive.erpm is not None
    return np.asarray(np.abs(drive.erpm[drive.pairs]).mean(axis=1) < low_speed_erpm)


def distance_faults(
    drives: Sequence[Driven], low_speed_erpm: float, limits: DriveLimits
) -> list[str]:
    """Why counts and metres cannot be compared; empty where they can."""
    driven = [np.abs(forward_m(drive)) for drive in drives]
    total = float(sum(metres.sum() for metres in driven))
    faults = []
    if total < limits.least_m:
        faults.append(f"{total:.1f} m were driven in sight; drive {limits.least_m:g} m or more")
    slow = sum(
        float(metres[slow_windows(drive, low_speed_erpm)].sum())
        for drive, metres in zip(drives, driven, strict=True)
    )
    if total and slow > limits.most_slow_share * total:
        faults.append(
            f"{100 * slow / total:.0f} % of the way was slower than {low_speed_erpm:g} ERPM, where "
            "the tachometer guesses: drive faster (or give the car's own low_speed_erpm in the rig)"
        )
    return faults


def steering_faults(drives: Sequence[Driven], limits: DriveLimits) -> list[str]:
    """Why the steering cannot be found; empty where it can."""
    faults = [
        f"{drive.name}: has no /drive, so nobody knows what the servo was told: drive it through "
        "the motor controller, or calibrate the distance alone with --speed-only"
        for drive in drives
        if not drive.servo.size
    ]
    turns = np.concatenate([drive.turn_rad for drive in drives])
    for side, sign in (("left", 1.0), ("right", -1.0)):
        turned = float((sign * turns)[sign * turns > 0].sum())
        if turned < limits.least_turn_rad:
            faults.append(
                f"it turned {np.degrees(turned):.0f} deg to the {side}; drive a full circle or "
                "more to either side"
            )
    metres = np.concatenate([np.abs(forward_m(drive)) for drive in drives])
    bent = turns / np.maximum(metres, 1e-6)
    low, high = np.percentile(bent, [3.0, 97.0]) if bent.size else (0.0, 0.0)
    if high - low < limits.least_curvature_range_per_m:
        faults.append(
            f"the curvature ranges over {high - low:.2f} 1/m only, expected "
            f"{limits.least_curvature_range_per_m:g}: steer further, to both sides"
        )
    return faults
