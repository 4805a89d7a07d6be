"""`trackside slam` through the real command, on a small session made here."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from capture import Observations, Odometry, Session, SessionInfo
from dialogue import TracksideError, UsageError
from slam.algorithms import Request
from slam.cli import slam

S = 1_000_000_000


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """A straight drive of a second past two landmarks."""
    t_ns = S + np.arange(11) * S // 10
    poses = np.stack([np.arange(11) * 0.1, np.zeros(11), np.zeros(11)], axis=1)
    odometry = Odometry("wheel", t_ns, poses, np.ones(11), np.zeros(11))
    at, ids = np.repeat(t_ns, 2), np.tile([6, 7], 11)
    offset = (
        np.array([[2.0, 1.0], [2.0, -1.0]])[np.tile([0, 1], 11)] - np.repeat(poses, 2, 0)[:, :2]
    )
    ranges, bearings = np.hypot(*offset.T), np.arctan2(offset[:, 1], offset[:, 0])
    folder = tmp_path / "run"
    with Session.create(folder, SessionInfo()) as writer:
        writer.add_odometry(odometry)
        writer.add_observations(Observations(at, ids, ranges, bearings))
    return folder


def run(*words: object) -> Result:
    return CliRunner().invoke(slam, [str(word) for word in words], catch_exceptions=True)


def test_the_estimate_is_kept_with_every_choice_that_made_it(session: Path) -> None:
    done = run(session, "--set", "observation.range_sigma_m=0.2", "--name", "mine")
    assert done.exit_code == 0, done.output
    assert "2 landmarks" in done.output
    assert f"next: trackside score {session}" in done.output
    estimate = Session.open(session).estimate("mine")
    assert estimate.map is not None
    assert estimate.map.landmarks.ids.tolist() == [6, 7]
    np.testing.assert_allclose(estimate.map.landmarks.positions, [[2, 1], [2, -1]], atol=1e-6)
    assert estimate.path_covariances is not None
    provenance = estimate.provenance
    assert provenance["algorithm"] == "ekf"
    assert provenance["preset"] == "robust"
    config = provenance["config"]
    assert isinstance(config, dict)
    assert config["observation"]["range_sigma_m"] == 0.2
    assert config["innovation_gate"] == 100.0


def test_unlimited_gates_survive_the_file(session: Path) -> None:
    run(session, "--preset", "thesis", "--name", "as_printed")
    config = Session.open(session).estimate("as_printed").provenance["config"]
    assert isinstance(config, dict)
    assert config["tail_gate"] == float("inf")


def test_nothing_is_overwritten_unless_asked(session: Path) -> None:
    assert run(session).exit_code == 0
    refused = run(session)
    assert isinstance(refused.exception, UsageError)
    assert "--name or --replace" in str(refused.exception)
    assert run(session, "--replace", "--preset", "thesis").exit_code == 0
    assert Session.open(session).estimate("ekf").provenance["preset"] == "thesis"


def test_running_twice_gives_the_same_files(session: Path) -> None:
    for name in ("one", "two"):
        assert run(session, "--name", name).exit_code == 0
    for file in ("path.tum", "map.csv", "path_covariance.csv"):
        one, two = (session / "estimates" / name / file for name in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "observation.range_sigmam=1"), r"range_sigma_m"),
        (("--set", "accept_gate=-1"), r"accept_gate"),
        (("--set", "spawn_gate=1"), r"below accept_gate"),
        (("--algorithm", "efk"), r"ekf"),
        (("--odometry", "vesc"), r"/vesc/odom.*/wheel/odom"),
    ],
)
def test_a_wrong_word_is_refused_with_what_would_be_right(
    session: Path, words: tuple[str, ...], message: str
) -> None:
    refused = run(session, *words)
    assert isinstance(refused.exception, TracksideError)
    assert re.search(message, str(refused.exception)), refused.exception
    assert Session.open(session).estimates == ()


def test_words_are_checked_before_any_work() -> None:
    with pytest.raises(UsageError, match="robust"):
        Request(preset="robus")
    with pytest.raises(UsageError, match="nearest"):
        Request(association="nearby")


def test_with_nearest_association_landmarks_are_numbered(session: Path) -> None:
    assert run(session, "--association", "nearest").exit_code == 0
    estimate = Session.open(session).estimate("ekf")
    assert estimate.map is not None
    assert estimate.map.landmarks.ids.tolist() == [1, 2]


def test_fastslam_is_repeatable_by_its_seed(session: Path) -> None:
    words = ("--algorithm", "fastslam", "--set", "particles=50")
    for name, seed in (("one", 3), ("again", 3), ("other", 4)):
        done = run(session, *words, "--seed", seed, "--name", name)
        assert done.exit_code == 0, done.output
    paths = [
        (session / "estimates" / n / "path.tum").read_bytes() for n in ("one", "again", "other")
    ]
    assert paths[0] == paths[1] != paths[2]
    provenance = Session.open(session).estimate("one").provenance
    assert (provenance["algorithm"], provenance["seed"]) == ("fastslam", 3)


@pytest.mark.parametrize("name", ["ekf-fej", "ukf", "fastslam2", "smoother"])
def test_each_algorithm_makes_an_estimate_that_tells_how(session: Path, name: str) -> None:
    done = run(session, "--algorithm", name, "--set", "observation.range_sigma_m=0.02")
    assert done.exit_code == 0, done.exception
    estimate = Session.open(session).estimate(name)
    assert estimate.map is not None
    np.testing.assert_allclose(estimate.map.landmarks.positions, [[2, 1], [2, -1]], atol=0.1)
    told = estimate.provenance
    assert (told["algorithm"], told["preset"], told["seed"]) == (name, "robust", 0)
    assert isinstance(told["config"], dict)
    assert told["config"]["observation"]["range_sigma_m"] == 0.02
    assert "distribution" not in told


@pytest.mark.parametrize("name", ["fastslam2", "smoother"])
def test_the_thesis_ran_neither_of_these(session: Path, name: str) -> None:
    refused = run(session, "--algorithm", name, "--preset", "thesis")
    assert isinstance(refused.exception, UsageError)
    assert "valid names: robust" in str(refused.exception)


def test_smoothing_is_told_in_the_provenance(session: Path) -> None:
    assert run(session, "--smooth", "--name", "smoothed").exit_code == 0
    estimate = Session.open(session).estimate("smoothed")
    assert estimate.map is not None
    np.testing.assert_allclose(estimate.map.landmarks.positions, [[2, 1], [2, -1]], atol=1e-6)
    told = estimate.provenance["smoothing"]
    assert isinstance(told, dict)
    assert told["converged"] is True


def test_smoothing_without_names_finds_out_whose_a_sighting_is(session: Path) -> None:
    done = run(session, "--smooth", "--association", "nearest", "--name", "unnamed")
    assert done.exit_code == 0, done.output
    estimate = Session.open(session).estimate("unnamed")
    assert estimate.map is not None
    found = estimate.map.landmarks.positions
    np.testing.assert_allclose(found[np.argsort(-found[:, 1])], [[2, 1], [2, -1]], atol=1e-6)
    told = estimate.provenance["smoothing"]
    assert isinstance(told, dict)
    assert told["unnamed"]["log_likelihood"] > 0.0


def test_the_range_of_the_cone_finder_is_explained_without_a_session() -> None:
    done = run("--explain-range", "--preset", "thesis")
    assert done.exit_code == 0
    assert "1.433" in done.output
    assert "1.910" in done.output


def test_scans_become_cones(tmp_path: Path) -> None:
    """A lidar on a car that stands between three cones sees those three."""
    from capture.messages import header, serialised, typestore
    from capture.topics import SCAN_TYPE

    make = typestore().types[SCAN_TYPE]
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    ranges = np.full(720, np.inf, dtype=np.float32)
    for at_m, at_rad in ((1.0, 0.5), (1.4, -2.0), (0.8, 3.1)):
        off = np.abs(np.angle(np.exp(1j * (bearings - at_rad))))
        hit = off < np.arcsin(0.05 / at_m)
        ranges[hit] = at_m * np.cos(off[hit]) - np.sqrt(0.05**2 - (at_m * np.sin(off[hit])) ** 2)
    t_ns = S + np.arange(30) * S // 10
    messages = [
        serialised(
            make(
                header=header(int(t), "lidar"),
                angle_min=-np.pi,
                angle_max=np.pi,
                angle_increment=2 * np.pi / 720,
                time_increment=0.0,
                scan_time=0.1,
                range_min=0.1,
                range_max=12.0,
                ranges=ranges,
                intensities=np.zeros(0, dtype=np.float32),
            ),
            SCAN_TYPE,
        )
        for t in t_ns
    ]
    folder = tmp_path / "lidar"
    still = Odometry("vesc", t_ns, np.zeros((30, 3)), np.zeros(30), np.zeros(30))
    with Session.create(folder, SessionInfo()) as writer:
        writer.add_messages("/scan", SCAN_TYPE, messages, t_ns)
        writer.add_odometry(still)
    done = run(folder)
    assert done.exit_code == 0, done.exception
    assert "90 cones in 30 lidar revolutions" in done.output
    estimate = Session.open(folder).estimate("ekf")
    assert estimate.provenance["association"] == "nearest"
    assert "cones" in estimate.provenance
    assert estimate.map is not None
    found = np.sort(np.hypot(*estimate.map.landmarks.positions.T))
    np.testing.assert_allclose(found, [0.8, 1.0, 1.4], atol=0.01)
    refused = run(folder, "--association", "known", "--name", "x")
    assert isinstance(refused.exception, UsageError)
    assert "nearest or jcbb" in str(refused.exception)
