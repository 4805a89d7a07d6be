"""What `join.yaml` keeps of a fit: everything that made it and everything that was left."""

from __future__ import annotations

from calibration.clocks.clock_fit import ClockFit, Seen
from calibration.clocks.network import Comparison, NetworkOffset
from capture import now_utc, software

FORMAT = 1


def fit_record(
    fit: ClockFit, network: NetworkOffset | None, comparison: Comparison | None
) -> dict[str, object]:
    """Plain values, names with units."""
    return {
        "format": FORMAT,
        "made_by": "trackside join",
        "made_utc": now_utc(),
        "software": software(),
        "equation": "t_car = t_film + offset + skew (t_film - ref)",
        "ref_ns": fit.ref_ns,
        "offset_ns": fit.offset_ns,
        "skew": fit.skew,
        "covariance": fit.covariance,
        "sigma_offset_s": fit.sigma_s,
        "sigma_offset_of_the_fit_s": fit.sigma_offset_s,
        "sigma_skew": fit.sigma_skew,
        "verdict": "good" if fit.good else "bad",
        "reasons": fit.reasons,
        "remarks": fit.remarks,
        "sources": {one.source: _source(fit, one) for one in fit.sources},
        "gyro_and_wheels_apart_s": None if fit.apart_s is None else fit.apart_s[0],
        "network": None if network is None else {
            "offset_ns": network.offset_ns,
            "sigma_s": network.sigma_s,
            "method": network.method,
            "data_minus_network_s": None if comparison is None else comparison.apart_s,
            "camera_delay_s": None if comparison is None else comparison.delay_s,
            "camera_delay_calibrated": comparison is not None and comparison.known,
        },
    }  # fmt: skip


def offset_of(fit: ClockFit, seen: Seen) -> float:
    """The offset (s) that one sensor alone gives, at the moment to which the whole fit refers."""
    assert seen.fit is not None
    own = seen.fit
    moved_s = own.skew * (fit.ref_ns - own.ref_ns) * 1e-9
    return own.base_ns * 1e-9 + own.offset_s + moved_s


def _source(fit: ClockFit, seen: Seen) -> dict[str, object]:
    told: dict[str, object] = {"used": seen.is_used, "remarks": seen.texts}
    if seen.correlation is not None:
        told |= {
            "correlation": seen.correlation.best,
            "next_correlation": seen.correlation.second,
        }
    own = seen.fit
    if own is None:
        return told
    unit = "rad" if seen.source == "gyro" else "m"
    return told | {
        "offset_s": offset_of(fit, seen),
        "sigma_offset_s": own.sigma_offset_s,
        "skew": own.skew,
        "scale": own.scale,
        "bias_rad_s" if seen.source == "gyro" else "slip_s2_m": own.extra,
        f"residual_rms_{unit}": own.residual_rms,
        f"film_scatter_{unit}": own.scatter,
        f"wander_{unit}_per_root_s": own.wander,
        f"rate_rms_{unit}_s": own.rate_rms,
        "autocorrelation": own.inflation,
        "samples": own.t_s.size,
    }
