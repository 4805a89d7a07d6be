"""The algorithms by name: from the words of a command to an estimate of a session."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from io import StringIO
from pathlib import Path

import numpy as np

from capture import Estimate, Observations, Odometry, Session, with_overrides
from dialogue import Progress, UsageError, nearest_names
from slam.catalogue import ALGORITHMS
from slam.cones.config import ConeConfig, cone_config
from slam.interface import Configuration, Slam
from slam.run import RunReport, run_slam
from slam.smoothing.config import SmoothingConfig, UnnamedConfig
from slam.sources import IMU_PREFIX, TACHOMETER, SourceConfig, odometry_of

CONES, ODOMETRY = "cones.", "odometry."
"""Settings that begin so are those of the cone finder and of the source of odometry."""


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

    def config(self) -> Configuration:
        """The preset with the settings on top; raises `UsageError` for names or values."""
        own = [text for text in self.settings if not text.startswith((CONES, ODOMETRY))]
        preset: Configuration = ALGORITHMS[self.algorithm].presets[self.preset]
        config = with_overrides(preset, own)
        if 0.0 < config.spawn_gate < config.accept_gate < np.inf:
            raise UsageError(
                f"spawn_gate {config.spawn_gate} is below accept_gate {config.accept_gate}: an "
                "observation would be old and new at once; raise spawn_gate"
            )
        return config

    def cone_config(self) -> ConeConfig:
        """Of the cone finder; raises `UsageError` for names or values."""
        return cone_config(self.preset, self._settings_of(CONES))

    def source_config(self) -> SourceConfig:
        """Of the odometry; raises `UsageError` for names or values."""
        return with_overrides(SourceConfig(), self._settings_of(ODOMETRY))

    def association_for(self, folder: Path, *, named: bool) -> str:
        """The rule in force where observations are `named` or not.

        Raises `UsageError` where it asks for names that nobody gave.
        """
        known, *others = ALGORITHMS[self.algorithm].associations
        chosen = self.association or (known if named else [*others, known][0])
        if chosen == known and not named:
            raise UsageError(
                f"{folder}: its observations do not name their landmarks, --association known "
                f"cannot be; use {' or '.join(others) or 'another algorithm'}"
            )
        return chosen

    def made(self, association: str) -> Slam:
        """A new filter, its kernels compiled, so that rates and times are those of the filter."""
        make, config = ALGORITHMS[self.algorithm].make, self.config()
        _compile(make(config, association, self.seed))
        return make(config, association, self.seed)

    def provenance(self, association: str, source: str, *, cones: bool) -> dict[str, object]:
        """Every choice that makes the estimate, as it is stored with it."""
        choices = {key: value for key, value in asdict(self).items() if key != "settings"}
        made = {"association": association, "odometry": source, "config": asdict(self.config())}
        if plugin := ALGORITHMS.distribution(self.algorithm):
            made["distribution"] = plugin
        if cones:
            made["cones"] = asdict(self.cone_config())
        own = self._settings_of(ODOMETRY)
        if own or source.startswith((IMU_PREFIX, TACHOMETER)):
            made["source"] = asdict(self.source_config())
        return {**choices, **made}

    def _settings_of(self, part: str) -> list[str]:
        return [text.removeprefix(part) for text in self.settings if text.startswith(part)]


def estimate_session(
    session: Session, request: Request, name: str | None = None, *, quiet: bool = False
) -> tuple[Estimate, RunReport, list[str]]:
    """The estimate that the request makes of a session, what happened, and notes for a person.

    Nothing is written. Observations are those of the session or, where it has lidar scans only,
    the cones found in them. Shows its progress unless `quiet`.
    """
    config = request.config()
    driven, source = odometry_of(session, request.odometry, request.source_config())
    from_scans = session.has_scans and not session.has_observations
    observations, notes = _observations(session, driven, request, from_scans=from_scans)
    named = bool(np.any(observations.landmark_id >= 0))
    association = request.association_for(session.folder, named=named)
    slam = request.made(association)
    scans = observations.batch_starts.size - 1
    with Progress(request.algorithm, scans, stream=StringIO() if quiet else None) as progress:
        estimate, report = run_slam(
            slam,
            driven,
            observations,
            name=name or request.algorithm,
            path_period_s=config.path_period_s,
            provenance=request.provenance(association, driven.source, cones=from_scans),
            advance=progress.advance,
        )
    if source.remarkable:
        notes.append(str(source))
    if request.smooth:
        known = ALGORITHMS[request.algorithm].associations[0]
        named = association == known
        estimate = _smoothed(estimate, driven, observations, config, named)
    return estimate, report, notes


def _observations(
    session: Session, driven: Odometry, request: Request, *, from_scans: bool
) -> tuple[Observations, list[str]]:
    """Observations, and what to tell of how they were made."""
    if not from_scans:
        return session.observations(), []
    from slam.cones.detection import observations_from_scans

    observations, report = observations_from_scans(session.scans(), driven, request.cone_config())
    return observations, report.text().splitlines()


def _smoothed(
    estimate: Estimate,
    driven: Odometry,
    observations: Observations,
    config: Configuration,
    named: bool,
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


def _one_of(flag: str, word: str, valid: Iterable[str]) -> None:
    names = list(valid)
    if word not in names:
        raise UsageError(f"{flag} {word}: {nearest_names(word, names)}")


def _compile(slam: Slam) -> None:
    """Compile every kernel, so that a first run's rate and times are those of the filter."""
    slam.predict(np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))
    for t_ns in range(2):
        slam.update(t_ns, np.array([1]), np.array([2.0]), np.array([0.0]))
    slam.estimated_map()
