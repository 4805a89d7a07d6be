"""The ZED as what it is on the bus: one USB camera whose frames hold both eyes side by side."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from drivers.camera.frame import Frame
from drivers.camera.image import yuyv_luma
from drivers.camera.v4l2.config import V4l2Config
from drivers.camera.v4l2.driver import V4l2Camera, open_linux
from drivers.camera.v4l2.source import VideoSource
from drivers.camera.zed.modes import MODELS, VENDOR, ZED_MODES, ZedMode
from drivers.device import Reading
from drivers.errors import ProtocolError

Encoding = Literal["jpeg", "luma", "yuyv"]
ENCODINGS: tuple[Encoding, ...] = ("jpeg", "luma", "yuyv")


@dataclass(frozen=True)
class ZedConfig:
    """A ZED by its path, its mode, and what becomes of its frames.

    mode : a name of `ZED_MODES`; encode : `jpeg` brightness only, as a JPEG of that quality (the
    ZED compresses nothing itself), `luma` brightness only, `yuyv` everything as it came; the other
    fields are those of `V4l2Config`.
    Raises `ValueError` for a mode or rate that the ZED does not have.
    """

    path: str
    mode: str = "HD720"
    rate_hz: float = 30.0
    encode: Encoding = "jpeg"
    quality: int = 90
    exposure_s: float | None = None
    gain: int | None = None
    power_line_hz: int | None = None
    silence_s: float = 2.0

    def __post_init__(self) -> None:
        if self.mode not in ZED_MODES:
            raise ValueError(f"mode {self.mode!r} is none of {', '.join(ZED_MODES)}")
        rates = ZED_MODES[self.mode].rates_hz
        if self.rate_hz not in rates:
            offered = ", ".join(str(rate) for rate in rates)
            raise ValueError(f"rate_hz {self.rate_hz:g} is none of those of {self.mode}: {offered}")
        if self.encode not in ENCODINGS:
            raise ValueError(f"encode {self.encode!r} is none of {', '.join(ENCODINGS)}")
        if not 1 <= self.quality <= 100:
            raise ValueError(f"quality {self.quality} is not between 1 and 100")
        _ = self.video  # its own checks: exposure, power line

    @property
    def video(self) -> V4l2Config:
        """What is asked of the camera behind it."""
        mode = ZED_MODES[self.mode]
        return V4l2Config(
            self.path,
            mode.width_px,
            mode.eye_height_px,
            self.rate_hz,
            "YUYV",
            exposure_s=self.exposure_s,
            gain=self.gain,
            power_line_hz=self.power_line_hz,
            silence_s=self.silence_s,
        )


class ZedCamera:
    """A ZED; a `drivers.Device` of `Frame`, both eyes in each: `split_stereo(grey_image(frame))`.

    `jpeg` and `luma` drop the colours for ever. A frame whose bytes are not those of the mode is
    given as it came, with its fault.
    """

    def __init__(
        self, config: ZedConfig, open_source: Callable[[str], VideoSource] = open_linux
    ) -> None:
        self.config = config
        self._camera = V4l2Camera(config.video, open_source)
        self.counters = self._camera.counters

    @property
    def name(self) -> str:
        """`ZED on /dev/v4l/by-id/...`."""
        return f"ZED on {self.config.path}"

    @property
    def mode(self) -> ZedMode:
        """Sizes and name of the mode."""
        return ZED_MODES[self.config.mode]

    def connect(self) -> None:
        """Open, set, read back, start; raises `DriverError`, `ProtocolError` for another camera."""
        self._camera.connect()
        told = self._camera.identify()
        usb_id = told["usb_id"]
        if usb_id is not None and not str(usb_id).startswith(f"{VENDOR}:"):
            self._camera.close()
            raise ProtocolError(
                f"{self.config.path}: is no ZED but {told['model']} ({usb_id}; a ZED has "
                f"{VENDOR}:...); see trackside devices for the path of the ZED"
            )

    def identify(self) -> Mapping[str, object]:
        """What the camera behind it tells, and the ZED's model, mode and encoding."""
        told = dict(self._camera.identify())
        if told:
            told["card"] = told["model"]
            told["model"] = MODELS.get(str(told["usb_id"]), told["model"])
            told |= {
                "mode": self.config.mode,
                "eye_width_px": self.mode.eye_width_px,
                "encode": self.config.encode,
                "quality": self.config.quality if self.config.encode == "jpeg" else None,
            }
        return told

    def read(self, timeout_s: float) -> Reading[Frame] | None:
        """The next frame, encoded in the caller's thread; None if none came in time."""
        reading = self._camera.read(timeout_s)
        if reading is None or self.config.encode == "yuyv":
            return reading
        frames = tuple(self._encoded(frame) for frame in reading.samples)
        return dataclasses.replace(reading, samples=frames)

    def close(self) -> None:
        """Stop the stream and give the camera back."""
        self._camera.close()

    def _encoded(self, frame: Frame) -> Frame:
        expected = frame.width_px * frame.height_px * 2
        if len(frame.data) != expected:
            return frame
        luma = yuyv_luma(frame.data)
        if self.config.encode == "luma":
            return dataclasses.replace(frame, format="grey8", data=luma.tobytes())
        import cv2

        image = luma.reshape(frame.height_px, frame.width_px)
        _, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self.config.quality])
        return dataclasses.replace(frame, format="jpeg", data=jpeg.tobytes())
