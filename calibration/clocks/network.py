"""The film's clock on the car's as the machines told each other, and whether the data agree."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.clocks.clock_fit import DISAGREE_SIGMAS, ClockFit
from calibration.clocks.level_fit import SKEW_SIGMA
from capture import CameraDelayCalibration, ClockPair, PeerClock, SessionInfo

UNKNOWN_DELAY_S = 10e-3
"""How late or early a camera may stamp of which nobody knows it; one sigma."""
ALLOWANCE_S = 2e-3
SAME_MACHINE_SIGMA_S = 1e-5


@dataclass(frozen=True)
class NetworkOffset:
    """Car time minus film time at a moment of the film, and how it is known."""

    offset_ns: int
    sigma_s: float
    method: str


@dataclass(frozen=True)
class Comparison:
    """Data minus network, what the camera's delay explains of it, how far apart they may be.

    delay_s : the camera's, and its standard deviation; known : whether that was calibrated.
    """

    apart_s: float
    delay_s: float
    sigma_s: float
    known: bool

    @property
    def limit_s(self) -> float:
        """How far from the camera's delay the difference may be."""
        return DISAGREE_SIGMAS * self.sigma_s + ALLOWANCE_S

    @property
    def agrees(self) -> bool:
        """Whether network and data say the same."""
        return abs(self.apart_s - self.delay_s) <= self.limit_s


@dataclass(frozen=True)
class _Point:
    film_ns: int
    offset_ns: int
    sigma_s: float


def network_offset(
    car: SessionInfo, film: SessionInfo, peers: Sequence[PeerClock], ref_ns: int
) -> tuple[NetworkOffset | None, tuple[str, ...]]:
    """The offset at a time of the film, None where the machines did not see each other; remarks.

    peers : what the car's recorder was told, and what `trackside clock ask` kept.
    """
    if not car.clocks or not film.clocks:
        return None, ("network: a session without its own clocks cannot be compared",)
    if car.boot_id and car.boot_id == film.boot_id:
        offset_ns = _line_ns(car.clocks[0]) - _line_ns(film.clocks[0])
        return NetworkOffset(offset_ns, SAME_MACHINE_SIGMA_S, "recorded on one machine"), ()
    points: list[_Point] = []
    remarks: list[str] = []
    for peer in peers:
        told = _point(car, film, peer)
        if isinstance(told, str):
            remarks.append(f"network: {peer.peer} not used, {told}")
        else:
            points.append(told)
    if not points:
        return None, tuple(remarks)
    return _at(points, ref_ns), tuple(remarks)


def compared(
    fit: ClockFit, network: NetworkOffset, delay: CameraDelayCalibration | None
) -> Comparison:
    """How the data's offset compares with the network's; delay : of the camera, if calibrated."""
    apart_s = (fit.offset_ns - network.offset_ns) * 1e-9
    known = delay is not None and delay.accepted
    delay_s, own = (delay.delay_s, math.hypot(delay.sigma_s, delay.scatter_s)) if (
        delay is not None and known
    ) else (0.0, UNKNOWN_DELAY_S)  # fmt: skip
    sigma_s = math.sqrt(fit.sigma_s**2 + network.sigma_s**2 + own**2)
    return Comparison(apart_s, delay_s, sigma_s, known)


def disagreement(fit: ClockFit, network: NetworkOffset, found: Comparison) -> str:
    """The reason why the two cannot both be right."""
    late = f"the camera's delay of {1e3 * found.delay_s:+.1f} ms" if found.known else (
        "a camera's delay that is not calibrated"
    )  # fmt: skip
    return (
        f"network and data disagree: the data say {fit.offset_s:+.4f} s (sigma "
        f"{1e3 * fit.sigma_s:.2f} ms), the network {network.offset_ns * 1e-9:+.4f} s (sigma "
        f"{1e3 * network.sigma_s:.2f} ms, {network.method}), {1e3 * found.apart_s:+.1f} ms apart; "
        f"with {late} at most {1e3 * found.limit_s:.1f} ms are believed: is it the film of this "
        "run, was a clock set meanwhile, does the camera stamp late (trackside calibrate "
        "camera-delay)? --trust-data joins all the same"
    )


def _line_ns(pair: ClockPair) -> int:
    """UTC of a session minus the monotonic clock of its machine."""
    return pair.utc_ns - pair.monotonic_ns


def _point(car: SessionInfo, film: SessionInfo, peer: PeerClock) -> _Point | str:
    """Car time minus film time as one asking tells it, or why it tells nothing."""
    if film.boot_id and film.boot_id == peer.own_boot_id:
        peer = _reversed(peer)  # asked on the laptop, of the car
    if car.boot_id and peer.own_boot_id and car.boot_id != peer.own_boot_id:
        return "it was not asked on the car while it ran as during this recording"
    if film.boot_id and peer.boot_id and film.boot_id != peer.boot_id:
        return "it is not the machine that filmed, or was started anew since"
    car_ns = peer.monotonic_ns + _line_ns(car.clocks[0])
    if film.boot_id and peer.boot_id:
        film_ns = peer.monotonic_ns + peer.offset_monotonic_ns + _line_ns(film.clocks[0])
    else:  # nobody knows whose monotonic clock it was: by UTC, if no clock was set since
        film_ns = peer.utc_ns + peer.offset_utc_ns
    return _Point(film_ns, car_ns - film_ns, peer.uncertainty_ns * 1e-9)


def _reversed(peer: PeerClock) -> PeerClock:
    return replace(
        peer,
        monotonic_ns=peer.monotonic_ns + peer.offset_monotonic_ns,
        utc_ns=peer.utc_ns + peer.offset_utc_ns,
        offset_monotonic_ns=-peer.offset_monotonic_ns,
        offset_utc_ns=-peer.offset_utc_ns,
        boot_id=peer.own_boot_id,
        own_boot_id=peer.boot_id,
    )


def _at(points: Sequence[_Point], ref_ns: int) -> NetworkOffset:
    """A line through the points, its skew known to 50 ppm before."""
    base_ns = points[0].offset_ns
    weight = np.array([max(one.sigma_s, 1e-6) ** -2 for one in points])
    apart_s = np.array([(one.offset_ns - base_ns) * 1e-9 for one in points])
    t_s = np.array([(one.film_ns - ref_ns) * 1e-9 for one in points])
    slopes = np.stack([np.ones(t_s.size), t_s], axis=1)
    information = (slopes * weight[:, None]).T @ slopes + np.diag([0.0, SKEW_SIGMA**-2])
    covariance = np.linalg.inv(information)
    offset_s = float((covariance @ (slopes.T @ (weight * apart_s)))[0])
    many = f"asked {len(points)} times" if len(points) > 1 else "asked once"
    return NetworkOffset(
        base_ns + round(offset_s * 1e9),
        math.sqrt(float(covariance[0, 0])),
        f"{many} over the network",
    )
