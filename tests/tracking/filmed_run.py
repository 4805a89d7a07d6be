"""A rendered drive among cones, and its exact truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from capture import PlacedMarker, WorldCalibration
from geometry import Floats, RingShape, View, looking_at, wrap
from geometry.camera import Camera
from simulation import Blur, CarPlan, OverheadScene, Ring
from tracking.film import Film, FilmFrame
from tracking.images import Image
from tracking.scene import CarRings, ConeRings, Scene

RATE_HZ = 30.0
STILL_S = 0.6
CAMERA = Camera(960, 720, 640.0, 638.0, 476.0, 365.0, (-0.10, 0.02, 0.0004, -0.0003, 0.0))
VIEW = looking_at(CAMERA, np.array([0.1, -0.4, 2.4]), np.array([0, 0.0, 0]), np.array([0, 1.0, 0]))
CORNERS = np.array([[-1.0, -0.8], [1.0, -0.8], [1.0, 0.8], [-1.0, 0.8]])
CONES = np.array([[-0.45, -0.15], [0.3, 0.2], [0.55, -0.35]])
SCENE = Scene(car=CarRings(), cones=ConeRings(), settle_s=0.5)
PLAN = CarPlan()
Change = Callable[[int, Image], Image | None]


def world(view: View = VIEW, corners: Floats = CORNERS, accepted: bool = True) -> WorldCalibration:
    """The exact calibration, known to a fraction of a millimetre."""
    sigma = np.array([0.1, 0.1, 0.05, 0.05, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5, *[1e-4] * 6])
    markers = tuple(
        PlacedMarker(
            name=f"c{k + 1}",
            xyz_m=(x, y, 0.0),
            covariance_m2=(1e-8, 0.0, 1e-8),
            residual_px=0.01,
            corner=k + 1,
        )
        for k, (x, y) in enumerate(corners.tolist())
    )
    x, y, z = view.translation.tolist()
    return WorldCalibration(
        made_utc="2026-05-14T10:00:00Z",
        accepted=accepted,
        reasons=() if accepted else ("a length was mistyped",),
        camera=view.camera,
        rotation=tuple(tuple(row) for row in view.rotation.tolist()),
        translation_m=(x, y, z),
        covariance=tuple(tuple(row) for row in np.diag(sigma**2).tolist()),
        ring=RingShape(),
        markers=markers,
        lengths=(),
        accuracy_m={},
    )


@dataclass
class Run:
    """A car that stands, then drives an arc; frames as they are asked for.

    change : what happens to a frame's picture, None being a damaged one; bump : the frame from
    which cone 2 stands elsewhere.
    """

    frames: int = 45
    speed_m_s: float = 1.0
    turn_rad_s: float = 1.2
    start: Floats = field(default_factory=lambda: np.array([-0.5, -0.45, 0.2]))
    change: Change = lambda _, image: image
    hidden_cones: bool = False
    bump: int | None = None
    occluded: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        t_s = np.arange(self.frames) / RATE_HZ
        self.t_ns = np.rint(t_s * 1e9).astype(np.int64) + 1_000_000_000_000
        driven_s = np.maximum(t_s - STILL_S, 0.0)
        # A smooth start: accelerating for 0.3 s.
        travelled = self.speed_m_s * np.where(driven_s < 0.3, driven_s**2 / 0.6, driven_s - 0.15)
        heading = self.start[2] + self.turn_rad_s / self.speed_m_s * travelled
        step = np.diff(travelled, prepend=0.0)
        middle = heading - self.turn_rad_s / self.speed_m_s * step / 2.0
        x = self.start[0] + np.cumsum(step * np.cos(middle))
        y = self.start[1] + np.cumsum(step * np.sin(middle))
        self.poses = np.stack([x, y, wrap(heading)], axis=1)

    def film(self) -> Film:
        """What the camera delivers."""
        return Film("run", self.frames, "middle of the exposure", self._frames)

    def _frames(self) -> Iterator[FilmFrame]:
        rng = np.random.default_rng(1)
        blur = Blur(psf_sigma_px=0.6)
        whole = OverheadScene(VIEW, self._rings(CONES), blur=blur)
        moved = CONES.copy()
        moved[1] += (0.03, 0.02)
        after = whole if self.bump is None else OverheadScene(VIEW, self._rings(moved), blur=blur)
        for k in range(self.frames):
            pose = self.poses[k]
            scene = whole if self.bump is None or k < self.bump else after
            low, high = self.occluded
            sheet = []
            if low <= k < high:
                middle = VIEW.project(np.array([*pose[:2], 0.2]))
                sheet = [(middle + 110.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), 90.0)]
            shown = scene.frame(
                rng, moving=PLAN.rings(pose), body=PLAN.outline(pose), occluders=sheet
            )
            image = self.change(k, shown.image)
            yield FilmFrame(
                k, int(self.t_ns[k]), image, "" if image is not None else "damaged: cut"
            )

    def _rings(self, cones: Floats) -> list[Ring]:
        places = CORNERS if self.hidden_cones else np.concatenate([CORNERS, cones])
        return [Ring((x, y, 0.0)) for x, y in places.tolist()]
