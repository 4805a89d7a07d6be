"""What a campaign does, as its YAML file says it; every fault with its line, before any work."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from capture import ConfigurationError, Session, list_sessions, read_configuration
from dialogue import UsageError
from scoring import ScoreOptions

if TYPE_CHECKING:
    from slam.algorithms import Request

FORMAT = 1
MAPS = ("turn", "s-curve", "loop")
POWERS = ("low", "medium", "high")
VISUAL = "viso"
"""The source of odometry that is computed from the stereo film of the car."""


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """Sessions to be simulated: every map with every power, `trials` times.

    seed : of the whole; each session has its own, that follows from it and from its name.
    """

    maps: tuple[str, ...] = field(default=MAPS, metadata={"choices": MAPS})
    powers: tuple[str, ...] = field(default=POWERS, metadata={"choices": POWERS})
    trials: int = field(default=3, metadata={"min": 1, "max": 1000})
    seed: int = field(default=0, metadata={"min": 0})

    def __post_init__(self) -> None:
        for name, words in (("maps", self.maps), ("powers", self.powers)):
            if not words:
                raise ValueError(f"{name} is empty; name at least one")
            if len(set(words)) < len(words):
                raise ValueError(f"{name} names one twice")


@dataclass(frozen=True, kw_only=True)
class RunPlan:
    """One way to run SLAM, on every session; the words are those of `trackside slam`.

    name : of the estimate, by default `PRESET-ALGORITHM`; preset : a name, or a file that
    `trackside slam tune` wrote (beside the campaign file); settings : key -> value.
    """

    algorithm: str
    preset: str = "robust"
    name: str = ""
    odometry: str | None = None
    association: str | None = None
    settings: Mapping[str, object] = field(default_factory=dict)
    smooth: bool = False
    seed: int = field(default=0, metadata={"min": 0})

    def __post_init__(self) -> None:
        from slam.preset_file import is_preset_file

        if not self.name:
            object.__setattr__(self, "name", f"{Path(self.preset).stem}-{self.algorithm}")
        if not is_preset_file(self.preset):
            request = self.request()
            request.config(), request.cone_config(), request.source_config()

    def request(self) -> Request:
        """What `slam` shall do; of a preset that is a file only what stands beside it here."""
        from slam.algorithms import Request

        return Request(
            algorithm=self.algorithm,
            association=self.association,
            preset=self.preset,
            settings=self.words,
            odometry=self.odometry,
            seed=self.seed,
            smooth=self.smooth,
        )

    @property
    def words(self) -> tuple[str, ...]:
        """The settings as `--set` takes them."""
        from slam.preset_file import text_of

        return tuple(f"{key}={text_of(value)}" for key, value in self.settings.items())

    @property
    def group(self) -> str:
        """The preset by which runs are put side by side."""
        return Path(self.preset).stem

    @property
    def needs_film(self) -> bool:
        """Whether its odometry is computed from the stereo film."""
        return self.odometry is not None and VISUAL in self.odometry.split("+")


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """A whole experiment.

    output : folder, relative to where the command is called; simulate or sessions : one of them,
    `sessions` is a folder of recorded ones, relative to the file; baseline : the algorithm that
    others are compared with; resamples : of the bootstrap.
    """

    format: int = FORMAT
    title: str = "Campaign"
    output: Path | None = None
    simulate: Simulation | None = None
    sessions: Path | None = None
    runs: tuple[RunPlan, ...]
    scoring: ScoreOptions = field(default_factory=ScoreOptions)
    baseline: str | None = None
    resamples: int = field(default=10_000, metadata={"min": 100, "max": 1_000_000})
    report: str = "report.html"

    def __post_init__(self) -> None:
        if (self.simulate is None) == (self.sessions is None):
            raise ValueError("give either simulate (what to drive) or sessions (a folder)")
        if not self.runs:
            raise ValueError("runs is empty; give at least one with an algorithm")
        if self.scoring.space != "2d":
            raise ValueError("scoring.space: a session is planar; leave it out")
        if Path(self.report).name != self.report or not self.report.endswith(".html"):
            raise ValueError(f"report {self.report!r}: expected a name as report.html")
        twice = [
            name for name, count in Counter(run.name for run in self.runs).items() if count > 1
        ]
        if twice:
            raise ValueError(f"two runs are named {twice[0]!r}; give one of them another name")
        if self.baseline is not None and self.baseline not in self.labels.values():
            named = ", ".join(dict.fromkeys(self.labels.values()))
            raise ValueError(f"baseline {self.baseline!r} is no run; expected one of {named}")

    @property
    def labels(self) -> Mapping[str, str]:
        """Name of a run -> what the report calls it: the algorithm, where that is enough."""
        counts = Counter((run.group, run.algorithm) for run in self.runs)
        return {
            run.name: run.algorithm if counts[run.group, run.algorithm] == 1 else run.name
            for run in self.runs
        }

    @property
    def groups(self) -> Mapping[str, tuple[RunPlan, ...]]:
        """Preset -> its runs, in the order of the file."""
        names = dict.fromkeys(run.group for run in self.runs)
        return {name: tuple(run for run in self.runs if run.group == name) for name in names}


@dataclass(frozen=True)
class Drive:
    """One session of a campaign.

    name : of its folder and its log; map, power, trial : as `session.yaml` has them; seed : of
    the simulation, None for a recorded session, whose folder is `recorded`.
    """

    name: str
    map: str
    power: str
    trial: int | None
    seed: int | None = None
    recorded: Path | None = None

    @property
    def dataset(self) -> str:
        """Its name among those of its map, as in the thesis: `Low-1`."""
        if not self.power:
            return self.name
        return self.power.capitalize() + ("" if self.trial is None else f"-{self.trial}")


def read_campaign(file: Path) -> Campaign:
    """The campaign in a YAML file, its paths made whole.

    Raises `ConfigurationError` with one line `file:line:column: key: message` for every fault.
    """
    campaign = read_configuration(Campaign, file)
    if campaign.format > FORMAT:
        raise ConfigurationError(
            f"{file}: has format {campaign.format}; this trackside reads formats up to {FORMAT}; "
            "update trackside"
        )
    sessions = None if campaign.sessions is None else file.parent / campaign.sessions
    runs = tuple(_with_preset_file(run, file) for run in campaign.runs)
    output = campaign.output or Path(file.stem)
    return replace(campaign, sessions=sessions, runs=runs, output=output)


def drives_of(campaign: Campaign) -> tuple[Drive, ...]:
    """The sessions, map by map.

    Raises `SessionError` when the folder holds none, `UsageError` for two of one map, power and
    trial, which no table could tell apart.
    """
    if campaign.simulate is not None:
        return tuple(_simulated(campaign.simulate))
    assert campaign.sessions is not None
    drives = [_recorded(folder) for folder in list_sessions(campaign.sessions)]
    seen: dict[tuple[str, str], Drive] = {}
    for drive in drives:
        first = seen.setdefault((drive.map, drive.dataset), drive)
        if first is not drive:
            raise UsageError(
                f"{first.recorded} and {drive.recorded} are both {drive.map} {drive.dataset}; "
                "correct the trial in one session.yaml, or move one away"
            )
    return tuple(drives)


def seed_of(base: int, map_name: str, power: str, trial: int) -> int:
    """The seed of one session: it does not change when other sessions are added or left out."""
    text = f"{base} {map_name} {power} {trial}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big") >> 1


def _simulated(what: Simulation) -> list[Drive]:
    return [
        Drive(f"{name}_{power}_{k}", name, power, k, seed_of(what.seed, name, power, k))
        for name in what.maps
        for power in what.powers
        for k in range(1, what.trials + 1)
    ]


def _recorded(folder: Path) -> Drive:
    info = Session.open(folder).info
    place = folder.resolve()
    return Drive(place.name, info.map or "unnamed", info.power, info.trial, recorded=place)


def _with_preset_file(run: RunPlan, file: Path) -> RunPlan:
    """The run with its preset's file beside the campaign's, once that is known to be one."""
    from slam.preset_file import is_preset_file, read_preset_file

    if not is_preset_file(run.preset):
        return run
    found = file.parent / run.preset
    algorithm = read_preset_file(found).algorithm
    if algorithm != run.algorithm:
        raise ConfigurationError(
            f"{file}: runs: {run.name}: {found} is a preset of {algorithm}, not of {run.algorithm}"
        )
    return replace(run, preset=str(found.resolve()))
