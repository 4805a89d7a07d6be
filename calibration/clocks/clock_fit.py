"""One session's clock against another's: what gyro and wheels say, together, and whether to trust.

    t_car = t_film + offset + skew * (t_film - ref)

What the camera stamps late and what the gyro's filter delays both go into the offset
(`camera_delay` tells them from what the machines say).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.clocks.correlation import Correlation, correlated
from calibration.clocks.errors import EXCITE, ClockError
from calibration.clocks.level_fit import SKEW_SIGMA, LevelFit, fit_level
from calibration.clocks.motion import CarMotion, FilmedMotion, Source, car_grid, film_grid
from capture import FilmClock
from geometry import Floats

MOST_SIGMA_S = 2e-3
STAMPS_SIGMA_S = 0.5e-3
"""What the stamps themselves are off: a gyro's filter, the middle of an exposure."""
DISAGREE_S, DISAGREE_SIGMAS = 5e-3, 3.0
LEAST_RATE: dict[Source, float] = {"gyro": math.radians(3.0), "wheels": 0.05}
"""Below this (rad/s, m/s) the filmed car turned or changed its speed too little to be compared."""
MOST_RESIDUAL: dict[Source, float] = {"gyro": math.radians(2.0), "wheels": 0.1}
MOST_WANDER: dict[Source, float] = {"gyro": math.radians(0.7), "wheels": 0.05}
"""Two sensors that saw one car are not this far apart (rad, m; per root of a second)."""
TURNED = -0.98
MOST_RUN_S = 0.2


@dataclass(frozen=True, eq=False)
class Seen:
    """One sensor against the film: the search, and the fit where it could be made.

    silent : why its search tells nothing, which another sensor may make good; doubt : why its fit
    is not used, as of wheels that slid; reasons : what it says against the film, which nothing
    makes good.
    """

    source: Source
    correlation: Correlation | None
    fit: LevelFit | None = None
    silent: str = ""
    doubt: str = ""
    reasons: tuple[str, ...] = ()

    @property
    def is_used(self) -> bool:
        """Whether its fit counts."""
        return self.fit is not None and not self.doubt

    @property
    def texts(self) -> tuple[str, ...]:
        """Everything that is worth telling of it."""
        return tuple(text for text in (self.silent, self.doubt, *self.reasons) if text)


@dataclass(frozen=True, eq=False)
class ClockFit:
    """The film's clock on the car's: t_car = t_film + offset + skew (t_film - ref_ns).

    offset_ns : rounded to whole nanoseconds; covariance : (2, 2) of offset (s) and skew.
    sources : each sensor alone; apart_s : how far gyro and wheels are apart, and by how much they
    may be, None where only one is there. reasons : why the clocks cannot be told, empty when good.
    """

    ref_ns: int
    offset_ns: int
    skew: float
    covariance: Floats
    sources: tuple[Seen, ...]
    apart_s: tuple[float, float] | None
    reasons: tuple[str, ...]
    remarks: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Whether the clocks are told."""
        return not self.reasons

    @property
    def offset_s(self) -> float:
        """Car time minus film time at `ref_ns`."""
        return self.offset_ns * 1e-9

    @property
    def sigma_offset_s(self) -> float:
        """Standard deviation of the offset as the fit has it."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def sigma_s(self) -> float:
        """Standard deviation of the offset with what the stamps themselves may be off."""
        return math.hypot(self.sigma_offset_s, STAMPS_SIGMA_S)

    @property
    def sigma_skew(self) -> float:
        """Standard deviation of the skew."""
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def agree(self) -> bool | None:
        """Whether gyro and wheels say the same; None where only one of them speaks."""
        return None if self.apart_s is None else self.apart_s[0] <= self.apart_s[1]

    def film_clock(self) -> FilmClock:
        """What a joined session keeps of it."""
        return FilmClock(
            offset_ns=self.offset_ns,
            skew=self.skew,
            ref_ns=self.ref_ns,
            sigma_ns=round(self.sigma_s * 1e9),
            sigma_skew=self.sigma_skew,
            method="the filmed car against its "
            + " and ".join(one.source for one in self.sources if one.is_used),
        )


def fit_clock(
    motions: Sequence[tuple[CarMotion, FilmedMotion]], most_sigma_s: float = MOST_SIGMA_S
) -> ClockFit:
    """The clocks as the motion of the car tells them; each sensor with what the film saw of it.

    most_sigma_s : an offset that is less well known is no good.

    Raises `ClockError` where no sensor finds the one offset at which the two look alike. A fit that
    is too uncertain or contradicts itself is given, with its `reasons`.
    """
    found = [_searched(car, film) for car, film in motions]
    clear = [one.correlation for one in found if not one.silent and not one.reasons]
    seen = tuple(
        _fitted(car, film, one, clear[0]) if clear and clear[0] is not None else one
        for one, (car, film) in zip(found, motions, strict=True)
    )
    fits = [one.fit for one in seen if one.fit is not None and one.is_used]
    if not fits:
        told = [text for one in seen for text in one.texts]
        raise ClockError("\n".join([
            "the motion of the car does not tell the clocks apart:",
            *(f"  {text}" for text in told),
            f"Is it the film of this run? If so: {EXCITE}",
        ]))  # fmt: skip
    return _together(seen, fits, most_sigma_s)


def _searched(car: CarMotion, film: FilmedMotion) -> Seen:
    """The correlation over all offsets, and why it tells nothing."""
    name = car.source
    if film.t_ns.size < 2 or car.t_ns.size < 2:
        return Seen(name, None, silent=f"{name}: there is less than a second of it")
    grid = film_grid(film)
    known = grid.rate[grid.known]
    spread = float(known.std()) if known.size else 0.0
    if spread < LEAST_RATE[name]:
        text = f"{name}: the filmed car {_STEADY[name]} ({_rate(name, spread)})"
        return Seen(name, None, silent=text)
    found = correlated(car_grid(car), grid)
    if found is None:
        return Seen(
            name, None, silent=f"{name}: no overlap of the two leaves enough motion in both"
        )
    if found.turned <= TURNED and -found.turned > found.best:
        text = (
            f"{name}: it tells the motion of the film with the opposite sign (correlation "
            f"{found.turned:.3f}): {_SIGNED[name]}"
        )
        return Seen(name, found, reasons=(text,))
    if found.stands_out:
        return Seen(name, found)
    text = (
        f"{name}: no offset stands out, the best correlation is {found.best:.3f} and the next one "
        f"elsewhere {found.second:.3f}"
    )
    return Seen(name, found, silent=text)


def _fitted(car: CarMotion, film: FilmedMotion, seen: Seen, clear: Correlation) -> Seen:
    """The fit of one sensor; one whose own search tells nothing begins where another stands out."""
    found = seen.correlation
    if found is None or seen.reasons:
        return seen
    guess = clear if seen.silent else found
    fit = fit_level(car, film, guess.offset_ns, 1.0 if car.scale_known else found.scale)
    if fit is None:
        return replace(seen, silent=f"{car.source}: less than a second overlaps")
    too_far = fit.residual_rms > MOST_RESIDUAL[car.source] or fit.wander > MOST_WANDER[car.source]
    doubt = (
        f"{car.source}: what is left of the motion is {_level(car.source, fit.residual_rms)} rms "
        f"and wanders by {_level(car.source, fit.wander)} per root of a second: "
    )
    if too_far and car.source == "wheels":
        return replace(seen, fit=fit, doubt=doubt + "did they slide, or is it another run?")
    reasons = [doubt + "is the film that of another run?"] if too_far else []
    if abs(fit.offset_s) > MOST_RUN_S:
        reasons.append(f"{car.source}: the fit ran away from the peak by {fit.offset_s:+.2f} s")
    return replace(seen, fit=fit, reasons=tuple(reasons))


def _together(seen: tuple[Seen, ...], fits: Sequence[LevelFit], most_sigma_s: float) -> ClockFit:
    """All sensors, by their information; the skew's prior counts once."""
    ref_ns, base_ns = fits[0].ref_ns, fits[0].base_ns
    prior = np.diag([0.0, SKEW_SIGMA**-2])
    information, told = prior, np.zeros(2)
    offsets = []
    for fit in fits:
        own_ns = fit.base_ns - base_ns
        offset = own_ns * 1e-9 + fit.offset_s + fit.skew * (ref_ns - fit.ref_ns) * 1e-9
        offsets.append((offset, fit.sigma_offset_s))
        own = np.linalg.inv(fit.covariance)
        information = information + own - prior
        # The prior of the skew is at zero and takes nothing from the right-hand side.
        told = told + own @ (offset, fit.skew)
    covariance = np.linalg.inv(information)
    offset, skew = covariance @ told
    apart = None
    if len(offsets) == 2:
        (first, sigma), (second, other) = offsets
        apart = abs(first - second), DISAGREE_S + DISAGREE_SIGMAS * math.hypot(sigma, other)
    sigma = math.hypot(float(np.sqrt(covariance[0, 0])), STAMPS_SIGMA_S)
    return ClockFit(
        ref_ns=ref_ns,
        offset_ns=base_ns + round(float(offset) * 1e9),
        skew=float(skew),
        covariance=covariance,
        sources=seen,
        apart_s=apart,
        reasons=(
            *(text for one in seen for text in one.reasons),
            *_reasons(sigma, most_sigma_s, apart),
        ),
        remarks=tuple(
            f"not used, {one.doubt or one.silent}"
            for one in seen
            if not one.is_used and (one.doubt or one.silent)
        ),
    )


def _reasons(
    sigma_s: float, most_sigma_s: float, apart: tuple[float, float] | None
) -> tuple[str, ...]:
    reasons = []
    if sigma_s > most_sigma_s:
        reasons.append(
            f"the offset is known to {1e3 * sigma_s:.1f} ms only (one sigma), at most "
            f"{1e3 * most_sigma_s:g} ms are needed; {EXCITE}; wheels alone know it to some "
            "milliseconds (--most-sigma)"
        )
    if apart is not None and apart[0] > apart[1]:
        reasons.append(
            f"gyro and wheels are {1e3 * apart[0]:.1f} ms apart, their uncertainty allows "
            f"{1e3 * apart[1]:.1f} ms: is one of them stamped late, do the wheels spin? Leave one "
            "out with --without"
        )
    return tuple(reasons)


_STEADY: dict[Source, str] = {
    "gyro": "hardly turned, or turned evenly",
    "wheels": "hardly changed its speed",
}
_SIGNED: dict[Source, str] = {
    "gyro": "z of the IMU must point up; turn the IMU over, or change the sign in its driver",
    "wheels": "set vesc_calibration.direction of the rig to the other sign",
}


def _rate(source: Source, value: float) -> str:
    return f"{math.degrees(value):.1f} deg/s" if source == "gyro" else f"{value:.2f} m/s"


def _level(source: Source, value: float) -> str:
    return f"{math.degrees(value):.2f} deg" if source == "gyro" else f"{1e3 * value:.0f} mm"
