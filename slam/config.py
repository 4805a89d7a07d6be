"""The parameters of the filters, and the two presets that ship.

Units stand in the names. Ranges are checked by `capture.configuration` when a value comes from a
person. All noise is rate independent: it depends on the motion and the time it took, not on how
many odometry messages told it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

UNLIMITED = math.inf


@dataclass(frozen=True, kw_only=True)
class MotionNoise:
    """How much an odometry increment can be wrong.

    Additive part: random walk in x, y and heading (thesis Eq. 3.11: per update at 15 Hz).
    Proportional part: Thrun, Burgard, Fox, Probabilistic Robotics (2005), table 5.6, alpha 1..4
    for rot1/rot2 from rotation, from translation, translation from itself, from rotation. A
    variance gathered in one second at constant speed; table 5.6 read per step would depend on the
    rate of the odometry.
    """

    xy_sigma_m_per_sqrt_s: float = field(metadata={"min": 0.0})
    heading_sigma_rad_per_sqrt_s: float = field(metadata={"min": 0.0})
    alpha1: float = field(default=0.0, metadata={"min": 0.0})
    alpha2_rad2_per_m2: float = field(default=0.0, metadata={"min": 0.0})
    alpha3: float = field(default=0.0, metadata={"min": 0.0})
    alpha4_m2_per_rad2: float = field(default=0.0, metadata={"min": 0.0})
    at_rest: bool = False
    """Whether the additive part also acts while the odometry stands still."""


@dataclass(frozen=True, kw_only=True)
class ObservationNoise:
    """Standard deviations of one range-bearing observation.

    The range part is `hypot(range_sigma_m, range_sigma_per_m * range)`.
    """

    range_sigma_m: float = field(metadata={"min": 1e-6})
    bearing_sigma_rad: float = field(metadata={"min": 1e-6})
    range_sigma_per_m: float = field(default=0.0, metadata={"min": 0.0})


@dataclass(frozen=True, kw_only=True)
class EkfConfig:
    """Everything that decides what EKF-SLAM makes of a session.

    Gates are on the squared Mahalanobis distance of the innovation (chi-square, 2 degrees of
    freedom: 5.991 is 95 %, 9.210 is 99 %).
    """

    motion: MotionNoise
    observation: ObservationNoise
    accept_gate: float = field(metadata={"min": 0.0})
    """Nearest association: an observation belongs to a landmark up to here."""
    spawn_gate: float = field(metadata={"min": 0.0})
    """Nearest association: beyond this from every landmark it is a new one; between: ignored."""
    innovation_gate: float = field(default=UNLIMITED, metadata={"min": 0.0})
    """Known ids: an observation further off than this is rejected."""
    tail_gate: float = field(default=UNLIMITED, metadata={"min": 0.0})
    """Beyond this an observation's noise is inflated so that its distance would just meet it."""
    relocate_after: int = field(default=0, metadata={"min": 0})
    """Known ids: rejections in a row after which a landmark is placed anew; 0 never."""
    min_seen: int = field(default=1, metadata={"min": 1})
    """A landmark is reported once this many observations stand behind it."""
    path_period_s: float = field(default=0.05, metadata={"min": 0.0})
    """Between updates the path holds a pose this often; 0 keeps every odometry sample."""


_SQRT_15_HZ = math.sqrt(15.0)

PRESETS = {
    # Thesis section 3.2.4, Eq. 3.11, read as standard deviations in m and degrees per 15 Hz update
    # (the reading whose consistency holds), one threshold 5.991 for old and new.
    "thesis": EkfConfig(
        motion=MotionNoise(
            xy_sigma_m_per_sqrt_s=0.01 * _SQRT_15_HZ,
            heading_sigma_rad_per_sqrt_s=math.radians(0.5) * _SQRT_15_HZ,
            at_rest=True,
        ),
        observation=ObservationNoise(range_sigma_m=0.04, bearing_sigma_rad=math.radians(1.0)),
        accept_gate=5.991,
        spawn_gate=5.991,
    ),
    # One set for cars and robots whose noise nobody measured: error grows with what was driven and
    # with the range, outliers are bounded, and a grey zone keeps good sightings from spawning.
    "robust": EkfConfig(
        motion=MotionNoise(
            xy_sigma_m_per_sqrt_s=0.01,
            heading_sigma_rad_per_sqrt_s=0.03,
            alpha1=0.1,
            alpha2_rad2_per_m2=0.005,
            alpha3=0.02,
            alpha4_m2_per_rad2=0.0005,
        ),
        observation=ObservationNoise(
            range_sigma_m=0.04, bearing_sigma_rad=math.radians(1.0), range_sigma_per_m=0.05
        ),
        accept_gate=9.21,
        spawn_gate=25.0,
        innovation_gate=100.0,
        tail_gate=5.991,
        relocate_after=5,
        min_seen=3,
    ),
}
