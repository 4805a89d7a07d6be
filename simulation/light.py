"""Light on the floor: fall-off, shadows with soft edges, glare."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Grey: TypeAlias = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Glare:
    """A reflection: a Gaussian spot that adds light, in grey levels at its middle."""

    u_px: float
    v_px: float
    peak: float
    sigma_px: float


@dataclass(frozen=True, eq=False)
class Light:
    """What the floor's grey is multiplied by, (h, w), or None for 1; and the glare on top."""

    factor: Grey | None = None
    glare: tuple[Glare, ...] = ()

    def on(self, floor: Grey) -> Grey:
        """The lit floor, a new array."""
        lit = floor.copy() if self.factor is None else floor * self.factor
        rows, columns = (np.arange(n, dtype=np.float32) for n in floor.shape)
        for spot in self.glare:
            across = np.exp(-(((columns - spot.u_px) / spot.sigma_px) ** 2) / 2)
            down = np.exp(-(((rows - spot.v_px) / spot.sigma_px) ** 2) / 2)
            lit += np.float32(spot.peak) * down[:, None] * across
        return lit


def even_light() -> Light:
    """The same light everywhere."""
    return Light()


def shadowed_light(
    shape: tuple[int, int],
    rng: np.random.Generator,
    shadows: int = 8,
    darkness: tuple[float, float] = (0.45, 0.75),
    penumbra_px: tuple[float, float] = (1.5, 5.0),
    fall_off: float = 0.35,
) -> Light:
    """A lamp over one spot, and convex shadows across the image (h, w).

    darkness : what a shadow multiplies the light by, lowest and highest; penumbra_px : sigma of
    its edge, likewise; fall_off : light lost between the lamp's spot and the furthest corner.
    """
    import cv2

    rows, columns = (np.arange(n, dtype=np.float32) for n in shape)
    lamp = rng.uniform(0.2, 0.8, 2) * shape
    far = np.hypot(*shape)
    distance2 = ((rows - lamp[0]) / far) ** 2
    factor = 1.0 - fall_off * (distance2[:, None] + ((columns - lamp[1]) / far) ** 2)
    factor = factor.astype(np.float32)
    for _ in range(shadows):
        middle = rng.uniform(0.0, 1.0, 2) * shape[::-1]
        reach = rng.uniform(0.05, 0.25) * shape[0]
        corners = middle + reach * rng.normal(0.0, 1.0, (6, 2))
        mask = np.zeros(shape, np.float32)
        hull = cv2.convexHull(np.rint(16.0 * corners).astype(np.int32))
        cv2.fillConvexPoly(mask, hull, 1.0, cv2.LINE_8, 4)
        mask = np.asarray(cv2.GaussianBlur(mask, (0, 0), rng.uniform(*penumbra_px)), np.float32)
        factor *= 1.0 - np.float32(1.0 - rng.uniform(*darkness)) * mask
    return Light(factor)
