"""The algorithms by name, so that a command or a sweep can make one from words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from capture import Estimate, Session, with_overrides
from dialogue import Progress, UsageError, nearest_names
from slam.config import PRESETS, EkfConfig
from slam.ekf import ASSOCIATIONS, EkfSlam
from slam.run import RunReport, run_slam

ALGORITHMS = ("ekf",)


def effective_config(preset: str, overrides: Sequence[str]) -> EkfConfig:
    """The preset with `key=value` settings on top; raises `UsageError` for names or values."""
    if preset not in PRESETS:
        raise UsageError(f"--preset {preset}: no such preset; {nearest_names(preset, PRESETS)}")
    config = with_overrides(PRESETS[preset], overrides)
    if config.spawn_gate < config.accept_gate:
        raise UsageError(
            f"spawn_gate {config.spawn_gate} is below accept_gate {config.accept_gate}: an "
            "observation would be old and new at once; raise spawn_gate"
        )
    return config


def estimate_session(
    session: Session,
    *,
    algorithm: str = "ekf",
    association: str = "known",
    preset: str = "robust",
    overrides: Sequence[str] = (),
    odometry: str | None = None,
    name: str | None = None,
) -> tuple[Estimate, RunReport]:
    """Run one algorithm over a session; nothing is written. Shows its progress."""
    if algorithm not in ALGORITHMS:
        raise UsageError(f"--algorithm {algorithm}: {nearest_names(algorithm, ALGORITHMS)}")
    if association not in ASSOCIATIONS:
        raise UsageError(f"--association {association}: {nearest_names(association, ASSOCIATIONS)}")
    config = effective_config(preset, overrides)
    driven, observations = session.odometry(odometry), session.observations()
    provenance = {
        "algorithm": algorithm,
        "association": association,
        "preset": preset,
        "odometry": driven.source,
        "config": asdict(config),
    }
    _compile(config, association)
    with Progress(algorithm, observations.batch_starts.size - 1) as progress:
        return run_slam(
            EkfSlam(config, association),
            driven,
            observations,
            name=name or algorithm,
            path_period_s=config.path_period_s,
            provenance=provenance,
            advance=progress.advance,
        )


def _compile(config: EkfConfig, association: str) -> None:
    """Compile every kernel, so that a first run's rate and times are those of the filter."""
    slam = EkfSlam(config, association)
    slam.predict(np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))
    for t_ns in range(2):
        slam.update(t_ns, np.array([1]), np.array([2.0]), np.array([0.0]))
