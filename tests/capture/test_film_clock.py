from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_session import make_session, odometry

from capture import ClockPair, FilmClock, Session, SessionInfo, check_parts, mapped_truth
from capture.errors import SessionError
from capture.log_writer import LogWriter
from capture.recording.check import checked
from capture.sensor_messages import image_message
from capture.topics import IMAGE_TYPE, OVERHEAD_TOPIC

YEAR_NS = 31_536_000 * 1_000_000_000
CLOCK = FilmClock(offset_ns=YEAR_NS + 3, ref_ns=1_700_000_000_000_000_000, skew=2e-5)


def test_times_map_to_the_nanosecond_over_a_year() -> None:
    film_ns = CLOCK.ref_ns + np.array([0, 1_000_000_000, -50_000_000_000])
    expected = film_ns + YEAR_NS + 3 + np.array([0, 20_000, -1_000_000])
    np.testing.assert_array_equal(CLOCK.all_session_ns(film_ns), expected)
    assert [CLOCK.session_ns(one) for one in film_ns.tolist()] == expected.tolist()


def test_the_truth_of_a_film_moves_with_its_clock_and_says_so(tmp_path: Path) -> None:
    truth = make_session(tmp_path / "film").ground_truth()
    moved = mapped_truth(truth, CLOCK)
    np.testing.assert_array_equal(moved.path.t_ns, CLOCK.all_session_ns(truth.path.t_ns))
    np.testing.assert_array_equal(moved.path.poses, truth.path.poses)
    assert moved.provenance["by"] == "test"
    told = moved.provenance["film_clock"]
    assert isinstance(told, dict)
    assert told["offset_ns"] == CLOCK.offset_ns


def test_the_verdict_on_a_joined_session_counts_its_film_on_one_clock(tmp_path: Path) -> None:
    start_ns = CLOCK.session_ns(CLOCK.ref_ns)
    asked = {"streams": {"wheel": {"topic": "/wheel/odom", "asked_hz": 50.0}}}
    info = SessionInfo(
        clocks=(ClockPair(monotonic_ns=0, utc_ns=start_ns),), configuration=asked, film_clock=CLOCK
    )
    driven = odometry(n=200)
    moved = replace(driven, t_ns=driven.t_ns - driven.t_ns[0] + start_ns)
    with Session.create(tmp_path / "joined", info) as writer:
        writer.add_odometry(moved)
    with LogWriter(tmp_path / "joined" / "overhead.mcap", sync_period_s=None) as log:
        for film_ns in (CLOCK.ref_ns, CLOCK.ref_ns + 5_000_000_000):
            message = image_message(film_ns, "overhead", "jpeg", b"a picture")
            log.write(OVERHEAD_TOPIC, IMAGE_TYPE, message, log_t_ns=film_ns, stamp_ns=film_ns)
    facts, verdict = checked(Session.open(tmp_path / "joined"))
    assert facts.duration_s == pytest.approx(5.0, abs=0.1)
    assert verdict.verdict == "good", verdict.text


def test_a_film_that_was_broken_off_is_recovered_first(tmp_path: Path) -> None:
    car = make_session(tmp_path / "car")
    with Session.create(tmp_path / "film", SessionInfo()):
        pass
    file = tmp_path / "film" / "overhead.mcap"
    with LogWriter(file, sync_period_s=None) as log:
        for k in range(400):
            message = image_message(k + 1, "overhead", "jpeg", bytes(5000))
            log.write(OVERHEAD_TOPIC, IMAGE_TYPE, message, log_t_ns=k + 1, stamp_ns=k + 1)
    check_parts(car, Session.open(tmp_path / "film"))
    file.write_bytes(file.read_bytes()[:-1000])
    with pytest.raises(SessionError, match="trackside recover"):
        check_parts(car, Session.open(tmp_path / "film"))
