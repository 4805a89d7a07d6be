"""The parameters of the smoother that runs along."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from slam.config import PRESETS, EkfConfig
from slam.smoothing.config import SmoothingConfig


@dataclass(frozen=True, kw_only=True)
class SmootherConfig(EkfConfig):
    """Those of the filter that runs ahead, and of the smoother that puts it right."""

    solve_every: int = field(default=10, metadata={"min": 1})
    """Scans after which everything is solved anew, at the soonest ..."""
    solve_growth: float = field(default=0.05, metadata={"min": 0.0})
    """... and by how much the number of scans must have grown since: what a solution costs grows
    with it, and so the whole costs this many times less than one over all: 1 / growth."""
    loss: str = field(default="cauchy", metadata={"choices": ("none", "huber", "cauchy")})
    """How an observation far off pulls: ever more (none), evenly (huber), ever less (cauchy)."""
    loss_scale: float = field(default=2.0, metadata={"min": 0.1})
    """From how many sigmas on (length of the two whitened residuals) the loss acts."""
    max_iterations: int = field(default=20, metadata={"min": 1})
    """Of one solution; the next goes on from there."""

    def smoothing(self) -> SmoothingConfig:
        """How a solution is found."""
        return SmoothingConfig(
            motion=self.motion,
            observation=self.observation,
            loss=self.loss,
            loss_scale=self.loss_scale,
            max_iterations=self.max_iterations,
        )


SMOOTHER_PRESETS = {
    "robust": SmootherConfig(
        **{f.name: getattr(PRESETS["robust"], f.name) for f in dataclasses.fields(EkfConfig)}
    ),
}
