"""The commands `trackside import`, `trackside export` and `trackside info`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dialogue import Cell, Table, UsageError
from dialogue.options import format_option

if TYPE_CHECKING:
    from capture.import_bag import BagImport
    from capture.log_reader import Topic
    from capture.session import Session
    from geometry import LandmarkMap, Trajectory

_PATH = click.Path(path_type=Path)
_OUT = click.option(
    "-o", "--output", "out", required=True, type=_PATH, help="What to make; must not exist."
)
_SESSION_OUT = click.option(
    "-o", "--output", "out", required=True, type=_PATH, help="The session to make; must not exist."
)
_SESSION = click.argument("session", type=_PATH)


@click.group("import")
def import_group() -> None:
    """Make a session from a data set, a bag or text files of others."""


@import_group.command("mrclam")
@click.argument("folder", type=_PATH)
@click.option("--robot", type=int, required=True, help="Which of the robots, 1 to 5.")
@_SESSION_OUT
def import_mrclam_command(folder: Path, robot: int, out: Path) -> None:
    """One robot of a UTIAS MRCLAM data set: odometry, sightings of landmarks, truth."""
    from capture.import_mrclam import import_mrclam

    counts = import_mrclam(folder, robot, out)
    click.echo(f"odometry /wheel/odom: {counts.odometry}")
    click.echo(f"observations /landmarks/observed: {counts.observations}")
    click.echo(f"ground truth: {counts.truth_poses} poses, {counts.landmarks} landmarks")
    click.echo(
        f"left out: {counts.robot_sightings} sightings of other robots, "
        f"{counts.unknown_barcodes} of unknown barcodes, {counts.repeated_odometry_stamps} "
        f"odometry lines and {counts.repeated_truth_stamps} truth lines with a repeated stamp"
    )
    _say_written(out, f"trackside slam {out}")


@import_group.command("bag")
@click.argument("bag", type=_PATH)
@_SESSION_OUT
@click.option(
    "--topic",
    "topics",
    multiple=True,
    metavar="ROLE=TOPIC",
    help="Take TOPIC as ROLE: scan, imu, vesc_state, drive, observations, truth, or the name of "
    "an odometry source. ROLE=none leaves the role out.",
)
def import_bag_command(bag: Path, out: Path, topics: tuple[str, ...]) -> None:
    """A ROS 1 bag, a ROS 2 bag folder, a .db3 or .mcap file."""
    from capture.import_bag import import_bag

    wishes = {}
    for assignment in topics:
        role, equals, topic = assignment.partition("=")
        if not (role and equals and topic):
            raise UsageError(f"--topic {assignment}: expected ROLE=TOPIC, such as scan=/scan")
        wishes[role] = topic
    report = import_bag(bag, out, wishes)
    click.echo(_import_table(report).render("table"))
    for remark in report.remarks:
        click.echo(f"remark: {remark}", err=True)
    roles = {topic.role for topic in report.taken}
    _say_written(out, f"trackside {'slam' if 'observations' in roles else 'info'} {out}")


@import_group.command("tum")
@click.option("--truth", type=_PATH, required=True, help="True path, TUM.")
@click.option("--cones", type=_PATH, help="True landmarks, CSV.")
@click.option("--path", type=_PATH, help="Estimated path, TUM.")
@click.option("--map", "estimated_map", type=_PATH, help="Estimated landmarks, CSV.")
@click.option("--name", default="imported", show_default=True, help="Name of the estimate.")
@_SESSION_OUT
def import_tum_command(
    truth: Path,
    cones: Path | None,
    path: Path | None,
    estimated_map: Path | None,
    name: str,
    out: Path,
) -> None:
    """Truth and, optionally, an estimate of any SLAM as text files."""
    from capture.import_tum import TumFiles, import_tum

    files = TumFiles(truth=truth, cones=cones, path=path, map=estimated_map, name=name)
    counts = import_tum(files, out)
    click.echo(_counted("ground truth", counts.truth_poses, counts.landmarks))
    if counts.dropped_truth_poses:
        click.echo(f"left out: {counts.dropped_truth_poses} true poses that are not finite")
    if counts.estimate_poses is not None:
        click.echo(_counted(f"estimate {name}", counts.estimate_poses, counts.estimated_landmarks))
    if counts.dropped_estimate_poses:
        click.echo(f"left out: {counts.dropped_estimate_poses} estimated poses not finite")
    _say_written(out, f"trackside score {out}" if path else f"trackside info {out}")


@click.group("export")
def export_group() -> None:
    """Write a session in a format of others."""


@export_group.command("tum")
@_SESSION
@_OUT
def export_tum_command(session: Path, out: Path) -> None:
    """Truth, estimates and odometry as TUM trajectories, into a folder."""
    from capture.export_text import export_tum
    from capture.session import Session

    _say_files(out, export_tum(Session.open(session), out))


@export_group.command("csv")
@_SESSION
@_OUT
def export_csv_command(session: Path, out: Path) -> None:
    """Every stream, path and map as CSV, into a folder."""
    from capture.export_text import export_csv
    from capture.session import Session

    _say_files(out, export_csv(Session.open(session), out))


@export_group.command("rosbag2")
@_SESSION
@_OUT
def export_rosbag2_command(session: Path, out: Path) -> None:
    """Every message as a ROS 2 bag folder (.db3)."""
    from capture.export_bag import export_rosbag2
    from capture.session import Session

    counts = export_rosbag2(Session.open(session), out)
    _say_topics(out, counts, f"ros2 bag play {out}")


@export_group.command("rosbag1")
@_SESSION
@_OUT
def export_rosbag1_command(session: Path, out: Path) -> None:
    """Every message as a ROS 1 bag file."""
    from capture.export_bag import export_rosbag1
    from capture.session import Session

    counts = export_rosbag1(Session.open(session), out)
    _say_topics(out, counts, f"rosbag play {out}")


@click.command("info")
@_SESSION
@format_option()
def info(session: Path, table_format: str) -> None:
    """What a session holds: streams, counts, rates, truth, estimates."""
    from capture.session import Session

    opened = Session.open(session)
    click.echo(_info_table(opened).render(table_format))
    for remark in opened.remarks:
        click.echo(f"remark: {remark}", err=True)


def _info_table(session: Session) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (topic.name, topic.type_name, topic.count, topic.rate_hz, _span_s(topic))
        for topic in session.topics
    ]
    paths: dict[str, tuple[Trajectory, LandmarkMap | None]] = {}
    if session.has_ground_truth:
        truth = session.ground_truth()
        paths["ground_truth"] = (truth.path, truth.landmarks)
    for name in session.estimates:
        estimate = session.estimate(name)
        paths[f"estimates/{name}"] = (
            estimate.path,
            estimate.map.landmarks if estimate.map is not None else None,
        )
    for name, (path, landmarks) in paths.items():
        rows.append((name, "path", len(path), path.rate_hz, path.duration_s))
        if landmarks is not None:
            rows.append((name, "landmarks", len(landmarks), None, None))
    columns = ("stream", "type", "count", "rate [Hz]", "duration [s]")
    facts = [session.info.map, session.info.start_utc, session.info.verdict or ""]
    return Table(columns, tuple(rows), " ".join([session.name, *filter(None, facts)]), digits=1)


def _span_s(topic: Topic) -> float:
    return (topic.last_ns - topic.first_ns) * 1e-9


def _import_table(report: BagImport) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (topic.topic, topic.role, topic.target, topic.count, topic.rate_hz)
        for topic in report.taken
    ]
    rows += [(t.name, f"left out ({t.type_name})", "", t.count, None) for t in report.left_out]
    columns = ("topic", "role", "in the session", "count", "rate [Hz]")
    return Table(columns, tuple(rows), digits=1)


def _counted(what: str, poses: int, landmarks: int | None) -> str:
    return f"{what}: {poses} poses" + ("" if landmarks is None else f", {landmarks} landmarks")


def _say_files(folder: Path, names: tuple[str, ...]) -> None:
    for name in names:
        click.echo(f"wrote {folder / name}")


def _say_topics(out: Path, counts: dict[str, int], next_command: str) -> None:
    for topic, count in counts.items():
        click.echo(f"{topic}: {count}")
    _say_written(out, next_command)


def _say_written(out: Path, next_command: str) -> None:
    click.echo(f"wrote {out}")
    click.echo(f"next: {next_command}")
