"""The first guess: the offset of the clocks, among all there are, at which two rates look alike.

Nothing is assumed of the clocks: every overlap is tried that leaves half of the motion of one of
the two. Pearson's correlation over what both know (masked: Padfield, Masked object registration in
the Fourier domain, IEEE TIP 2012).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.clocks.motion import GRID_S, Mask, RateGrid
from geometry import Floats

LEAST_OVERLAP_S = 3.0
LEAST_SHARE = 0.5
LEAST_PEAK = 0.9
LEAST_LEAD = 0.02
CLEARNESS = 3.0
"""So many times less may be left unexplained at the best offset than at any other."""
NEAR_S = 0.3


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlation over offsets: car time minus film time is `base_ns` + `lag_s`, both (k,).

    value : NaN where too little overlaps. best, second : the highest peak and the next one that is
    not part of it; turned : the lowest value. scale : filmed rate per rate of the car at the best.
    """

    base_ns: int
    lag_s: Floats
    value: Floats
    best_lag_s: float
    best: float
    second: float
    turned: float
    scale: float

    @property
    def stands_out(self) -> bool:
        """Whether there is one offset, and one only, at which the two look alike."""
        left, other = 1.0 - self.best**2, 1.0 - max(self.second, 0.0) ** 2
        return (
            self.best >= LEAST_PEAK
            and self.best - self.second >= LEAST_LEAD
            and other >= CLEARNESS * left
        )

    @property
    def offset_ns(self) -> int:
        """Car time minus film time at the peak."""
        return self.base_ns + round(self.best_lag_s * 1e9)


def correlated(car: RateGrid, film: RateGrid) -> Correlation | None:
    """The correlation over all offsets; None where no overlap leaves enough motion."""
    size = 1 << int(np.ceil(np.log2(car.rate.size + film.rate.size)))
    sums = _Sums(car, film, size)
    value = sums.pearson()
    lags = np.arange(-(film.rate.size - 1), car.rate.size)
    value = np.concatenate([value[lags[0] :], value[: car.rate.size]])
    if not np.isfinite(value).any():
        return None
    peak = int(np.nanargmax(value))
    lag = float(lags[peak]) + _between(value, peak)
    return Correlation(
        base_ns=car.start_ns - film.start_ns,
        lag_s=np.asarray(lags * GRID_S, np.float64),
        value=value,
        best_lag_s=lag * GRID_S,
        best=float(value[peak]),
        second=_second(value, peak),
        turned=float(np.nanmin(value)),
        scale=sums.scale(int(lags[peak])),
    )


class _Sums:
    """Sums over each overlap, by lag (car row minus film row), as circular correlations."""

    def __init__(self, car: RateGrid, film: RateGrid, size: int) -> None:
        self._size = size
        g, f = _masked(car.rate, car.known), _masked(film.rate, film.known)
        in_g, in_f = car.known.astype(float), film.known.astype(float)
        self.count = self._over(in_g, in_f)
        count = np.maximum(self.count, 1.0)
        sum_g, sum_f = self._over(g, in_f), self._over(in_g, f)
        self.var_g = np.maximum(self._over(g * g, in_f) - sum_g**2 / count, 0.0)
        self.var_f = np.maximum(self._over(in_g, f * f) - sum_f**2 / count, 0.0)
        self.cross = self._over(g, f) - sum_g * sum_f / count
        self._all = _variation(g, car.known), _variation(f, film.known)

    def pearson(self) -> Floats:
        """The correlation by lag, NaN where too little overlaps."""
        all_g, all_f = self._all
        share = np.maximum(self.var_g / max(all_g, 1e-300), self.var_f / max(all_f, 1e-300))
        enough = (self.count * GRID_S >= LEAST_OVERLAP_S) & (share >= LEAST_SHARE)
        # Of what stands there is left the rounding of the transform.
        enough &= (self.var_g > 1e-9 * all_g) & (self.var_f > 1e-9 * all_f)
        size = np.sqrt(np.where(enough, self.var_g * self.var_f, 1.0))
        return np.where(enough, self.cross / size, np.nan)

    def scale(self, lag: int) -> float:
        """Filmed rate per rate of the car, by least squares."""
        return float(self.cross[lag] / self.var_g[lag])

    def _over(self, car: Floats, film: Floats) -> Floats:
        spectrum = np.fft.rfft(car, self._size) * np.conj(np.fft.rfft(film, self._size))
        return np.asarray(np.fft.irfft(spectrum, self._size))


def _masked(rate: Floats, known: Mask) -> Floats:
    middle = float(rate[known].mean()) if known.any() else 0.0
    return np.where(known, rate - middle, 0.0)


def _variation(masked: Floats, known: Mask) -> float:
    return float(np.sum(masked[known] ** 2))


def _between(value: Floats, peak: int) -> float:
    """Where between the samples a parabola through three has its top, -0.5 to 0.5."""
    if not 0 < peak < value.size - 1:
        return 0.0
    left, middle, right = value[peak - 1 : peak + 2].tolist()
    bend = left - 2.0 * middle + right
    if not (np.isfinite(bend) and bend < 0.0):
        return 0.0
    return float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5))


def _second(value: Floats, peak: int) -> float:
    """The highest value beyond the slopes of the peak, -1 where there is none."""
    filled = np.where(np.isfinite(value), value, -1.0)
    near = round(NEAR_S / GRID_S)
    low, high = peak, peak
    while low > 0 and (peak - low < near or filled[low - 1] <= filled[low]):
        low -= 1
    while high < filled.size - 1 and (high - peak < near or filled[high + 1] <= filled[high]):
        high += 1
    return float(max(filled[:low].max(initial=-1.0), filled[high + 1 :].max(initial=-1.0)))
