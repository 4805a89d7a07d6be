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
class LandmarkRules:
    """When a landmark without a name is believed, and when it is given up.

    As they stand here all are believed and none is given up. Where the sensor names its landmarks
    only the limit of the map applies: a name is no clutter.

    Each landmark carries the log-odds that it exists, a sequential probability ratio test (Wald,
    1945; the track score of Sittler, 1964): a sighting adds `log(P g / clutter_density)`, g being
    its likelihood, so that a near hit of a precise sensor says much and a chance one little; an
    absence adds `log(1 - P)`. P is `detection_probability` between the certain ranges, falls
    linearly to 0 at the possible ones, and is 0 outside the field of view and behind what was seen
    in front. A landmark that is believed has the benefit of the doubt: for it absence counts at
    certain ranges only, whatever its pose may be.
    """

    start_log_odds: float = 0.0
    """Of a landmark that was seen once."""
    confirm_log_odds: float = -UNLIMITED
    """A landmark is believed, and reported, from here on."""
    remove_below_log_odds: float = field(default=-2.0, metadata={"max": 0.0})
    max_log_odds: float = field(default=6.0, metadata={"min": 0.0})
    """Bounds how many misses an old landmark outlives."""
    clutter_density_per_m_rad: float = field(default=0.0, metadata={"min": 0.0})
    """False sightings of one scan per metre of range and radian of bearing. 0: a sighting counts
    as `log(P / false_match_probability)` wherever it is, an absence as much less."""
    detection_probability: float = field(default=0.0, metadata={"min": 0.0, "max": 0.999})
    """0: absence is never evidence."""
    false_match_probability: float = field(default=0.05, metadata={"min": 1e-6, "max": 0.999})
    """How often clutter is taken for a landmark that is not there; also the least that P is taken
    to be where something was seen all the same."""
    near_possible_m: float = field(default=0.0, metadata={"min": 0.0})
    near_certain_m: float = field(default=0.0, metadata={"min": 0.0})
    far_certain_m: float = field(default=UNLIMITED, metadata={"min": 0.0})
    far_possible_m: float = field(default=UNLIMITED, metadata={"min": 0.0})
    field_of_view_rad: float = field(default=math.tau, metadata={"min": 0.0, "max": math.tau})
    """Whole angle, centred on the car's heading."""
    learns_field_of_view: bool = False
    """Whether the field of view is also learnt: where nothing is ever seen absence says nothing."""
    occluder_radius_m: float = field(default=0.0, metadata={"min": 0.0})
    """What stands before a landmark, within this of the line of sight, may hide it; 0 never."""
    spacing_m: float = field(default=0.0, metadata={"min": 0.0})
    """No two landmarks stand nearer to each other: of two that do, and of which a scan shows but
    one, the one seen less often is given up."""
    max_landmarks: int = field(default=1000, metadata={"min": 1})
    """A full map takes no new landmark; how many it refused is counted."""
    same_place_m: float = field(default=0.3, metadata={"min": 0.0})
    """A landmark counts as having stood already where one was given up within this distance."""


@dataclass(frozen=True, kw_only=True)
class EkfConfig:
    """Everything that decides what EKF-SLAM makes of a session.

    Gates are on the squared Mahalanobis distance of the innovation (chi-square, 2 degrees of
    freedom: 5.991 is 95 %, 9.210 is 99 %).
    """

    motion: MotionNoise
    observation: ObservationNoise
    accept_gate: float = field(metadata={"min": 0.0})
    """Without names: an observation may belong to a landmark up to here."""
    spawn_gate: float = field(metadata={"min": 0.0})
    """Without names: beyond this from every landmark it is a new one; between: ignored."""
    joint_probability: float = field(default=0.95, metadata={"min": 0.5, "max": 0.9999})
    """Joint association: all pairs of a scan together must lie within this much of what the
    uncertainty allows."""
    joint_nodes: int = field(default=2000, metadata={"min": 1})
    """Joint association: pairs tried for one scan before the best so far is taken."""
    innovation_gate: float = field(default=UNLIMITED, metadata={"min": 0.0})
    """Known ids: an observation further off than this is rejected."""
    tail_gate: float = field(default=UNLIMITED, metadata={"min": 0.0})
    """Beyond this an observation's noise is inflated so that its distance would just meet it."""
    relocate_after: int = field(default=0, metadata={"min": 0})
    """Known ids: rejections in a row after which a landmark is placed anew; 0 never."""
    min_seen: int = field(default=1, metadata={"min": 1})
    """A landmark is reported once this many observations stand behind it."""
    max_observations: int = field(default=256, metadata={"min": 1, "max": 512})
    """Of a scan with more only the first are taken; how many were not is counted."""
    landmarks: LandmarkRules = LandmarkRules()
    path_period_s: float = field(default=0.05, metadata={"min": 0.0})
    """Between updates the path holds a pose this often; 0 keeps every odometry sample."""


_SQRT_15_HZ = math.sqrt(15.0)

ROBUST_MOTION = MotionNoise(
    xy_sigma_m_per_sqrt_s=0.01,
    heading_sigma_rad_per_sqrt_s=0.03,
    alpha1=0.1,
    alpha2_rad2_per_m2=0.005,
    alpha3=0.02,
    alpha4_m2_per_rad2=0.0005,
)
"""For cars and robots whose odometry nobody measured: its error grows with what was driven."""
ROBUST_OBSERVATION = ObservationNoise(
    range_sigma_m=0.04, bearing_sigma_rad=math.radians(1.0), range_sigma_per_m=0.05
)
# Four to ten hits of a one-degree lidar on a cone of 0.1 m are certain from 0.57 to 1.43 m and
# possible from 0.52 to 1.91 m (thesis appendix A with the exact geometry). 0.05 per metre and
# radian is about one false cone in two scans over 2 m and the full circle. Log-odds of 10 take two
# or three good sightings more than the first. Nearer than 0.15 m two cones look like one.
ROBUST_LANDMARKS = LandmarkRules(
    confirm_log_odds=10.0,
    remove_below_log_odds=-4.0,
    max_log_odds=16.0,
    clutter_density_per_m_rad=0.05,
    detection_probability=0.9,
    near_possible_m=0.522,
    near_certain_m=0.574,
    far_certain_m=1.433,
    far_possible_m=1.910,
    learns_field_of_view=True,
    occluder_radius_m=0.1,
    spacing_m=0.15,
)

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
        motion=ROBUST_MOTION,
        observation=ROBUST_OBSERVATION,
        accept_gate=9.21,
        spawn_gate=25.0,
        innovation_gate=100.0,
        tail_gate=5.991,
        relocate_after=5,
        min_seen=3,
        landmarks=ROBUST_LANDMARKS,
    ),
}
