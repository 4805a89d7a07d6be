"""Offset and skew of two clocks by least squares on a level: heading or distance.

    filmed(t) = c + scale * (level(tau) - b * extra(tau)) + wander(t)
    tau = t + offset + skew * (t - t_ref)

c : one constant for each piece without a gap. extra : for a gyro the time (b is
its bias); for wheels v|v| / 2 (they slip in proportion to the acceleration, so that they run ahead
by b v^2 / 2). wander : a random walk, the noise of a gyro summed up, the slip of wheels, what the
film is off from place to place; its size and that of the film's scatter are estimated with the rest
(expectation maximisation for variance components: Dempster, Laird, Rubin 1977, section 4.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from calibration.clocks.motion import CarMotion, FilmedMotion, Source
from geometry import Floats, Stamps, wrap

SKEW_SIGMA = 50e-6
"""Of a crystal against another one."""
ROUNDS = 40
HUBER = 2.5
LEAST_SAMPLES = 30
MOST_KNOTS = 100
OFFSET, SKEW, SCALE, EXTRA, FIRST_CONSTANT = 0, 1, 2, 3, 4


@dataclass(frozen=True)
class Priors:
    """What is known of a sensor before: standard deviations, and a first guess of its wander.

    extra : of the bias (rad/s) or of the slip (s^2/m); wander : per root of a second; floor_s : no
    offset is trusted better (a count of wheels is 2 mm, and they slip as they like).
    """

    scale: float
    extra: float
    scatter: float
    wander: float
    floor_s: float = 0.0


PRIORS: dict[Source, Priors] = {
    "gyro": Priors(scale=0.03, extra=0.05, scatter=2e-3, wander=5e-4),
    "wheels": Priors(scale=0.05, extra=5e-3, scatter=2e-3, wander=2e-3, floor_s=1e-3),
}


@dataclass(frozen=True, eq=False)
class LevelFit:
    """The clocks as one sensor tells them.

    Car time minus film time is `base_ns` + offset_s + skew (t_film - ref_ns). covariance : (2, 2)
    of offset and skew, correlated residuals allowed for. scale, extra : as in the equation, with
    standard deviations. scatter, wander : of the film, per root of a second. t_s : (n,) film time
    since ref_ns; filmed, residual : (n,) level and what is left of it without the wander;
    rate : (n,) of the car then.
    """

    source: Source
    ref_ns: int
    base_ns: int
    offset_s: float
    skew: float
    covariance: Floats
    scale: tuple[float, float]
    extra: tuple[float, float]
    scatter: float
    wander: float
    inflation: float
    t_s: Floats
    filmed: Floats
    residual: Floats
    rate: Floats

    @property
    def sigma_offset_s(self) -> float:
        """Standard deviation of the offset."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def residual_rms(self) -> float:
        """Root mean square of what the motion leaves unexplained, rad or m."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def rate_rms(self) -> float:
        """How much the rate changed: its root mean square around its mean, rad/s or m/s."""
        return float(self.rate.std())


@dataclass(frozen=True, eq=False)
class _Problem:
    car: CarMotion
    ref_ns: int
    base_ns: int
    t_s: Floats
    level: Floats
    weight: Floats
    car_s: Floats
    piece: npt.NDArray[np.int64]
    wraps: bool


def fit_level(
    car: CarMotion, film: FilmedMotion, guess_ns: int, scale: float = 1.0
) -> LevelFit | None:
    """The fit from a guess of car time minus film time; None where less than a second overlaps.

    scale : level of the film per level of the car, as known before.
    """
    car = replace(car, level=car.level * scale, rate=car.rate * scale)
    for _ in range(2):  # the second time around, the overlap is that of the right offset
        problem = _problem(car, film, guess_ns)
        if problem is None:
            return None
        found = _solved(problem, PRIORS[car.source])
        guess_ns = found.base_ns + round(found.offset_s * 1e9)
    return replace(found, scale=(found.scale[0] * scale, found.scale[1] * scale))


def _problem(car: CarMotion, film: FilmedMotion, base_ns: int) -> _Problem | None:
    """The film's samples that have data of the car around them."""
    at_ns = film.t_ns + base_ns
    after = np.searchsorted(car.t_ns, at_ns)
    inside = (after > 0) & (after < car.t_ns.size)
    after = np.clip(after, 1, car.t_ns.size - 1)
    inside &= car.piece[after] == car.piece[after - 1]
    if np.count_nonzero(inside) < LEAST_SAMPLES:
        return None
    t_ns = film.t_ns[inside]
    ref_ns = int(t_ns[0] + (t_ns[-1] - t_ns[0]) // 2)
    sigma = film.sigma[inside]
    weight = np.clip((np.median(sigma) / np.maximum(sigma, 1e-9)) ** 2, 0.01, 1.0)
    both = np.stack([car.piece[after[inside]], film.piece[inside]], axis=1)
    _, piece = np.unique(both, axis=0, return_inverse=True)
    return _Problem(
        car, ref_ns, base_ns, _seconds(t_ns, ref_ns), film.level[inside], weight,
        _seconds(car.t_ns, ref_ns + base_ns), piece.ravel(), wraps=film.source == "gyro",
    )  # fmt: skip


def _seconds(t_ns: Stamps, ref_ns: int) -> Floats:
    return np.asarray((t_ns - ref_ns) * 1e-9)


def _solved(problem: _Problem, priors: Priors) -> LevelFit:
    ramps, spacing_s = _ramps(problem.t_s)
    pieces = np.eye(int(problem.piece.max()) + 1)[problem.piece]
    fixed = FIRST_CONSTANT + pieces.shape[1]
    x, target = np.zeros(fixed + ramps.shape[1]), _target(problem)
    precision = np.concatenate([
        [0.0, SKEW_SIGMA**-2, priors.scale**-2, priors.extra**-2], np.full(x.size - 4, 1e-8),
    ])  # fmt: skip
    scatter, wander = priors.scatter, priors.wander * math.sqrt(spacing_s)
    for _ in range(ROUNDS):
        slopes, told, rate = _linear(problem, x, pieces, ramps)
        residual = target - told
        weight = problem.weight * _huber(residual, scatter)
        precision[fixed:] = wander**-2
        weighted = slopes * weight[:, None]
        information = weighted.T @ slopes
        covariance = np.asarray(np.linalg.inv(information / scatter**2 + np.diag(precision)))
        step = covariance @ (weighted.T @ residual / scatter**2 - precision * x)
        x, left = x + step, residual - slopes @ step
        scatter, wander = _variances(left, weight, information, covariance, x[fixed:])
    inflation = _correlation_time(left * np.sqrt(weight))
    clocks, weaker = _weakened(x[:2], covariance[:2, :2], inflation, priors.floor_s)
    spread: Floats = np.sqrt(np.diag(covariance) * inflation)
    walk = ramps @ x[fixed:]
    return LevelFit(
        source=problem.car.source,
        ref_ns=problem.ref_ns,
        base_ns=problem.base_ns,
        offset_s=float(clocks[OFFSET]),
        skew=float(clocks[SKEW]),
        covariance=weaker,
        scale=(1.0 + float(x[SCALE]), float(spread[SCALE])),
        extra=(float(x[EXTRA]), float(spread[EXTRA])),
        scatter=scatter,
        wander=float(wander / np.sqrt(spacing_s)),
        inflation=inflation,
        t_s=problem.t_s,
        filmed=target,
        residual=left + walk - walk.mean(),
        rate=rate,
    )


def _linear(
    problem: _Problem, x: Floats, pieces: Floats, ramps: Floats
) -> tuple[Floats, Floats, Floats]:
    """Slopes (n, p) of the film's levels by the parameters, the levels, and the car's rate."""
    t_s, car = problem.t_s, problem.car
    tau = t_s + x[OFFSET] + x[SKEW] * t_s
    level = np.interp(tau, problem.car_s, car.level) - car.level.mean()
    rate = np.interp(tau, problem.car_s, car.rate)
    scale = 1.0 + x[SCALE]
    gyro = car.source == "gyro"
    extra = tau if gyro else 0.5 * rate * np.abs(rate)
    own = scale * (rate - x[EXTRA] if gyro else rate)
    fixed = FIRST_CONSTANT + pieces.shape[1]
    corrected = level - x[EXTRA] * extra
    told = scale * corrected + pieces @ x[FIRST_CONSTANT:fixed] + ramps @ x[fixed:]
    slopes = np.column_stack([own, own * t_s, corrected, -scale * extra, pieces, ramps])
    return slopes, told, rate


def _target(problem: _Problem) -> Floats:
    """The film's levels; a heading unwrapped along the car's own, over the longest gap."""
    if not problem.wraps:
        return np.asarray(problem.level - problem.level.mean())
    level = np.interp(problem.t_s, problem.car_s, problem.car.level) - problem.car.level.mean()
    return np.asarray(level + np.unwrap(wrap(problem.level - level)))


def _ramps(t_s: Floats) -> tuple[Floats, float]:
    """(n, k): a random walk in k even steps, each a ramp; how long a step lasts."""
    span_s = float(t_s[-1] - t_s[0])
    count = int(np.clip(round(span_s), 1, MOST_KNOTS))
    spacing_s = max(span_s / count, 1e-3)
    begins = t_s[0] + spacing_s * np.arange(count)
    return np.asarray(np.clip((t_s[:, None] - begins) / spacing_s, 0.0, 1.0)), spacing_s


def _huber(residual: Floats, scatter: float) -> Floats:
    """Weights (n,) that let a sample far off pull no harder than one at the limit."""
    size = np.abs(residual) / (HUBER * scatter)
    # Before the first step everything is far off, and all of it counts.
    if float(np.median(size)) > 1.0:
        return np.ones(residual.size)
    return np.asarray(1.0 / np.maximum(size, 1.0))


def _variances(
    left: Floats, weight: Floats, information: Floats, covariance: Floats, steps: Floats
) -> tuple[float, float]:
    """The film's scatter, and the step of the random walk, by one round of EM."""
    used = float(np.sum(covariance * information))
    scatter2 = (float(np.sum(weight * left**2)) + used) / float(np.sum(weight))
    wander2 = float(np.mean(steps**2 + np.diag(covariance)[-steps.size :]))
    return math.sqrt(max(scatter2, 1e-14)), math.sqrt(max(wander2, 1e-14))


def _correlation_time(residual: Floats) -> float:
    """By how much correlated residuals tell less than their number: 1 + 2 sum of correlations."""
    centred = residual - residual.mean()
    power = float(centred @ centred)
    total = 1.0
    for lag in range(1, min(60, residual.size // 4)):
        share = float(centred[lag:] @ centred[:-lag]) / max(power, 1e-300)
        if share <= 0.0:
            break
        total += 2.0 * share
    return total


def _weakened(
    mean: Floats, covariance: Floats, inflation: float, floor_s: float
) -> tuple[Floats, Floats]:
    """Offset and skew with weaker data: their residuals are correlated, and there is a floor.

    The prior of the skew, which is at zero, stays as strong as it is.
    """
    prior = np.diag([0.0, SKEW_SIGMA**-2])
    whole = np.linalg.inv(covariance)
    data, told = (whole - prior) / inflation, whole @ mean / inflation
    weaker: Floats = np.asarray(np.linalg.inv(data + prior))
    share = 1.0 + floor_s**2 / float(weaker[0, 0])
    weaker = np.asarray(np.linalg.inv(data / share + prior))
    return np.asarray(weaker @ told / share), weaker
