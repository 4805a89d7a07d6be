"""What the ZED on a car sees of the virtual track: both eyes side by side, grey, with their truth.

A textured floor, four walls and the cones, with the distortion of each lens, the eyes out of line
as they come from the factory, and the noise of the sensor.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from capture import StereoCalibration
from geometry import Camera, Floats, Mounting, StereoPair, turned
from simulation.stereo_atlas import room_atlas
from simulation.stereo_cones import draw_cones
from simulation.stereo_eye import Eye, Placed

ZED_MOUNTING = Mounting(x_m=0.20, y_m=0.06, z_m=0.22, pitch_rad=float(np.radians(12.0)))
"""Of the left eye on base_link."""
_LENS_SIGMA_PX = 0.55
_NOISE_MARGIN_PX = 96


def zed_pair() -> StereoPair:
    """A ZED at VGA as it comes from the factory: its eyes are not quite alike, nor in line."""
    left = Camera(672, 376, 349.62, 349.75, 338.41, 189.37, (-0.1714, 0.0249, 0.0, 0.0, 0.0))
    right = Camera(672, 376, 350.27, 350.18, 333.86, 192.12, (-0.1702, 0.0243, 0.0, 0.0, 0.0))
    rotation = turned(np.array([-0.0023, 0.0041, 0.0012]))
    return StereoPair(left, right, rotation, np.array([-0.11987, 0.00021, -0.00034]))


def zed_calibration(
    pair: StereoPair | None = None, mounting: Mounting = ZED_MOUNTING
) -> StereoCalibration:
    """The true calibration of a pair on the car, as a session can carry it."""
    return StereoCalibration.of_pair(
        pair or zed_pair(), mounting, made_utc="2019-05-14T08:00:00Z", how={"source": "simulation"}
    )


def told_calibration() -> StereoCalibration:
    """What a person has of the ZED on the virtual car: the factory's file, and a ruler's mounting.

    Off by what such files and rulers are off: the focal lengths by 0.15 %, the base line by 0.1 mm,
    the turn between the eyes by 0.02 degrees, the place by 2 mm, the pitch by 0.4 degrees.
    """
    true = zed_pair()
    left, right = (
        replace(eye, fx=factor * eye.fx, fy=factor * eye.fy)
        for eye, factor in ((true.left, 1.0015), (true.right, 1.0012))
    )
    rotation = turned(np.radians([0.008, -0.012, 0.015])) @ true.rotation
    pair = StereoPair(left, right, rotation, true.translation + np.array([1e-4, 0.0, 0.0]))
    place = ZED_MOUNTING
    held = replace(
        place,
        x_m=place.x_m + 0.002,
        y_m=place.y_m - 0.0015,
        pitch_rad=place.pitch_rad + float(np.radians(0.4)),
    )
    return zed_calibration(pair, held)


def factory_text(pair: StereoPair) -> str:
    """The factory's settings file of a pair at VGA (reference: protocols.md D.2), to the digit."""
    import cv2

    lines = []
    for side, camera in (("LEFT", pair.left), ("RIGHT", pair.right)):
        k1, k2, p1, p2, k3 = camera.distortion
        values = {"fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy,
                  "k1": k1, "k2": k2, "k3": k3, "p1": p1, "p2": p2}  # fmt: skip
        lines += [f"[{side}_CAM_VGA]", *(f"{key}={value!r}" for key, value in values.items()), ""]
    turn = np.asarray(cv2.Rodrigues(np.array(pair.rotation))[0], np.float64).ravel().tolist()
    x_mm, y_mm, z_mm = (1e3 * pair.translation).tolist()
    lines += ["[STEREO]", f"Baseline={-x_mm!r}", f"TY={y_mm!r}", f"TZ={z_mm!r}"]
    lines += [f"{key}_VGA={value!r}" for key, value in zip(("RX", "CV", "RZ"), turn, strict=True)]
    return "\n".join([*lines, ""])


def write_factory_file(folder: Path, pair: StereoPair, serial: int = 12345) -> Path:
    """Write `SN<serial>.conf` into a folder; its path."""
    file = folder / f"SN{serial}.conf"
    file.write_text(factory_text(pair), encoding="utf-8")
    return file


class StereoScene:
    """A room with cones (n, 2) and a stereo camera on a car in it.

    Rendering is pure but for the sensor's noise, which goes on from frame to frame; the same seed
    and the same poses give the same frames.
    """

    def __init__(
        self,
        cones: Floats,
        pair: StereoPair | None = None,
        mounting: Mounting = ZED_MOUNTING,
        seed: int = 0,
        noise: float = 2.0,
    ) -> None:
        self.cones = np.asarray(cones, np.float64).reshape(-1, 2)
        self.pair, self.mounting = pair or zed_pair(), mounting
        self._places = _placed(self.pair, mounting)
        atlas = room_atlas(seed)
        self._eyes = [Eye(place, atlas) for place in self._places]
        self._rng = np.random.default_rng([seed, 1])
        width, height = self.pair.eye_size_px
        size = (height + _NOISE_MARGIN_PX, 2 * width + _NOISE_MARGIN_PX)
        # Drawn once and shifted from frame to frame: fresh noise would cost as much as the scene.
        self._noise = np.rint(self._rng.normal(0.0, noise, size)).astype(np.int16)

    def frame(self, pose_world_base: Floats) -> npt.NDArray[np.uint8]:
        """Both eyes (height, 2 * width), the left one in the left half, from a pose (3,)."""
        import cv2

        pose = np.asarray(pose_world_base, np.float64)
        width, height = self.pair.eye_size_px
        picture = np.empty((height, 2 * width), np.uint8)
        for k, (eye, place) in enumerate(zip(self._eyes, self._places, strict=True)):
            seen = eye.render(pose)
            draw_cones(seen, place, self.cones, pose)
            half = picture[:, k * width : (k + 1) * width]
            half[:] = cv2.GaussianBlur(seen, (3, 3), _LENS_SIGMA_PX)
        down, across = self._rng.integers(0, _NOISE_MARGIN_PX, 2)
        noise = self._noise[down : down + height, across : across + 2 * width]
        return np.asarray(cv2.add(picture, noise, dtype=cv2.CV_8U), np.uint8)

    def frame_yuyv(self, pose_world_base: Floats) -> bytes:
        """The same as the camera sends it over USB: YUYV without colour."""
        grey = self.frame(pose_world_base)
        packed = np.full((*grey.shape, 2), 128, np.uint8)
        packed[..., 0] = grey
        return packed.tobytes()


def _placed(pair: StereoPair, mounting: Mounting) -> tuple[Placed, Placed]:
    """Both cameras in base_link."""
    left = Placed(pair.left, mounting.rotation, mounting.position)
    beside = -pair.rotation.T @ pair.translation
    right = Placed(
        pair.right,
        mounting.rotation @ pair.rotation.T,
        mounting.position + mounting.rotation @ beside,
    )
    return left, right
