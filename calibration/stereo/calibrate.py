"""A stereo calibration with its verdict, from a board or from the factory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from calibration.camera import where_to_show
from calibration.errors import CalibrationError
from calibration.stereo.fit import StereoFit, fit_stereo
from calibration.stereo.sightings import PairSighting, PairSightings
from capture import StereoCalibration, ViewResidual, now_utc
from drivers.camera import read_zed_settings
from drivers.camera.zed import EyeCalibration
from geometry import Camera, Mounting, StereoPair, camera_of


@dataclass(frozen=True, kw_only=True)
class StereoLimits:
    """When a stereo calibration is accepted, and when a view is an outlier."""

    least_views: int = field(default=8, metadata={"min": 3})
    max_rms_px: float = field(default=0.5, metadata={"min": 0.0})
    max_epipolar_px: float = field(default=0.5, metadata={"min": 0.0})
    max_baseline_sigma_m: float = field(default=0.0005, metadata={"min": 0.0})
    max_turn_sigma_deg: float = field(default=0.05, metadata={"min": 0.0})
    least_coverage: float = field(default=0.5, metadata={"min": 0.0, "max": 1.0})
    outlier_ratio: float = field(default=3.0, metadata={"min": 1.0})
    """A view this many times worse than the median view is left out."""
    outlier_least_px: float = field(default=0.15, metadata={"min": 0.0})
    max_left_out: float = field(default=0.3, metadata={"min": 0.0, "max": 1.0})


def calibrate_stereo(
    seen: PairSightings,
    mounting: Mounting,
    how: Mapping[str, object],
    limits: StereoLimits = StereoLimits(),
) -> StereoCalibration:
    """The pair that explains the sightings, with a verdict; views that disagree are left out.

    Raises `CalibrationError` when there are too few boards to fit anything.
    """
    if not seen.found or seen.size_px is None:
        words = ", ".join(f"{key} {value}" for key, value in seen.board.describe().items())
        raise CalibrationError(
            f"the board was seen by both eyes in none of {seen.pictures} pictures; expected "
            f"{words}: is that the board, wholly in both halves, sharp, flat and lit?"
        )
    used, left_out, fit = _without_outliers(seen, seen.size_px, limits)
    reasons = _reasons(fit, seen.cells, len(left_out), limits)
    views = [
        ViewResidual(name=one.name, points=len(one.left), rms_px=float(off))
        for one, off in zip(used, fit.view_rms_px, strict=True)
    ]
    sigma = np.sqrt(np.diag(fit.covariance))
    return StereoCalibration(
        made_utc=now_utc(),
        accepted=not reasons,
        reasons=tuple(reasons),
        left=fit.pair.left,
        right=fit.pair.right,
        rotation=tuple(tuple(row) for row in fit.pair.rotation.tolist()),
        translation_m=tuple(fit.pair.translation.tolist()),
        mounting=mounting,
        rotation_sigma_rad=tuple(sigma[:3].tolist()),
        translation_sigma_m=tuple(sigma[3:].tolist()),
        rms_px=fit.rms_px,
        epipolar_rms_px=fit.epipolar_rms_px,
        views=(*views, *left_out),
        how={**seen.board.describe(), "pictures": seen.pictures, "without_board": seen.missing,
             "limits": limits, **how},
    )  # fmt: skip


def factory_stereo(file: Path, mode: str, mounting: Mounting) -> StereoCalibration:
    """What the factory measured, in its settings file; raises `CameraFileError`."""
    told = read_zed_settings(file, mode)
    left, right = (_camera(eye, told.eye_size_px) for eye in (told.left, told.right))
    pair = StereoPair(left, right, told.rotation, told.translation_m)
    how = {"source": "factory", "file": file.name, "mode": mode}
    return StereoCalibration.of_pair(pair, mounting, made_utc=now_utc(), how=how)


def _camera(eye: EyeCalibration, size_px: tuple[int, int]) -> Camera:
    matrix = eye.matrix
    values = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *eye.distortion]
    return camera_of(np.array(values), *size_px)


def _without_outliers(
    seen: PairSightings, size_px: tuple[int, int], limits: StereoLimits
) -> tuple[list[PairSighting], list[ViewResidual], StereoFit]:
    """Views that agree, those that do not, worst first, and the fit of the former."""
    used, left_out = list(seen.found), list[ViewResidual]()
    fit = fit_stereo(used, size_px)
    while (worst := _outlier(fit, limits)) is not None and len(used) > limits.least_views:
        if len(left_out) + 1 > limits.max_left_out * len(seen.found):
            break
        gone, off = used.pop(worst), float(fit.view_rms_px[worst])
        why = f"{off / float(np.median(fit.view_rms_px)):.1f} times as far off as the median view"
        left_out.append(ViewResidual(
            name=gone.name, points=len(gone.left), rms_px=off, used=False, why=why
        ))  # fmt: skip
        fit = fit_stereo(used, size_px)
    return used, left_out, fit


def _outlier(fit: StereoFit, limits: StereoLimits) -> int | None:
    """The worst view, if it is much worse than the others."""
    off = fit.view_rms_px
    worst = int(off.argmax())
    limit = max(limits.outlier_ratio * float(np.median(off)), limits.outlier_least_px)
    return worst if off[worst] > limit else None


def _reasons(fit: StereoFit, cells: np.ndarray, left_out: int, limits: StereoLimits) -> list[str]:
    """Everything that speaks against the calibration, each with what to do."""
    sigma = np.sqrt(np.diag(fit.covariance))
    turn_deg = float(np.degrees(sigma[:3].max()))
    views, covered = len(fit.residuals), float((cells > 0).mean())
    faults = (
        (views < limits.least_views,
         f"{views} views of the board in both eyes; take at least {limits.least_views}"),
        (not fit.rms_px <= limits.max_rms_px,
         f"residual {fit.rms_px:.2f} px, at most {limits.max_rms_px} px: is the board flat, its "
         "size right, was it held still?"),
        (not fit.epipolar_rms_px <= limits.max_epipolar_px,
         f"the eyes are {fit.epipolar_rms_px:.2f} px out of line, at most "
         f"{limits.max_epipolar_px} px: more views near the corners of the picture"),
        (covered < limits.least_coverage,
         f"the board covered {100 * covered:.0f} % of the left eye, at least "
         f"{100 * limits.least_coverage:.0f} %: show it also at the {where_to_show(cells)}"),
        (not sigma[3] <= limits.max_baseline_sigma_m,
         f"baseline known to {1e3 * sigma[3]:.2f} mm only, at most "
         f"{1e3 * limits.max_baseline_sigma_m:g} mm: more views, nearer and more tilted"),
        (not turn_deg <= limits.max_turn_sigma_deg,
         f"the eyes' turn known to {turn_deg:.3f} deg only, at most "
         f"{limits.max_turn_sigma_deg:g} deg: more views, nearer and more tilted"),
        (left_out > 0 and left_out > 0.99 * limits.max_left_out * (views + left_out),
         f"{left_out} of {views + left_out} views disagree with the others: was the board bent "
         "or the picture blurred?"),
    )  # fmt: skip
    return [text for wrong, text in faults if wrong]
