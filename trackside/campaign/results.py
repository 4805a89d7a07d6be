"""What a campaign found: its runs by preset, the scenes that are drawn, how it was made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from capture import Estimate, Session, configuration_from_mapping, software
from dialogue import Table
from geometry import Floats, Trajectory, between, compose
from scoring import Score, score
from scoring.comparison import COLUMNS, Bootstrap, Comparison, Run, Runs, compare, read_runs
from scoring.report import CampaignReport, Panel, Part, Scene
from trackside.campaign.plan import Campaign, Drive, RunPlan
from trackside.campaign.work import Done, SessionJob
from trackside.fingerprints import files_digest, rooms_digest, told_libraries, values_digest
from trackside.workers import Failure

SHOWN_DATASET = "Low-1"
"""What the thesis draws of each map."""

_ROOMS = ("dialogue", "geometry", "capture", "slam", "scoring", "trackside")

Outcomes = Mapping[str, Done | Failure]
"""Name of a session -> what became of it."""


@dataclass(frozen=True)
class Found:
    """A campaign whose work is done, as far as it could be.

    failures : (session, task and why).
    """

    campaign: Campaign
    jobs: tuple[SessionJob, ...]
    outcomes: Outcomes

    @property
    def failures(self) -> tuple[tuple[str, str], ...]:
        """Every session that is not whole, with what failed there and why."""
        lines = []
        for job in self.jobs:
            outcome = self.outcomes[job.name]
            if isinstance(outcome, Failure):
                lines.append((job.name, outcome.why))
            else:
                lines += [(job.name, f"{task}: {why}") for task, why in outcome.failed.items()]
        return tuple(lines)

    def has(self, job: SessionJob, run: RunPlan) -> bool:
        """Whether a session has the score of a run, by the inputs of now."""
        outcome, task = self.outcomes[job.name], f"score {run.name}"
        return isinstance(outcome, Done) and task in (*outcome.made, *outcome.kept)


def comparisons(found: Found) -> dict[str, Comparison]:
    """Preset -> its algorithms side by side; presets of which nothing came are left out."""
    campaign = found.campaign
    how = Bootstrap(resamples=campaign.resamples)
    made = {}
    for name, plans in campaign.groups.items():
        runs = [_run(found, job, plan) for job in found.jobs for plan in plans]
        if all(run.missing for run in runs):
            continue
        known = {run.algorithm for run in runs if not run.missing}
        baseline = campaign.baseline if campaign.baseline in known else None
        made[name] = compare(Runs(tuple(runs)), baseline=baseline, how=how)
    return made


def report_of(
    found: Found, compared: Mapping[str, Comparison], file_name: str, definition: str
) -> CampaignReport:
    """Everything that the page tells; scenes are scored again, which gives the same."""
    groups = found.campaign.groups
    return CampaignReport(
        title=found.campaign.title,
        parts={name: Part(c, _scenes(found, groups[name])) for name, c in compared.items()},
        facts=_facts(found, file_name),
        drives=_drives(found),
        failures=found.failures,
        definition=definition,
    )


def report_key(found: Found, definition: str) -> str:
    """A digest of everything that decides the page."""
    files = [
        file
        for job in found.jobs
        for run in found.campaign.runs
        if found.has(job, run)
        for file in (
            job.place.session / "scores" / f"{run.name}.json",
            job.place.session / "estimates" / run.name / "path.tum",
        )
    ]
    return values_digest(
        {
            "definition": definition,
            "campaign": asdict(found.campaign),
            "files": files_digest(files),
            "failures": found.failures,
            "code": rooms_digest(_ROOMS),
            "libraries": told_libraries(),
        }
    )


def _run(found: Found, job: SessionJob, plan: RunPlan) -> Run:
    """The run as the plan names it; one without a score is missing."""
    drive, label = job.place.drive, found.campaign.labels[plan.name]
    file = job.place.session / "scores" / f"{plan.name}.json"
    power, _, trial = drive.dataset.partition("-") if drive.power else (drive.dataset, "", "")
    names = (drive.map, power, trial, label)
    if not found.has(job, plan):
        return Run(*names, dict.fromkeys(COLUMNS), file)
    (run,) = read_runs([file]).runs
    return replace(run, map=drive.map, power=power, trial=trial, algorithm=label)


def _scenes(found: Found, plans: Sequence[RunPlan]) -> tuple[Scene, ...]:
    scenes = []
    for name in dict.fromkeys(job.place.drive.map for job in found.jobs):
        own = [job for job in found.jobs if job.place.drive.map == name]
        own.sort(key=lambda job: job.place.drive.dataset != SHOWN_DATASET)
        whole = [job for job in own if all(found.has(job, plan) for plan in plans)]
        if whole:
            session = Session.open(whole[0].place.session)
            panels = tuple(_panel(found.campaign, session, plan) for plan in plans)
            scenes.append(Scene(name, whole[0].place.drive.dataset, panels))
    return tuple(scenes)


def _panel(campaign: Campaign, session: Session, plan: RunPlan) -> Panel:
    estimate = session.estimate(plan.name)
    found = score(session.ground_truth(), estimate, campaign.scoring)
    placed = estimate.path.transformed(_pose_world_map(found))
    odometry = _odometry(session, estimate, placed.poses[0])
    return Panel(campaign.labels[plan.name], found, placed.poses[-1], odometry)


def _pose_world_map(found: Score) -> Floats:
    at = found.alignment
    return np.array([at.x, at.y, at.heading or 0.0])


def _odometry(session: Session, estimate: Estimate, start: Floats) -> Floats:
    """(n, 3): the odometry that an estimate was made with, from where and when it starts."""
    from slam.sources import SourceConfig, odometry_of

    source, config = estimate.provenance.get("odometry"), estimate.provenance.get("source")
    made = SourceConfig()
    if isinstance(config, Mapping):
        made = configuration_from_mapping(SourceConfig, config, f"{session.folder}/{estimate.name}")
    driven, _ = odometry_of(session, source if isinstance(source, str) else None, made)
    path = Trajectory.from_poses(driven.t_ns, driven.pose_odom_base)
    begin, end = (int(t) for t in estimate.path.t_ns[[0, -1]])
    begin = int(np.clip(begin, driven.t_ns[0], driven.t_ns[-1]))
    first = path.interpolated(np.array([begin])).poses[0]
    during = (driven.t_ns >= begin) & (driven.t_ns <= end)
    return compose(start, between(first, path.poses[during]))


def _facts(found: Found, file_name: str) -> tuple[tuple[str, str], ...]:
    campaign = found.campaign
    made = "recorded"
    if campaign.simulate is not None:
        what = campaign.simulate
        made = (
            f"simulated: {', '.join(what.maps)}; {', '.join(what.powers)}; {what.trials} trials; "
            f"seed {what.seed}"
        )
    options = ", ".join(f"{name} {value}" for name, value in campaign.scoring.choices().items())
    return (
        ("campaign file", file_name),
        ("sessions", made),
        ("newest session", _newest(found.jobs)),
        *((f"run {run.name}", _told(run)) for run in campaign.runs),
        ("scoring", options),
        ("software", f"{software()}, {told_libraries()}"),
        ("again", f"trackside campaign {file_name}"),
    )


def _told(run: RunPlan) -> str:
    words = [run.algorithm, f"preset {Path(run.preset).name}"]
    words += [f"odometry {run.odometry}"] if run.odometry else []
    words += [f"association {run.association}"] if run.association else []
    words += ["smoothed"] if run.smooth else []
    return ", ".join([*words, f"seed {run.seed}", *run.words])


def _newest(jobs: Sequence[SessionJob]) -> str:
    """When the newest session was recorded: the page has no other date."""
    starts = [
        Session.open(job.place.session).info.start_utc
        for job in jobs
        if (job.place.session / "session.yaml").exists()
    ]
    return max((start for start in starts if start), default="no session says")


def _drives(found: Found) -> Table:
    rows = []
    for job in found.jobs:
        drive: Drive = job.place.drive
        scored = sum(found.has(job, run) for run in found.campaign.runs)
        rows.append((drive.name, drive.map, drive.dataset, drive.seed, scored))
    return Table(
        ("session", "map", "data set", "seed", "runs scored"), tuple(rows), title="The sessions"
    )
