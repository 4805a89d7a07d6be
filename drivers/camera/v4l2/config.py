"""What is asked of a V4L2 camera."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.camera.frame import FrameFormat

FRAME_FORMATS: dict[str, FrameFormat] = {
    "MJPG": "jpeg",
    "JPEG": "jpeg",
    "YUYV": "yuyv",
    "GREY": "grey8",
}
"""The formats of `linux/videodev2.h` that we take, by their four-character codes."""
BYTES_PER_PIXEL: dict[FrameFormat, int] = {"yuyv": 2, "grey8": 1}
POWER_LINE_HZ = (0, 50, 60)


@dataclass(frozen=True)
class V4l2Config:
    """A camera by its path and every setting that is asked of it; each is read back.

    path : best one of /dev/v4l/by-id, which stays the same when another camera is plugged in;
    exposure_s : fixed exposure, None for the camera's automatic one (then without leave to lower
    the frame rate); gain, focus : in the camera's own numbers, None leaves them as they are;
    power_line_hz : 50 or 60 against flicker of the light, 0 off, None as it is; rate_tolerance :
    how far the measured frame rate may lie below the asked one; silence_s : without a frame for so
    long the camera is lost.
    Raises `ValueError` for what no camera could do.
    """

    path: str
    width_px: int = 1920
    height_px: int = 1080
    rate_hz: float = 30.0
    fourcc: str = "MJPG"
    exposure_s: float | None = None
    gain: int | None = None
    focus: int | None = None
    power_line_hz: int | None = None
    buffers: int = 4
    rate_tolerance: float = 0.1
    silence_s: float = 2.0

    def __post_init__(self) -> None:
        if self.fourcc not in FRAME_FORMATS:
            raise ValueError(f"fourcc {self.fourcc!r} is none of {', '.join(FRAME_FORMATS)}")
        if self.width_px < 1 or self.height_px < 1 or self.rate_hz <= 0:
            raise ValueError(
                f"width_px {self.width_px}, height_px {self.height_px}, rate_hz {self.rate_hz:g}: "
                "each must be above 0"
            )
        if self.exposure_s is not None and not 0 < self.exposure_s <= 1 / self.rate_hz:
            raise ValueError(
                f"exposure_s {self.exposure_s:g} does not fit {self.rate_hz:g} frames a second; "
                f"it must be above 0 and at most {1 / self.rate_hz:.4f}"
            )
        if self.power_line_hz not in (None, *POWER_LINE_HZ):
            raise ValueError(f"power_line_hz {self.power_line_hz} is none of 0, 50, 60")
        if self.buffers < 2:
            raise ValueError(
                f"buffers {self.buffers}: one is filled while another is read, so >= 2"
            )
        if not 0 < self.rate_tolerance < 1 or self.silence_s <= 0:
            raise ValueError("rate_tolerance must be between 0 and 1, silence_s above 0")

    @property
    def format(self) -> FrameFormat:
        """The format of the frames that come of it."""
        return FRAME_FORMATS[self.fourcc]

    @property
    def frame_bytes(self) -> int | None:
        """How long an uncompressed frame is; None for JPEG."""
        depth = BYTES_PER_PIXEL.get(self.format)
        return None if depth is None else self.width_px * self.height_px * depth
