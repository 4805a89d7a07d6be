"""The floor of a track as the camera above it sees it, with the exact truth.

The scene that stands still is rendered once; a frame then costs the patches of what moves, the
light, and the noise. Grey levels 0..255 on a linear sensor; pixel (0, 0) is the middle of the
first pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from geometry import Floats, RingShape, View, at_height, transform_points
from simulation.light import Grey, Light
from simulation.marker_patch import Ring, render_ring
from simulation.surroundings import Levels, plain_floor

__all__ = ["Blur", "CarPlan", "Frame", "OverheadScene", "Ring"]


@dataclass(frozen=True)
class Blur:
    """What smears an image: the lens (sigma of a Gaussian) and the exposure."""

    psf_sigma_px: float = 0.7
    exposure_s: float = 0.0


@dataclass(frozen=True)
class CarPlan:
    """A car with two rings in a line, seen from its `base_link`. Metres.

    front_x_m, rear_x_m : the rings' centres ahead of base_link; height_m : of the rings' plane;
    size_m : length and width of the body, its middle half way between the rings.
    """

    front_x_m: float = 0.25
    rear_x_m: float = 0.05
    height_m: float = 0.2
    size_m: tuple[float, float] = (0.50, 0.28)
    shape: RingShape = field(default_factory=RingShape)

    def rings(
        self,
        pose: Floats,
        velocity_m_s: tuple[float, float] = (0.0, 0.0),
        turn_rad_s: float = 0.0,
    ) -> list[Ring]:
        """Front and rear ring of a car at `pose` (x, y, heading), base_link moving and turning."""
        arms = np.array([[self.front_x_m, 0.0], [self.rear_x_m, 0.0]])
        centres = transform_points(pose, arms)
        from_base = centres - pose[:2]
        sideways = turn_rad_s * np.stack([-from_base[:, 1], from_base[:, 0]], axis=1)
        return [
            Ring((*xy, self.height_m), self.shape, velocity_m_s=(vx, vy))
            for xy, (vx, vy) in zip(
                centres.tolist(), (sideways + velocity_m_s).tolist(), strict=True
            )
        ]

    def outline(self, pose: Floats) -> Floats:
        """The corners (4, 3) of the body's top, 2 cm below the rings."""
        half = np.array(self.size_m) / 2.0
        middle = np.array([(self.front_x_m + self.rear_x_m) / 2.0, 0.0])
        corners = middle + half * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
        return at_height(transform_points(pose, corners), self.height_m - 0.02)


@dataclass(frozen=True, eq=False)
class Frame:
    """A rendered picture and what is true in it.

    image : (h, w) uint8; centres_px : (n, 2) images of the rings' centres in the middle of the
    exposure, those that stand first, then those that move; xyz_m : (n, 3) these centres.
    """

    image: npt.NDArray[np.uint8]
    centres_px: Floats
    xyz_m: Floats


class OverheadScene:
    """The floor with what stands on it; `frame` adds what moves, the light and the noise.

    floor : (h, w) grey levels without markers, e.g. `cluttered_floor`; by default a plain one.
    """

    def __init__(
        self,
        view: View,
        rings: Sequence[Ring],
        *,
        floor: Grey | None = None,
        levels: Levels | None = None,
        blur: Blur | None = None,
    ) -> None:
        self.view, self.rings = view, tuple(rings)
        self.levels, self.blur = levels or Levels(), blur or Blur()
        shape = (view.camera.height_px, view.camera.width_px)
        if floor is None:
            floor = plain_floor(shape, np.random.default_rng(0), self.levels.floor)
        if floor.shape != shape:
            raise ValueError(f"the floor has shape {floor.shape}, the camera sees {shape}")
        self._still = self._with_rings(floor.copy(), self.rings)

    def frame(
        self,
        rng: np.random.Generator,
        *,
        moving: Sequence[Ring] = (),
        body: Floats | None = None,
        light: Light | None = None,
        noise: float = 2.5,
        gain: float = 1.0,
        occluders: Sequence[tuple[Floats, float]] = (),
        jpeg_quality: int | None = None,
    ) -> Frame:
        """One picture.

        moving : rings in this frame only; body : corners (4, 3) of the car below them. noise :
        standard deviation in grey levels. gain : exposure, values above 255 are clipped.
        occluders : polygons (k, 2) in pixels and their grey, in front of everything.
        """
        lit = self.light_of(moving=moving, body=body, light=light, gain=gain, occluders=occluders)
        if noise > 0.0:
            lit += np.float32(noise) * rng.standard_normal(lit.shape, np.float32)
        image = np.clip(np.rint(lit), 0.0, 255.0).astype(np.uint8)
        if jpeg_quality is not None:
            image = _through_jpeg(image, jpeg_quality)
        xyz = np.array([ring.xyz_m for ring in (*self.rings, *moving)]).reshape(-1, 3)
        return Frame(image, self.view.project(xyz), xyz)

    def light_of(
        self,
        *,
        moving: Sequence[Ring] = (),
        body: Floats | None = None,
        light: Light | None = None,
        gain: float = 1.0,
        occluders: Sequence[tuple[Floats, float]] = (),
    ) -> Grey:
        """What `frame` shows before noise, rounding and clipping: (h, w), a new array."""
        picture = self._still.copy()
        if body is not None:
            _fill(picture, self.view.project(body), self.levels.car)
        picture = self._with_rings(picture, moving)
        for polygon, grey in occluders:
            _fill(picture, polygon, grey)
        lit = picture if light is None else light.on(picture)
        if gain != 1.0:
            lit *= np.float32(gain)
        return lit

    def _with_rings(self, picture: Grey, rings: Sequence[Ring]) -> Grey:
        """The picture with rings laid on it in place, lower ones first."""
        for ring in sorted(rings, key=lambda one: one.xyz_m[2]):
            patch = render_ring(
                self.view,
                ring,
                self.levels.paper,
                self.levels.ring,
                exposure_s=self.blur.exposure_s,
                psf_sigma_px=self.blur.psf_sigma_px,
            )
            if patch is not None:
                patch.onto(picture)
        return picture


def _fill(picture: Grey, polygon: Floats, grey: float) -> None:
    """A polygon (k, 2) with smooth edges, in place."""
    import cv2

    fixed = np.rint(16.0 * polygon).astype(np.int32)
    cv2.fillPoly(picture, [fixed], grey, cv2.LINE_AA, 4)


def _through_jpeg(image: npt.NDArray[np.uint8], quality: int) -> npt.NDArray[np.uint8]:
    """What a camera that sends JPEG delivers."""
    import cv2

    _, packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE), np.uint8)
