"""The algorithms by name: from the words of a command to an estimate of a session."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from capture import Estimate, Observations, Odometry, Session, with_overrides
from dialogue import Progress, UsageError, nearest_names
from slam.cones.config import cone_config
from slam.config import PRESETS
from slam.ekf import ASSOCIATIONS, EkfSlam
from slam.fastslam.config import FASTSLAM_PRESETS
from slam.fastslam.filter import FASTSLAM_ASSOCIATIONS, FastSlam
from slam.interface import Slam
from slam.run import RunReport, run_slam
from slam.smoothing.config import SmoothingConfig, UnnamedConfig
from slam.sources import odometry_of

CONES = "cones."
"""Settings that begin so are those of the cone finder."""


@dataclass(frozen=True)
class Algorithm:
    """How an algorithm is configured and made.

    presets : by name, frozen dataclasses with at least `motion`, `observation`, `accept_gate`,
    `spawn_gate` and `path_period_s`; make : from configuration, association and seed.
    """

    presets: Mapping[str, Any]
    associations: tuple[str, ...]
    make: Callable[[Any, str, int], Slam]


ALGORITHMS = {
    "ekf": Algorithm(PRESETS, ASSOCIATIONS, lambda config, words, _: EkfSlam(config, words)),
    "fastslam": Algorithm(FASTSLAM_PRESETS, FASTSLAM_ASSOCIATIONS, FastSlam),
}
"""Add yours here: one class with the members of `slam.interface.Slam`, one line."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """What shall be run on a session.

    association : None takes known ids where the sensor names its landmarks, else the algorithm's
    first other rule; seed : for algorithms that draw random numbers.
    """

    algorithm: str = "ekf"
    association: str | None = None
    preset: str = "robust"
    settings: tuple[str, ...] = ()
    odometry: str | None = None
    seed: int = 0
    smooth: bool = False

    def __post_init__(self) -> None:
        _one_of("--algorithm", self.algorithm, ALGORITHMS)
        chosen = ALGORITHMS[self.algorithm]
        _one_of("--preset", self.preset, chosen.presets)
        if self.association is not None:
            _one_of("--association", self.association, chosen.associations)

    def config(self) -> Any:
        """The preset with the settings on top; raises `UsageError` for names or values."""
        own = [text for text in self.settings if not text.startswith(CONES)]
        config = with_overrides(ALGORITHMS[self.algorithm].presets[self.preset], own)
        if 0.0 < config.spawn_gate < config.accept_gate < np.inf:
            raise UsageError(
                f"spawn_gate {config.spawn_gate} is below accept_gate {config.accept_gate}: an "
                "observation would be old and new at once; raise spawn_gate"
            )
        return config


def estimate_session(
    session: Session, request: Request, name: str | None = None
) -> tuple[Estimate, RunReport, list[str]]:
    """The estimate that the request makes of a session, what happened, and notes for a person.

    Nothing is written. Observations are those of the session or, where it has lidar scans only,
    the cones found in them. Shows its progress.
    """
    config = request.config()
    driven, source = odometry_of(session, request.odometry)
    observations, provenance, notes = _observations(session, driven, request)
    association = _association(session, observations, request)
    provenance = {
        **{key: value for key, value in asdict(request).items() if key != "settings"},
        "association": association,
        "odometry": driven.source,
        "config": asdict(config),
        **provenance,
    }
    make = ALGORITHMS[request.algorithm].make
    _compile(make(config, association, request.seed))
    with Progress(request.algorithm, observations.batch_starts.size - 1) as progress:
        estimate, report = run_slam(
            make(config, association, request.seed),
            driven,
            observations,
            name=name or request.algorithm,
            path_period_s=config.path_period_s,
            provenance=provenance,
            advance=progress.advance,
        )
    if source.gyro_bias_rad_s is not None or source.source_gaps:
        notes.append(str(source))
    if request.smooth:
        known = ALGORITHMS[request.algorithm].associations[0]
        named = association == known
        estimate = _smoothed(estimate, driven, observations, config, named)
    return estimate, report, notes


def _association(session: Session, observations: Observations, request: Request) -> str:
    """The rule in force; raises `UsageError` where it asks for names that nobody gave."""
    named = bool(np.any(observations.landmark_id >= 0))
    known, *others = ALGORITHMS[request.algorithm].associations
    chosen = request.association or (known if named else others[0])
    if chosen == known and not named:
        raise UsageError(
            f"{session.folder}: its observations do not name their landmarks, --association known "
            f"cannot be; use {' or '.join(others)}"
        )
    return chosen


def _observations(
    session: Session, driven: Odometry, request: Request
) -> tuple[Observations, dict[str, object], list[str]]:
    """Observations, how they were made, and what to tell of it."""
    if session.has_observations or not session.has_scans:
        return session.observations(), {}, []
    from slam.cones.detection import observations_from_scans

    own = [text.removeprefix(CONES) for text in request.settings if text.startswith(CONES)]
    cones = cone_config(request.preset, own)
    observations, report = observations_from_scans(session.scans(), driven, cones)
    return observations, {"cones": asdict(cones)}, report.text().splitlines()


def _smoothed(
    estimate: Estimate, driven: Odometry, observations: Observations, config: Any, named: bool
) -> Estimate:
    """The final pass, which finds out whose sightings are whose where nobody named them."""
    from slam.smoothing.smoother import smooth
    from slam.smoothing.unnamed import smooth_unnamed

    noise = replace(SmoothingConfig(), motion=config.motion, observation=config.observation)
    if not named:
        unnamed = replace(UnnamedConfig(), smoothing=noise)
        return smooth_unnamed(estimate, driven, observations, unnamed)
    assert estimate.map is not None
    ids = observations.landmark_id
    mapped = np.isin(ids, estimate.map.landmarks.ids)
    return smooth(estimate, driven, observations, np.where(mapped, ids, -1), noise)


def _one_of(flag: str, word: str, valid: Sequence[str] | Mapping[str, object]) -> None:
    if word not in valid:
        raise UsageError(f"{flag} {word}: {nearest_names(word, valid)}")


def _compile(slam: Slam) -> None:
    """Compile every kernel, so that a first run's rate and times are those of the filter."""
    slam.predict(np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))
    for t_ns in range(2):
        slam.update(t_ns, np.array([1]), np.array([2.0]), np.array([0.0]))
    slam.estimated_map()
