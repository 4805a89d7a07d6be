"""The parameters of the smoother."""

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
