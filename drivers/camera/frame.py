"""What every camera gives: the bytes as they came, and when the exposure was half over."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Literal

FrameFormat = Literal["jpeg", "png", "yuyv", "grey8", "bgr8"]
"""How the bytes are to be read; the last three are rows of pixels from the top, without padding."""


class Stamp(enum.Enum):
    """What a frame's `t_ns` rests on, best first."""

    EXPOSURE_START = "kernel stamp of the start of the exposure, and half the exposure time"
    FRAME_END = "kernel stamp of the end of the frame, less half the exposure time"
    ARRIVAL = "arrival of the frame, less half the exposure time"
    LISTED = "stamp listed beside the image"
    CONTAINER = "stamp in the video file"
    FRAME_RATE = "made from the frame rate and the frame's number"


@dataclass(frozen=True)
class Frame:
    """One frame of a camera.

    t_ns : monotonic time of the middle of the exposure, as well as `stamp` says; device_ns : the
    middle of the exposure on the camera's own clock where that is not ours (the reading's ticks tie
    the two), else None, and `t_ns` is the last word; sequence : the camera's own count, so that a
    hole in it is a lost frame; data : the bytes as they came; arrival_ns : monotonic time at which
    the frame was here; exposure_ns : as the camera tells it, None where it does not and nothing
    was added or subtracted for it; fault : what is wrong with the data, None for a good frame.
    """

    t_ns: int
    stamp: Stamp
    sequence: int
    format: FrameFormat
    data: bytes
    width_px: int
    height_px: int
    arrival_ns: int
    device_ns: int | None = None
    exposure_ns: int | None = None
    fault: str | None = None
