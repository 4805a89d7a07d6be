"""A recording that is followed gives what it gives when it is finished."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from recording import END_S, START_NS, S, Streams, messages, write

from capture import Estimate, MissingStreamError, Session, SessionInfo
from capture.session_info import write_session_info
from capture.topics import LOG_NAME
from dialogue import UsageError
from slam.algorithms import Request, estimate_session
from slam.cli import slam
from slam.errors import SlamError
from slam.follow import Clock, Followed, follow_session
from slam.follow_display import Display
from slam.online import Position

TACHOMETER = ("odometry.metres_per_count=0.0002", "odometry.wheelbase_m=0.33")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return write(tmp_path_factory.mktemp("whole") / "run", messages())


def steps(size: int, seed: int) -> Iterator[int]:
    """Sizes of a growing file, in uneven steps that cut through records."""
    random, at = np.random.default_rng(seed), 0
    while at < size:
        at = min(size, at + int(random.choice([1, 7, 300, 9000, 40_000])))
        yield at


def followed(
    whole: Session, folder: Path, request: Request, seed: int = 0, cut: int | None = None
) -> Followed:
    """Follow the session while its log grows with every look; `cut` leaves the last bytes away."""
    folder.mkdir()
    write_session_info(folder, SessionInfo())
    content = (whole.folder / LOG_NAME).read_bytes()[:cut]
    sizes = steps(len(content), seed)
    now_s = [0.0]

    def sleep(period_s: float) -> None:
        now_s[0] += period_s
        size = next(sizes, None)
        if size is not None:
            (folder / LOG_NAME).write_bytes(content[:size])

    clock = Clock(lambda: START_NS + round(now_s[0] * S), lambda: now_s[0], sleep)
    return follow_session(Session.open(folder), request, "live", patience_s=3.0, clock=clock)


def bits(estimate: Estimate) -> list[bytes]:
    assert estimate.map is not None
    assert estimate.path_covariances is not None
    return [
        estimate.path.t_ns.tobytes(),
        estimate.path.poses.tobytes(),
        estimate.path_covariances.tobytes(),
        estimate.map.landmarks.positions.tobytes(),
    ]


@pytest.mark.parametrize(
    "request_",
    [
        Request(),
        Request(algorithm="fastslam", settings=("particles=50",), seed=4),
        Request(association="jcbb", preset="thesis", settings=("cones.max_range_m=1.8",)),
        Request(odometry="tachometer", settings=TACHOMETER),
    ],
    ids=["ekf", "fastslam", "jcbb", "tachometer"],
)
def test_followed_or_finished_makes_no_difference(
    finished: Session, tmp_path: Path, request_: Request
) -> None:
    """To the last bit, although the one saw the log in scraps and the other whole."""
    whole, report, _ = estimate_session(finished, request_)
    assert whole.map is not None
    assert len(whole.map) >= 5
    live = followed(finished, tmp_path / "run", request_)
    assert live.why == "the recording has ended"
    assert bits(live.estimate) == bits(whole)
    assert live.report.updates == report.updates
    assert live.report.scans == report.scans
    for key in ("algorithm", "association", "odometry", "config", "cones"):
        assert live.estimate.provenance[key] == whole.provenance[key]


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_with_the_gyro_only_rounding_and_the_bias_differ(tmp_path: Path, noise: float) -> None:
    """The car stands first, so that its bias is known before it turns, as it is afterwards."""
    session = write(tmp_path / "whole", messages(Streams(gyro_noise_rad_s=noise)))
    request = Request(odometry="imu+vesc")
    whole, _, notes = estimate_session(session, request)
    live = followed(session, tmp_path / "run", request)
    np.testing.assert_array_equal(live.estimate.path.t_ns, whole.path.t_ns)
    np.testing.assert_allclose(live.estimate.path.poses, whole.path.poses, atol=1e-9)
    assert live.notes[-1] == notes[-1]
    assert "gyro bias 0.5" in notes[-1]


def test_lidar_points_go_before_scans_and_both_tell_the_same(tmp_path: Path) -> None:
    found = {}
    for name, streams in (
        ("both", Streams()),
        ("points", Streams(scan=False)),
        ("scan", Streams(points=False)),
    ):
        session = write(tmp_path / name, messages(streams))
        found[name] = followed(session, tmp_path / f"{name}-live", Request()).estimate
        assert bits(found[name]) == bits(estimate_session(session, Request())[0])
    assert bits(found["both"]) == bits(found["points"])
    assert bits(found["both"]) != bits(found["scan"])
    np.testing.assert_allclose(
        found["both"].path.poses[-1], found["scan"].path.poses[-1], atol=1e-3
    )


def test_a_recording_that_stops_without_an_end_is_kept_up_to_there(
    finished: Session, tmp_path: Path
) -> None:
    live = followed(finished, tmp_path / "run", Request(), cut=-60_000)
    assert live.why == "nothing came for 3 s; is the recorder still running?"
    last_s = (int(live.estimate.path.t_ns[-1]) - START_NS) * 1e-9
    assert 3.0 < last_s < END_S - 0.5
    whole, _, _ = estimate_session(finished, Request())
    common = np.isin(whole.path.t_ns, live.estimate.path.t_ns[:-1])
    np.testing.assert_array_equal(whole.path.poses[common], live.estimate.path.poses[:-1])


def test_the_user_may_end_it(finished: Session, tmp_path: Path) -> None:
    looks = iter(range(10))

    def sleep(_: float) -> None:
        if next(looks) == 3:
            raise KeyboardInterrupt

    folder = tmp_path / "run"
    folder.mkdir()
    write_session_info(folder, SessionInfo())
    (folder / LOG_NAME).write_bytes((finished.folder / LOG_NAME).read_bytes()[:-60_000])
    clock = Clock(sleep=sleep)
    live = follow_session(Session.open(folder), Request(), "live", patience_s=60.0, clock=clock)
    assert live.why == "stopped by hand"
    assert live.report.scans > 20


def test_latency_is_measured_from_the_arrival_of_each_scan(
    finished: Session, tmp_path: Path
) -> None:
    """The clock stands at the first log time and moves with every look at the file."""
    told = followed(finished, tmp_path / "run", Request()).estimate.provenance["latency"]
    assert isinstance(told, dict)
    assert told["scans"] == 79
    assert set(told["update_s"]) == {"median", "p99", "max"}
    assert 0.0 < told["update_s"]["median"] <= told["update_s"]["p99"] <= told["update_s"]["max"]
    assert told["live_scans"] == 79
    assert set(told["age_s"]) == {"median", "p99", "max"}


def test_old_scans_have_no_age(finished: Session) -> None:
    done = follow_session(finished, Request(), "live", patience_s=0.0)
    told = done.estimate.provenance["latency"]
    assert isinstance(told, dict)
    assert (told["scans"], told["live_scans"], told["age_s"]) == (79, 0, None)


@pytest.mark.parametrize(
    ("missing", "message"),
    [
        (("/vesc/odom",), r"no odometry.*/lidar/points"),
        (("/lidar/points", "/scan"), r"no scans.*/vesc/odom"),
    ],
)
def test_what_is_missing_is_told_when_the_log_ends(
    tmp_path: Path, missing: tuple[str, ...], message: str
) -> None:
    content = [row for row in messages() if row[2] not in missing]
    with pytest.raises(MissingStreamError, match=message):
        follow_session(write(tmp_path / "run", content), Request(), "x", patience_s=0.0)


@pytest.mark.parametrize(("words", "told"), [("zed", "'zed'"), ("imu+wheel", r"'imu\+wheel'")])
def test_odometry_that_was_asked_for_and_never_came_is_told(
    finished: Session, words: str, told: str
) -> None:
    with pytest.raises(MissingStreamError, match=f"no odometry {told}.*/vesc/odom"):
        follow_session(finished, Request(odometry=words), "x", patience_s=0.0)


def test_scans_of_another_time_are_told(tmp_path: Path) -> None:
    content = [row for row in messages() if row[2] != "/vesc/odom" or row[0] < START_NS + S // 50]
    late = [row for row in content if row[2] != "/lidar/points" or row[0] > START_NS + S]
    session = write(tmp_path / "run", [row for row in late if row[2] != "/scan"])
    with pytest.raises(SlamError, match="none of the scans lies within the time of odometry"):
        follow_session(session, Request(), "x", patience_s=0.0)


def test_a_log_that_never_comes_is_told(tmp_path: Path) -> None:
    write_session_info(tmp_path, SessionInfo())
    clock = Clock(sleep=lambda _: None)
    with pytest.raises(MissingStreamError, match="is the recorder running"):
        follow_session(Session.open(tmp_path), Request(), "x", patience_s=0.0, clock=clock)


def test_a_source_that_begins_late_is_waited_for(tmp_path: Path) -> None:
    """In the first second of the log the streams are not chosen yet."""
    content = [row for row in messages() if row[2] != "/vesc/odom" or row[0] > START_NS + S // 2]
    content += [
        (t, s, "/zed/odom", kind, data)
        for t, s, topic, kind, data in messages()
        if topic == "/vesc/odom"
    ]
    session = write(tmp_path / "whole", sorted(content, key=lambda row: row[0]))
    live = followed(session, tmp_path / "run", Request())
    assert live.estimate.provenance["odometry"] == "vesc"
    assert bits(live.estimate) == bits(estimate_session(session, Request())[0])
    # The scans of the first half second came before the odometry.
    assert live.report.outside_odometry == 5


def test_smoothing_must_wait(finished: Session) -> None:
    with pytest.raises(UsageError, match="--smooth afterwards"):
        follow_session(finished, Request(smooth=True), "x", patience_s=0.0)


def test_the_command_runs_through_a_finished_session(tmp_path: Path) -> None:
    session = write(tmp_path / "run", messages())
    words = [str(session.folder), "--follow", "--name", "live"]
    done = CliRunner().invoke(slam, words)
    assert done.exit_code == 0, done.exception
    assert "the recording has ended" in done.output
    assert "7 landmarks  79 scans" in done.output
    assert "latency" in Session.open(session.folder).estimate("live").provenance
    again = CliRunner().invoke(slam, words)
    assert isinstance(again.exception, UsageError)


class _Screen:
    def __init__(self, *, terminal: bool) -> None:
        self.text, self._terminal = "", terminal

    def isatty(self) -> bool:
        return self._terminal

    def echo(self, message: str, *, nl: bool = True) -> None:
        self.text += message + "\n" * nl


@pytest.mark.parametrize("terminal", [True, False])
def test_the_display_renews_its_line_on_a_terminal_only(terminal: bool) -> None:
    screen, now_s = _Screen(terminal=terminal), iter(np.arange(0.0, 10.0, 0.5).tolist())
    clock: Callable[[], float] = lambda: next(now_s)  # noqa: E731
    pose = np.array([1.0, -2.0, np.pi / 2])
    with Display(screen.echo, screen, clock) as display:  # type: ignore[arg-type]  # a part of it
        display.show(None)
        for k in range(4):
            display.show(Position(0.5 * k, pose, 14, k, 1.5e-3, 0.25 if k else None))
    assert "x 1.00 m  y -2.00 m  heading 90 deg  14 landmarks" in screen.text
    assert "1.5 ms each  0.25 s behind" in screen.text
    assert screen.text.count("\n") == (1 if terminal else 3)
    assert screen.text.count("\r") == (5 if terminal else 0)
