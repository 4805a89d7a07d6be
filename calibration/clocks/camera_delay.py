"""What the overhead camera stamps wrong: the clocks by the data against those by the network."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from calibration.clocks.errors import ClockError
from capture import CameraDelayCalibration, DelayOfSession, Session, now_utc

MOST_SIGMA_S = 2e-3
MOST_SCATTER_S = 5e-3
LEAST_SESSIONS = 2


def measured_delay(session: Session) -> DelayOfSession:
    """What one joined session tells; raises `ClockError` where its clocks are not known twice."""
    clock = session.info.film_clock
    if clock is None:
        raise ClockError(f"{session.folder}: is not joined; give sessions that trackside join made")
    if clock.network_offset_ns is None or clock.network_sigma_ns is None:
        raise ClockError(
            f"{session.folder}: the two machines did not see each other: there is nothing to "
            "compare the data with; set clock_server in the rig, or film on the car's own machine"
        )
    delay_s = (clock.offset_ns - clock.network_offset_ns) * 1e-9
    sigma_s = 1e-9 * math.hypot(clock.sigma_ns, clock.network_sigma_ns)
    return DelayOfSession(name=session.name, delay_s=delay_s, sigma_s=sigma_s, residual_s=0.0)


def camera_delay(measured: Sequence[DelayOfSession]) -> CameraDelayCalibration:
    """The weighted mean over sessions, and whether they agree.

    What they scatter beyond their own uncertainty widens the result (Birge, Phys. Rev. 40, 1932).
    """
    if not measured:
        raise ClockError("no session was given; expected joined ones, two at least")
    delay = np.array([one.delay_s for one in measured])
    weight = np.array([max(one.sigma_s, 1e-6) ** -2 for one in measured])
    mean = float(np.average(delay, weights=weight))
    free = max(len(measured) - 1, 1)
    birge = max(1.0, math.sqrt(float(weight @ (delay - mean) ** 2) / free))
    sigma = birge / math.sqrt(float(weight.sum()))
    scatter = math.sqrt(float(np.sum((delay - mean) ** 2)) / free)
    reasons = []
    if len(measured) < LEAST_SESSIONS:
        reasons.append(
            f"{len(measured)} session only, {LEAST_SESSIONS} at least show whether it is constant"
        )
    if sigma > MOST_SIGMA_S:
        reasons.append(f"known to {1e3 * sigma:.1f} ms only, {1e3 * MOST_SIGMA_S:g} ms are needed")
    if scatter > MOST_SCATTER_S:
        reasons.append(
            f"the sessions scatter by {1e3 * scatter:.1f} ms: the delay is not constant, does the "
            "camera change its exposure?"
        )
    return CameraDelayCalibration(
        made_utc=now_utc(),
        accepted=not reasons,
        reasons=tuple(reasons),
        delay_s=mean,
        sigma_s=sigma,
        scatter_s=scatter,
        sessions=tuple(
            DelayOfSession(
                name=one.name,
                delay_s=one.delay_s,
                sigma_s=one.sigma_s,
                residual_s=one.delay_s - mean,
            )
            for one in measured
        ),
    )
