"""All ring markers in one picture, without knowing anything before."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from geometry import Floats, RingShape
from tracking.candidates import ring_candidates
from tracking.ellipses import Ellipses, refine_ellipses
from tracking.images import Image, grey_image
from tracking.profiles import sample, spokes

_ANGLES = 24
_RADII = np.linspace(0.0, 1.3, 27)
_MAX_CANDIDATES = 2000
_BORDER_PX = 2.0
_UNEVEN = 0.08
"""Standard deviation of the hole's radius around the middle, in radii of the ring."""


@dataclass(frozen=True, kw_only=True)
class RingSearch:
    """What a ring looks like, and when something is one.

    The same values serve every camera; only `smallest_px` trades time for small markers.
    """

    shape: RingShape = field(default_factory=RingShape)
    smallest_px: float = field(default=20.0, metadata={"min": 4.0})
    """Smallest diameter, across the shorter axis, that must be found."""
    below_mean: float = field(default=7.0, metadata={"min": 1.0, "max": 100.0})
    """Grey levels by which black must be darker than the mean around it."""
    min_contrast: float = field(default=12.0, metadata={"min": 1.0, "max": 255.0})
    """Grey levels between paper and ring."""
    ratio_tolerance: float = field(default=0.10, metadata={"min": 0.0, "max": 0.5})
    """Of the inner over the outer diameter; people print 0.37 to 0.50 and call it a ring."""
    max_lumps: float = field(default=0.012, metadata={"min": 0.0, "max": 1.0})
    """Third and fourth harmonic of the edge around its ellipse, in mean radii: corners."""
    max_residual: float = field(default=0.015, metadata={"min": 0.0, "max": 1.0})
    """Scatter of the edge around its ellipse, in mean radii."""
    min_inliers: float = field(default=0.75, metadata={"min": 0.0, "max": 1.0})
    """Share of the outer edge's lines that must agree."""
    flattest: float = field(default=0.25, metadata={"min": 0.0, "max": 1.0})
    """Shorter axis over longer one: how obliquely a marker may be seen."""


@dataclass(frozen=True, eq=False)
class RingSightings:
    """Rings in a picture, n of them, in no order that means anything.

    centres_px : (n, 2) of the outer edge's ellipse, which is *not* quite the image of the ring's
    centre (`geometry.circle_centres` removes that). shapes : (n, 2, 2) carries the unit circle to
    pixels round the centre. ratio : (n,) inner over outer diameter. contrast : (n,) grey levels.
    residual_px : (n,). covariance_px : (n, 2, 2) of the centre.
    """

    centres_px: Floats
    shapes: Floats
    ratio: Floats
    contrast: Floats
    residual_px: Floats
    covariance_px: Floats

    def __len__(self) -> int:
        return len(self.centres_px)

    def take(self, which: npt.NDArray[np.generic]) -> RingSightings:
        """Some of them, by index or mask."""
        return RingSightings(
            self.centres_px[which], self.shapes[which], self.ratio[which],
            self.contrast[which], self.residual_px[which], self.covariance_px[which],
        )  # fmt: skip

    @property
    def diameters_px(self) -> Floats:
        """Longer and shorter axis (n, 2) of the outer edges."""
        return np.asarray(2.0 * np.linalg.svd(self.shapes, compute_uv=False), np.float64)


def find_rings(
    image: npt.NDArray[np.generic] | None,
    search: RingSearch | None = None,
    region: tuple[slice, slice] | None = None,
) -> RingSightings:
    """The rings in a picture, or in the part (rows, columns) of it; pixels are the whole picture's.

    A ring must lie inside the picture with two pixels to spare. Raises `ImageError` for what is no
    8-bit picture; a black, white or tiny one simply shows no rings.
    """
    grey, search = grey_image(image), search or RingSearch()
    centres, halves = _candidates(grey, search, region)
    if not len(centres):
        return _sightings(_nothing(), np.zeros(0), np.zeros(0))
    found = refine_ellipses(grey, centres, halves)
    found = found.take(_plausible(found, grey, search))
    if not len(found.centres):
        return _sightings(found, np.zeros(0), np.zeros(0))
    ratio, contrast, good = _looks_inside(grey, found, search)
    found, ratio, contrast = found.take(good), ratio[good], contrast[good]
    once = _once_each(found)
    return _sightings(found.take(once), ratio[once], contrast[once])


def _candidates(
    grey: Image, search: RingSearch, region: tuple[slice, slice] | None
) -> tuple[Floats, Floats]:
    part = grey if region is None else grey[region]
    corner = np.zeros(2)
    if region is not None:
        corner = np.array(
            [region[1].indices(grey.shape[1])[0], region[0].indices(grey.shape[0])[0]]
        )
    centres, halves = ring_candidates(
        part, search.smallest_px, search.shape.ratio, search.below_mean
    )
    if len(centres) > _MAX_CANDIDATES:
        # A texture of rings; the largest are the ones a person would mean.
        order = np.argsort(-halves.min(axis=1))[:_MAX_CANDIDATES]
        centres, halves = centres[order], halves[order]
    return centres + corner, halves


def _plausible(found: Ellipses, grey: Image, search: RingSearch) -> npt.NDArray[np.bool_]:
    axes = np.linalg.svd(found.shapes, compute_uv=False)
    radius = np.sqrt(axes[:, 0] * axes[:, 1])
    reach = np.sqrt((found.shapes**2).sum(axis=2)) + _BORDER_PX
    size = np.array([grey.shape[1], grey.shape[0]])
    inside = (found.centres - reach >= 0.0) & (found.centres + reach <= size - 1.0)
    result: npt.NDArray[np.bool_] = (
        inside.all(axis=1)
        & (found.contrast >= search.min_contrast)
        & (found.inliers >= search.min_inliers)
        & (found.residual_px <= search.max_residual * radius + 0.1)
        & (found.lumps_px <= search.max_lumps * radius + 0.03)
        & (axes[:, 1] >= search.flattest * axes[:, 0])
        & (2.0 * axes[:, 1] >= 0.8 * search.smallest_px)
    )
    return result


def _looks_inside(
    grey: Image, found: Ellipses, search: RingSearch
) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Inner over outer diameter, contrast, and whether it is white, black, white all around."""
    around = np.einsum("nij,nkj->nki", found.shapes, spokes(found.shapes, _ANGLES))
    points = found.centres[:, None, None] + around[:, :, None] * _RADII[:, None]
    flat = points.reshape(len(points), -1, 2).astype(np.float32)
    levels = sample(grey, flat).reshape(len(points), _ANGLES, _RADII.size)
    ratio = search.shape.ratio
    middle = levels[:, :, (_RADII > 0.0) & (0.6 * ratio >= _RADII)].mean(axis=2)
    black = levels[:, :, (ratio + 0.2 < _RADII) & (_RADII < 0.85)].mean(axis=2)
    margin = levels[:, :, (_RADII > 1.12) & (_RADII < 1.25)].mean(axis=2)
    contrast = np.minimum(middle, margin) - black
    typical = np.median(contrast, axis=1)
    whole = (contrast > 0.35 * typical[:, None]).mean(axis=1)
    # Width of the white inside along each spoke, from the area under its profile.
    within = _RADII <= 0.82
    area = (levels[:, :, within] - black[:, :, None]).sum(axis=2) - 0.5 * (middle - black)
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = area / (middle - black) * (_RADII[1] - _RADII[0]) + 0.5 * _RADII[1]
    inner = np.where(np.isfinite(inner), inner, 9.0)
    measured = np.median(inner, axis=1)
    uneven = 1.25 * np.abs(np.clip(inner, 0.0, 1.0) - measured[:, None]).mean(axis=1)
    good = (
        (typical >= search.min_contrast)
        & (whole >= 0.85)
        & (np.abs(measured - ratio) <= search.ratio_tolerance)
        & (uneven <= _UNEVEN)
    )
    return measured, typical, good


def _once_each(found: Ellipses) -> npt.NDArray[np.int64]:
    """Of ellipses that cover each other the one that fits best."""
    radius = np.sqrt(np.abs(np.linalg.det(found.shapes)))
    kept: list[int] = []
    for i in np.argsort(found.residual_px / radius):
        apart = np.linalg.norm(found.centres[kept] - found.centres[i], axis=1)
        if (apart > np.maximum(radius[kept], radius[i])).all():
            kept.append(int(i))
    return np.array(sorted(kept), np.int64)


def _sightings(found: Ellipses, ratio: Floats, contrast: Floats) -> RingSightings:
    return RingSightings(
        found.centres, found.shapes, ratio, contrast, found.residual_px, found.covariance
    )


def _nothing() -> Ellipses:
    none, matrices = np.zeros(0), np.zeros((0, 2, 2))
    return Ellipses(np.zeros((0, 2)), matrices, none, none, none, none, matrices)
