"""Two sessions become one through the real command."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from recorded_drive import RIG, car_session, film_session
from rosbags.highlevel import AnyReader
from synthetic_drives import START_NS, Drive

from capture import (
    CameraDelayCalibration,
    ClockPair,
    PeerClock,
    Session,
    SessionInfo,
    read_yaml,
    write_calibration,
)
from capture.network_clock import write_peer_clock
from geometry import Floats, Stamps
from trackside.cli import trackside

DRIVE = Drive(seed=3)
BOOT_ID = "11111111-1111-1111-1111-111111111111"


def call(*words: object) -> Result:
    return CliRunner().invoke(trackside, [str(word) for word in words])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A car, its film, and what joins them."""
    folder = tmp_path_factory.mktemp("site")
    car_session(folder / "car", DRIVE)
    film_session(folder / "film", DRIVE)
    done = call("join", folder / "car", folder / "film")
    assert done.exit_code == 0, done.output
    assert "verdict: good" in done.output
    assert f"next: trackside slam {folder / 'car_joined'}" in done.output
    return folder


def test_the_joined_session_has_the_truth_on_the_clock_of_the_car(site: Path) -> None:
    joined = Session.open(site / "car_joined")
    film_ns = DRIVE.truth().path.t_ns
    true_s = DRIVE.car_s(seconds(film_ns))
    told_s = seconds(joined.ground_truth().path.t_ns)
    assert np.abs(told_s - true_s).max() < 1e-3
    clock = joined.info.film_clock
    assert clock is not None
    assert clock.sigma_ns < 2_000_000
    assert clock.film["verdict"] == "good"
    assert clock.film["folder"] == str((site / "film").resolve())
    assert set(joined.info.devices) == {"imu", "overhead"}
    assert "by trackside join" in str(joined.ground_truth().provenance["stamps_mapped"])


def test_raw_data_stay_as_they_are_and_are_read_on_one_clock(site: Path) -> None:
    joined, film = Session.open(site / "car_joined"), Session.open(site / "film")
    for name, source in (("car.mcap", "car"), ("overhead.mcap", "film")):
        held = (site / "car_joined" / name).read_bytes()
        assert held == (site / source / name).read_bytes()
    told = [one.t_ns for one in joined.overhead_images()]
    was = np.array([one.t_ns for one in film.overhead_images()])
    true_s = DRIVE.car_s(seconds(was))
    assert np.abs(seconds(np.array(told)) - true_s).max() < 1e-3
    assert np.array_equal(joined.imu().t_ns, Session.open(site / "car").imu().t_ns)


def test_the_folder_opens_as_a_bag_and_has_its_pictures_and_record(site: Path) -> None:
    joined = site / "car_joined"
    with AnyReader([joined]) as reader:
        topics = set(reader.topics)
    assert topics == {"/imu/data_raw", "/vesc/state", "/overhead/image/compressed"}
    assert (joined / "join.png").stat().st_size > 50_000
    record = read_yaml(joined / "join.yaml")
    assert record["verdict"] == "good"
    sources = record["sources"]
    assert isinstance(sources, dict)
    assert set(sources) == {"gyro", "wheels"}
    assert (joined / "ground_truth" / "track.html").read_text() == "a page"


def test_nothing_is_overwritten_and_joined_sessions_are_not_joined_again(site: Path) -> None:
    again = call("join", site / "car", site / "film")
    assert "exists already" in str(again.exception)
    twice = call("join", site / "car_joined", site / "film", "-o", site / "other")
    assert "has a film already" in str(twice.exception)
    swapped = call("join", site / "film", site / "car", "-o", site / "other")
    assert "has a film already" in str(swapped.exception)
    no_film = call("join", site / "car", site / "car", "-o", site / "other")
    assert "has no pictures of the overhead camera" in str(no_film.exception)
    assert not (site / "other").exists()


def test_the_film_of_another_run_makes_nothing(site: Path, tmp_path: Path) -> None:
    film_session(tmp_path / "film", Drive(seed=4))
    refused = call("join", site / "car", tmp_path / "film", "-o", tmp_path / "joined")
    assert refused.exit_code == 1
    assert "clocks" in str(refused.exception) or "another run" in str(refused.exception)
    assert not (tmp_path / "joined").exists()


def test_what_should_make_one_look_twice_is_noted(tmp_path: Path) -> None:
    words = SessionInfo(map="turn", trial=3, configuration={"rig": RIG})
    car_session(tmp_path / "car", DRIVE, words)
    bad = SessionInfo(map="loop", trial=3, verdict="bad", verdict_reason="overhead: silent")
    film_session(tmp_path / "film", DRIVE, bad, {"verdict": "bad"})
    done = call("join", tmp_path / "car", tmp_path / "film")
    assert "note: map: the car's session says 'turn', the film's 'loop'" in done.output
    assert "note: the recording of film is bad: overhead: silent" in done.output
    assert "trial" not in done.output
    # The truth of the film was bad, and is so in the joined session.
    assert done.exit_code == 1
    assert Session.open(tmp_path / "car_joined").ground_truth().provenance["verdict"] == "bad"


def test_a_car_without_gyro_and_wheels_is_refused(site: Path, tmp_path: Path) -> None:
    with Session.create(tmp_path / "car", SessionInfo()):
        pass
    refused = call("join", tmp_path / "car", site / "film", "-o", tmp_path / "joined")
    assert "neither a gyro nor wheel counts" in str(refused.exception)


def asked(offset_ns: int) -> PeerClock:
    """What the car was told of the laptop, whose clock is so much behind."""
    return PeerClock(
        peer="laptop:47123",
        monotonic_ns=2_000_000_000,
        utc_ns=START_NS + 2_000_000_000,
        offset_monotonic_ns=0,
        offset_utc_ns=-offset_ns,
        uncertainty_ns=200_000,
        round_trip_ns=400_000,
        answers=80,
    )


def seconds(t_ns: Stamps) -> Floats:
    return np.asarray((t_ns - START_NS) * 1e-9)


def with_clocks(info: SessionInfo) -> SessionInfo:
    return replace(info, clocks=(ClockPair(monotonic_ns=0, utc_ns=START_NS),))


def test_the_network_is_compared_and_kept(tmp_path: Path) -> None:
    info = with_clocks(SessionInfo(configuration={"rig": RIG}))
    right_ns = round(DRIVE.offset_s * 1e9)
    car = replace(info, peer_clocks=(asked(right_ns + 4_000_000),))
    car_session(tmp_path / "car", DRIVE, car)
    film_session(tmp_path / "film", DRIVE, with_clocks(SessionInfo()))
    done = call("join", tmp_path / "car", tmp_path / "film")
    assert done.exit_code == 0, done.output
    assert "data minus network -4." in done.output
    clock = Session.open(tmp_path / "car_joined").info.film_clock
    assert clock is not None
    assert clock.network_offset_ns == right_ns + 4_000_000


def test_a_network_50_ms_off_is_refused_unless_the_data_are_trusted_or_the_delay_is_known(
    tmp_path: Path,
) -> None:
    plain = with_clocks(SessionInfo(configuration={"rig": RIG}))
    car_session(tmp_path / "car", DRIVE, plain)
    film_session(tmp_path / "film", DRIVE, with_clocks(SessionInfo()))
    write_peer_clock(tmp_path / "clock.yaml", asked(round(DRIVE.offset_s * 1e9) + 50_000_000))
    words = ["join", tmp_path / "car", tmp_path / "film", "--clock", tmp_path / "clock.yaml"]
    refused = call(*words)
    assert refused.exit_code == 1
    assert "network and data disagree: the data say +0.437" in str(refused.exception)
    assert "the network +0.487" in str(refused.exception)
    assert not (tmp_path / "car_joined").exists()
    trusted = call(*words, "--trust-data", "-o", tmp_path / "trusted")
    assert trusted.exit_code == 0, trusted.output
    assert "note: network and data disagree" in trusted.output
    delay = CameraDelayCalibration(
        made_utc="2026-05-14T10:00:00Z", accepted=True, delay_s=-0.050, sigma_s=5e-4,
        scatter_s=5e-4, sessions=(),
    )  # fmt: skip
    write_calibration(tmp_path / "calibration", delay)
    known = call(*words, "--calibration", tmp_path / "calibration")
    assert known.exit_code == 0, known.output


def test_one_machine_that_records_and_films_needs_no_network(tmp_path: Path) -> None:
    drive = Drive(seed=3, offset_s=0.0, skew=0.0)
    info = replace(with_clocks(SessionInfo()), boot_id=BOOT_ID)
    car_session(tmp_path / "car", drive, replace(info, configuration={"rig": RIG}))
    film_session(tmp_path / "film", drive, info)
    done = call("join", tmp_path / "car", tmp_path / "film", "--without", "wheels")
    assert done.exit_code == 0, done.output
    clock = Session.open(tmp_path / "car_joined").info.film_clock
    assert clock is not None
    assert clock.network_offset_ns == 0
    assert abs(clock.offset_ns) < 1_000_000
