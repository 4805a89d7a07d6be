"""The inside of a camera from pictures of a board: found, fitted, outliers left out, judged."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from calibration.board import Board, BoardSighting
from calibration.errors import CalibrationError
from calibration.intrinsics import IntrinsicsFit, fit_intrinsics, sigmas
from calibration.pictures import Picture
from capture import CameraCalibration, ViewResidual, now_utc
from geometry import Floats

CELLS = (8, 6)
"""Columns and rows of the map of coverage."""


@dataclass(frozen=True, kw_only=True)
class CameraLimits:
    """When a calibration is accepted, and when a view is an outlier."""

    least_views: int = field(default=8, metadata={"min": 3})
    max_rms_px: float = field(default=0.5, metadata={"min": 0.0})
    least_coverage: float = field(default=0.6, metadata={"min": 0.0, "max": 1.0})
    least_tilt_deg: float = field(default=15.0, metadata={"min": 0.0, "max": 80.0})
    """Of the most tilted board: square-on boards do not tell focal length from distance."""
    max_focal_sigma: float = field(default=0.005, metadata={"min": 0.0})
    """Standard deviation over focal length."""
    max_centre_sigma_px: float = field(default=4.0, metadata={"min": 0.0})
    outlier_ratio: float = field(default=3.0, metadata={"min": 1.0})
    """A view this many times worse than the median view is left out."""
    outlier_least_px: float = field(default=0.15, metadata={"min": 0.0})
    """A view better than this is never left out."""
    max_left_out: float = field(default=0.3, metadata={"min": 0.0, "max": 1.0})


@dataclass(frozen=True, eq=False)
class CameraResult:
    """A calibration, and what its picture shows of it: the fit, its sightings, cells covered."""

    calibration: CameraCalibration
    fit: IntrinsicsFit
    used: tuple[BoardSighting, ...]
    cells: Floats


@dataclass
class Sightings:
    """Boards found so far, in pictures of one size.

    fresh_px : with it, pictures that show the board nearly where an earlier one did are passed
    over, as a video or a live camera has many of those; None keeps all.
    """

    board: Board
    fresh_px: float | None = None
    found: list[BoardSighting] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    size_px: tuple[int, int] | None = None
    pictures: int = 0

    def add(self, picture: Picture) -> BoardSighting | None:
        """Look for the board; the sighting if it is a new one."""
        size = (picture.image.shape[1], picture.image.shape[0])
        self.size_px = self.size_px or size
        if size != self.size_px:
            raise CalibrationError(
                f"{picture.name}: has {size[0]}x{size[1]} pixels, the pictures before it "
                f"{self.size_px[0]}x{self.size_px[1]}; a calibration is for one resolution"
            )
        self.pictures += 1
        sighting = self.board.find(picture.image, picture.name)
        if sighting is None:
            self.missing.append(picture.name)
            return None
        if self.fresh_px is not None and self._is_known(sighting):
            return None
        self.found.append(sighting)
        return sighting

    def add_all(
        self, pictures: Iterable[Picture], told: Callable[[Sightings], None] = lambda _: None
    ) -> None:
        """Look at every picture; `told` is called after each."""
        for picture in pictures:
            self.add(picture)
            told(self)

    @property
    def cells(self) -> Floats:
        """Points in each cell of the picture, rows x columns."""
        return coverage_cells(self.found, self.size_px or (1, 1))

    def _is_known(self, sighting: BoardSighting) -> bool:
        assert self.fresh_px is not None
        return any(_apart(sighting, old) < self.fresh_px for old in self.found)


def calibrate_camera(
    seen: Sightings, how: Mapping[str, object], limits: CameraLimits = CameraLimits()
) -> CameraResult:
    """The camera that explains the sightings, with a verdict.

    Views that do not agree with the others are left out, worst first, and named. Raises
    `CalibrationError` when there are too few boards to fit anything.
    """
    if not seen.found or seen.size_px is None:
        kind = seen.board.describe()
        raise CalibrationError(
            f"the board was seen in none of {seen.pictures} pictures; expected "
            f"{', '.join(f'{key} {value}' for key, value in kind.items())}: is that the board, "
            "wholly in the picture, sharp, flat and lit?"
        )
    used, left_out = list(seen.found), list[ViewResidual]()
    fit = fit_intrinsics(used, seen.size_px, seen.board.radius_m)
    while (worst := _outlier(fit, limits)) is not None and len(used) > limits.least_views:
        if len(left_out) + 1 > limits.max_left_out * len(seen.found):
            break
        gone = used.pop(worst)
        off = float(fit.view_rms_px[worst])
        why = f"{off / float(np.median(fit.view_rms_px)):.1f} times as far off as the median view"
        left_out.append(ViewResidual(
            name=gone.name, points=len(gone.pixels), rms_px=off, used=False, why=why
        ))  # fmt: skip
        fit = fit_intrinsics(used, seen.size_px, seen.board.radius_m)
    cells = coverage_cells(used, seen.size_px)
    reasons = _reasons(fit, cells, len(left_out), limits)
    views = [
        ViewResidual(name=one.name, points=len(one.pixels), rms_px=float(off))
        for one, off in zip(used, fit.view_rms_px, strict=True)
    ]
    calibration = CameraCalibration(
        made_utc=now_utc(),
        accepted=not reasons,
        reasons=tuple(reasons),
        camera=fit.camera,
        covariance=tuple(tuple(row) for row in fit.covariance.tolist()),
        rms_px=fit.rms_px,
        coverage=float((cells > 0).mean()),
        views=(*views, *left_out),
        how={**seen.board.describe(), "pictures": seen.pictures, "without_board": seen.missing,
             "limits": limits, **how},
    )  # fmt: skip
    return CameraResult(calibration, fit, tuple(used), cells)


def coverage_cells(sightings: Sequence[BoardSighting], size_px: tuple[int, int]) -> Floats:
    """How many points fell into each cell of the picture, rows x columns of `CELLS`."""
    if not sightings:
        return np.zeros(CELLS[::-1])
    points = np.concatenate([one.pixels for one in sightings])
    width, height = size_px
    extent = ((-0.5, height - 0.5), (-0.5, width - 0.5))
    counts, _, _ = np.histogram2d(points[:, 1], points[:, 0], CELLS[::-1], extent)
    return np.asarray(counts, np.float64)


def where_to_show(cells: Floats) -> str:
    """Where in the picture the board was seen least, in words; nothing once it was everywhere."""
    if (cells > 0).all():
        return ""
    down, across = np.nonzero(cells == 0)
    thirds = np.zeros((3, 3))
    np.add.at(thirds, (down * 3 // cells.shape[0], across * 3 // cells.shape[1]), 1)
    row, column = np.unravel_index(int(thirds.argmax()), (3, 3))
    words = (("top", "middle", "bottom")[int(row)], ("left", "centre", "right")[int(column)])
    return " ".join(words)


def _apart(one: BoardSighting, other: BoardSighting) -> float:
    """The mean distance in pixels of the points that both have; infinite if they share few."""
    places = {tuple(point): i for i, point in enumerate(other.points_m.tolist())}
    pairs = [
        (i, places[key]) for i, p in enumerate(one.points_m.tolist()) if (key := tuple(p)) in places
    ]
    if len(pairs) < 0.7 * max(len(one.pixels), len(other.pixels)):
        return np.inf
    own, theirs = np.array(pairs).T
    return float(np.linalg.norm(one.pixels[own] - other.pixels[theirs], axis=1).mean())


def _outlier(fit: IntrinsicsFit, limits: CameraLimits) -> int | None:
    """The worst view, if it is much worse than the others."""
    off = fit.view_rms_px
    worst = int(off.argmax())
    limit = max(limits.outlier_ratio * float(np.median(off)), limits.outlier_least_px)
    return worst if off[worst] > limit else None


def _reasons(fit: IntrinsicsFit, cells: Floats, left_out: int, limits: CameraLimits) -> list[str]:
    """Everything that speaks against the calibration, each with what to do."""
    sigma = sigmas(fit.covariance)
    focal = float(max(sigma[0] / fit.camera.fx, sigma[1] / fit.camera.fy))
    centre = float(sigma[2:4].max())
    tilt_deg = float(np.degrees(fit.tilts_rad.max()))
    views, covered = len(fit.views), float((cells > 0).mean())
    share = left_out / (views + left_out)
    faults = (
        (views < limits.least_views,
         f"{views} views of the board; take at least {limits.least_views}"),
        (not fit.rms_px <= limits.max_rms_px,
         f"residual {fit.rms_px:.2f} px, at most {limits.max_rms_px} px: is the board flat, its "
         "size right, the focus locked?"),
        (covered < limits.least_coverage,
         f"the board covered {100 * covered:.0f} % of the picture, at least "
         f"{100 * limits.least_coverage:.0f} %: show it also at the {where_to_show(cells)}"),
        (tilt_deg < limits.least_tilt_deg,
         f"no board was tilted by more than {tilt_deg:.0f} degrees: tilt it by 30"),
        (not focal <= limits.max_focal_sigma,
         f"focal length known to {100 * focal:.2f} % only, at most "
         f"{100 * limits.max_focal_sigma:g} %: more views, more tilted"),
        (not centre <= limits.max_centre_sigma_px,
         f"principal point known to {centre:.1f} px only, at most {limits.max_centre_sigma_px:g} "
         "px: more views, turned and towards the corners"),
        (share > 0.99 * limits.max_left_out and left_out > 0,
         f"{left_out} of {views + left_out} views disagree with the others: was the board bent "
         "or the picture blurred?"),
    )  # fmt: skip
    return [text for wrong, text in faults if wrong]
