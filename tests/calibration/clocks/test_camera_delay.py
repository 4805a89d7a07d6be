from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from calibration.clocks.camera_delay import camera_delay
from calibration.clocks.errors import ClockError
from capture import DelayOfSession, FilmClock, Session, SessionInfo, read_camera_delay
from trackside.cli import trackside

CLOCK = FilmClock(
    offset_ns=400_000_000,
    ref_ns=0,
    sigma_ns=500_000,
    network_offset_ns=431_000_000,
    network_sigma_ns=300_000,
)


def joined(folder: Path, clock: FilmClock | None) -> Path:
    with Session.create(folder, SessionInfo(film_clock=clock)):
        pass
    return folder


def call(*words: object) -> Result:
    names = ["calibrate", "camera-delay", *words]
    return CliRunner().invoke(trackside, [str(word) for word in names])


def test_the_delay_is_data_minus_network_over_all_sessions(tmp_path: Path) -> None:
    for k, more_ns in enumerate((-600_000, 0, 600_000)):
        joined(tmp_path / f"s{k}", replace(CLOCK, offset_ns=CLOCK.offset_ns + more_ns))
    done = call(tmp_path, "-o", tmp_path / "calibration")
    assert done.exit_code == 0, done.output
    assert "the film is stamped 31.00 ms late" in done.output
    found = read_camera_delay(tmp_path / "calibration")
    assert found.accepted
    assert found.delay_s == pytest.approx(-0.031)
    assert found.scatter_s == pytest.approx(0.6e-3)
    assert found.sigma_s == pytest.approx(np.hypot(0.5e-3, 0.3e-3) / np.sqrt(3), rel=0.05)
    assert [round(1e6 * one.residual_s) for one in found.sessions] == [-600, 0, 600]


def test_a_delay_that_is_not_constant_or_seen_only_once_is_rejected(tmp_path: Path) -> None:
    once = call(joined(tmp_path / "one", CLOCK), "-o", tmp_path / "calibration")
    assert once.exit_code == 1
    assert "1 session only" in once.output
    assert not read_camera_delay(tmp_path / "calibration").accepted
    spread = [
        DelayOfSession(name=str(k), delay_s=delay_s, sigma_s=5e-4, residual_s=0.0)
        for k, delay_s in enumerate((0.0, 0.02, 0.01))
    ]
    found = camera_delay(spread)
    assert "the sessions scatter by 10.0 ms" in " ".join(found.reasons)
    # The scatter, not the small uncertainty of each, says how well the mean is known.
    assert found.sigma_s == pytest.approx(0.01 / np.sqrt(3), rel=0.01)


def test_sessions_whose_clocks_are_known_only_once_are_refused(tmp_path: Path) -> None:
    apart = joined(tmp_path / "apart", None)
    assert "is not joined" in str(call(apart).exception)
    silent = joined(tmp_path / "silent", replace(CLOCK, network_offset_ns=None))
    assert "did not see each other" in str(call(silent).exception)
    with pytest.raises(ClockError, match="no session was given"):
        camera_delay([])
