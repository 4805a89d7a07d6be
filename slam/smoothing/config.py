"""The parameters of the smoother, with names and without."""

from __future__ import annotations

from dataclasses import dataclass, field

from slam.config import PRESETS, MotionNoise, ObservationNoise


@dataclass(frozen=True, kw_only=True)
class SmoothingConfig:
    """Everything that decides what `slam.smoothing.smooth` makes of a filter's result.

    The noise is that of the preset `robust` unless told otherwise.
    """

    motion: MotionNoise = PRESETS["robust"].motion
    observation: ObservationNoise = PRESETS["robust"].observation
    loss: str = field(default="cauchy", metadata={"choices": ("none", "huber", "cauchy")})
    """How an observation far off pulls: ever more (none), evenly (huber), ever less (cauchy)."""
    loss_scale: float = field(default=2.0, metadata={"min": 0.1})
    """From how many sigmas on (length of the two whitened residuals) the loss acts."""
    max_iterations: int = field(default=100, metadata={"min": 1})
    tolerance: float = field(default=1e-4, metadata={"min": 0.0})
    """Done when a step moves no unknown further than this, in metres and radians."""


@dataclass(frozen=True, kw_only=True)
class UnnamedConfig:
    """Everything that decides whose sightings are whose when nobody named them."""

    smoothing: SmoothingConfig = SmoothingConfig()
    clutter_density_per_m_rad: float = field(default=0.05, metadata={"min": 1e-12})
    """False sightings of one scan per metre of range and radian of bearing."""
    tail_scales: tuple[float, ...] = (8.0, 6.0, 4.0, 3.0, 2.0, 2.0, 2.0)
    """Sigmas from which on a sighting's tails are heavy, round by round: at first the path is off
    by much more than the sensor. The last is the `loss_scale` of the smoothing."""
    birth_rounds: int = field(default=5, metadata={"min": 0})
    """In so many of the first rounds what is left over may be new landmarks."""
    least_sightings: int = field(default=6, metadata={"min": 1})
    """A landmark has at least so many."""
    tie_reach_m: float = field(default=2.0, metadata={"min": 0.0})
    """How far apart the path's error may have put two copies of one landmark."""
    tie_tolerance_m: float = field(default=0.2, metadata={"min": 0.0})
    """How well two copies of a part of the map must agree after one shift."""
    together_share: float = field(default=0.03, metadata={"min": 0.0, "max": 1.0})
    """Landmarks seen together in more than this share of their scans are two."""
    tries: int = field(default=12, metadata={"min": 0})
    """Shifts tried before the map is taken to be right."""
    rounds: int = field(default=12, metadata={"min": 0})
    """Most shifts that are made one after the other."""
    least_gain: float = field(default=2.0, metadata={"min": 0.0})
    """Log-likelihood that a shift must gain to be made."""
