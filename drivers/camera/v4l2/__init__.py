"""Cameras of the Linux kernel (V4L2): USB cameras first of all, in their own JPEGs.

`source` is what a device offers, `linux_source` the real one (linuxpy, extra `v4l2`), `emulator`
one that tests switch faults on; `settings` asks and reads back, `stamps` finds the middle of the
exposure, `faults` explains the system's refusals, `driver` is the conversation.
"""

from drivers.camera.v4l2.config import V4l2Config
from drivers.camera.v4l2.driver import V4l2Camera
from drivers.camera.v4l2.emulator import CameraEmulator
from drivers.camera.v4l2.source import (
    Control,
    ControlRange,
    DeviceFacts,
    Grab,
    StampClock,
    StampEdge,
    VideoMode,
    VideoSource,
)

__all__ = [
    "CameraEmulator",
    "Control",
    "ControlRange",
    "DeviceFacts",
    "Grab",
    "StampClock",
    "StampEdge",
    "V4l2Camera",
    "V4l2Config",
    "VideoMode",
    "VideoSource",
]
