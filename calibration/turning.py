"""The gyro against known headings: its scale, its bias, and how late its stamps are.

heading(t) = start + scale * (G(t) - bias t) + late * scale * rate(t), with G the integral of the
measured rate: a gyro whose stamps are late by `late` shows at t what was before. The integral of
white noise walks away, so that knots of a random walk are estimated with the rest; without them a
drift of a minute would be taken for scale and delay. Linear in all of its coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from calibration.estimation import Priors, robust_fit
from capture import Imu
from geometry import Floats, Stamps, Trajectory, covers

MAX_GAP_S = 0.2
CLUSTER_S = 0.5
LEAST_TURN_RAD = np.pi
"""Less turning fixes no scale."""
LEAST_POSES = 20
LATE_SIGMA_S = 0.05
KNOT_S, MOST_KNOTS = 2.0, 60
LEAST_DENSITY = 5e-5
"""Of the gyro's white noise [rad/s/sqrt(Hz)]: no small gyro is better."""
_ROUNDS = 2
_RATE_S = 0.03
"""The rate that multiplies the delay is smoothed over so long: its noise is no turning."""


@dataclass(frozen=True, eq=False)
class GyroFit:
    """true rate = scale * (measured - bias_rad_s), stamps late by late_s.

    covariance : (3, 3) of scale, bias, late; rms_rad : of the headings left over; turned_rad : all
    turning, both ways, that the fit saw; span_s.
    """

    scale: float
    bias_rad_s: float
    late_s: float
    covariance: Floats
    rms_rad: float
    turned_rad: float
    span_s: float
    _start_ns: int
    _t_s: Floats
    _heading: Floats

    def heading_at(self, t_ns: Stamps) -> Floats:
        """Headings (n,), unwrapped, in the frame of the truth."""
        found: Floats = np.interp((t_ns - self._start_ns) * 1e-9, self._t_s, self._heading)
        return found

    def covers(self, t_ns: Stamps) -> npt.NDArray[np.bool_]:
        """(n,) stamps that lie within the gyro's."""
        seconds = (t_ns - self._start_ns) * 1e-9
        return np.asarray((seconds >= self._t_s[0]) & (seconds <= self._t_s[-1]))


def fit_gyro(truth: Trajectory, imu: Imu) -> GyroFit | None:
    """The gyro's z axis against the headings of a path; None where they do not overlap enough."""
    rate = imu.angular_velocity_rad_s[:, 2]
    told = np.isfinite(rate)
    own_ns, rate = imu.t_ns[told], rate[told]
    inside = (
        covers(own_ns, truth.t_ns, MAX_GAP_S) if own_ns.size > 2 else np.zeros(len(truth), bool)
    )
    if np.count_nonzero(inside) < LEAST_POSES:
        return None
    rate = without_spikes(rate)
    seen = truth.selected(inside)
    late_s = 0.0
    for _ in range(_ROUNDS):
        fit = _fitted(seen, own_ns, rate, late_s)
        if fit is None:
            return None
        late_s = fit.late_s
    return fit


def _fitted(truth: Trajectory, own_ns: Stamps, rate: Floats, known_late_s: float) -> GyroFit | None:
    """One round: linear in scale, bias, and what the delay differs from what is known of it."""
    start_ns = int(truth.t_ns[0])
    own_s = np.asarray((own_ns - start_ns) * 1e-9 - known_late_s, np.float64)
    t_s = np.asarray((truth.t_ns - start_ns) * 1e-9, np.float64)
    heading = np.unwrap(truth.heading)
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(own_s)
    turned = np.concatenate([[0.0], np.cumsum(steps)])
    knots, walk_rad = _walk(rate, own_s, t_s)
    told = [np.ones_like(own_s), turned, own_s, _smoothed(rate, own_s)]
    columns = np.column_stack([*told, knots])
    seen = np.stack([np.interp(t_s, own_s, column) for column in columns.T], axis=1)
    if np.abs(np.diff(seen[:, 1])).sum() < LEAST_TURN_RAD:
        return None
    known = np.array([np.inf, np.inf, np.inf, LATE_SIGMA_S])
    sigma = np.concatenate([known, np.full(knots.shape[1], walk_rad)])
    priors = Priors(np.zeros(sigma.size), sigma)
    clusters = (t_s / CLUSTER_S).astype(np.int64)
    start = np.zeros(sigma.size)
    start[:2] = heading[0] - seen[0, 1], 1.0
    groups = np.zeros(t_s.size, np.int64)
    fit = robust_fit(lambda x: heading - seen @ x, start, priors, groups, clusters)
    scale, drift, late = fit.values[1:4].tolist()
    # scale, bias = -drift / scale, late = column / scale.
    to = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [0.0, drift / scale**2, -1.0 / scale, 0.0],
            [0.0, -late / scale**2, 0.0, 1.0 / scale],
        ]
    )
    counted = fit.weight > 0
    return GyroFit(
        scale,
        -drift / scale,
        known_late_s + late / scale,
        to @ fit.covariance[:4, :4] @ to.T,
        float(np.sqrt(np.mean(fit.residuals[counted] ** 2))),
        float(np.abs(np.diff(seen[:, 1])).sum()),
        float(t_s[-1]),
        start_ns,
        own_s,
        columns @ fit.values,
    )


def _walk(rate: Floats, own_s: Floats, t_s: Floats) -> tuple[Floats, float]:
    """Columns (n, k) that ramp from 0 to 1, one for each stretch, and the sigma of each [rad]."""
    stretch_s = max(KNOT_S, float(t_s[-1]) / MOST_KNOTS)
    firsts = np.arange(0.0, float(t_s[-1]), stretch_s)
    period_s = float(np.median(np.diff(own_s)))
    white = 1.4826 * float(np.median(np.abs(np.diff(rate)))) / np.sqrt(2.0)
    density = max(white * np.sqrt(period_s), LEAST_DENSITY)
    ramps = np.clip((own_s[:, None] - firsts) / stretch_s, 0.0, 1.0)
    return ramps, float(density * np.sqrt(stretch_s))


def without_spikes(rate: Floats) -> Floats:
    """Rates (n,): a row that neither neighbour supports (slipped bytes) becomes their mean."""
    out = rate.copy()
    away = np.minimum(np.abs(rate[1:-1] - rate[:-2]), np.abs(rate[1:-1] - rate[2:]))
    usual = 1.4826 * float(np.median(away)) if away.size else 0.0
    spikes = np.flatnonzero(away > max(20.0 * usual, 0.5)) + 1
    out[spikes] = 0.5 * (rate[spikes - 1] + rate[spikes + 1])
    return out


def _smoothed(rate: Floats, own_s: Floats) -> Floats:
    period_s = float(np.median(np.diff(own_s)))
    width = max(round(_RATE_S / period_s) | 1, 1)
    padded = np.pad(rate, width // 2, mode="edge")
    return np.asarray(np.convolve(padded, np.ones(width) / width, mode="valid"))
