"""The car at real pace: devices behind pseudo-terminals, the recorder with its threads."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from capture import Session
from simulation.drive import Drive
from simulation.real_time import real_time_clock, record_car_in_real_time
from simulation.recordings import exact_truth
from simulation.world import world


@pytest.mark.slow
@pytest.mark.parametrize("commanded", [False, True])
def test_what_is_recorded_at_real_pace_is_what_happened(tmp_path: Path, commanded: bool) -> None:
    whole = world("s-curve", "high", 3)
    # The part in which it drives off and begins to turn.
    made = replace(
        whole, drive=Drive(whole.drive.rows[2000:6500], whole.drive.commands - [2.0, 0.0, 0.0])
    )
    clock = real_time_clock()
    told: list[float] = []
    info = record_car_in_real_time(
        made, tmp_path, clock=clock, commanded=commanded, stereo=False, advance=told.append
    )
    assert info.verdict == "good", info.verdict_reason
    assert sum(told) == pytest.approx(made.drive.end_ns * 1e-9, abs=0.3)
    session, truth = Session.open(tmp_path), exact_truth(made, clock).path
    state, tied = session.vesc_state(), made.built.vesc
    inside = (state.t_ns > truth.t_ns[0]) & (state.t_ns < truth.t_ns[-1])
    rolled = state.tachometer[inside] * tied.metres_per_count
    expected = [made.drive.at(int(t - truth.t_ns[0])).counted_m for t in state.t_ns[inside]]
    # A machine that stalls dates an answer by half of the stall; the middle one is not late.
    assert np.median(np.abs(rolled - np.array(expected))) < 0.004
    imu = session.imu()
    seen = (imu.t_ns > truth.t_ns[0]) & (imu.t_ns < truth.t_ns[-1])
    turned = np.array([made.drive.at(int(t - truth.t_ns[0])).turn_rad_s for t in imu.t_ns[seen]])
    told_rad_s = imu.angular_velocity_rad_s[seen, 2]
    assert np.corrcoef(told_rad_s, turned)[0, 1] > 0.99
    assert ("vesc" in session.odometry_sources) is commanded
