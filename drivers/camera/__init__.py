"""Cameras: USB cameras of the kernel (`v4l2`), the ZED (`zed`), folders of images and video files.

All give `Frame`s: the bytes as the camera made them, and when the exposure was half over, with a
word on what that time rests on. `grey_image` decodes, `split_stereo` parts the eyes of a ZED,
`list_cameras` says what is plugged in. A frame's data is the raw record: `Reading.raw` is empty.
"""

from drivers.camera.clock import Clock, FreeClock, RealClock
from drivers.camera.discovery import CameraFound, list_cameras
from drivers.camera.errors import CameraFileError
from drivers.camera.files import ImageFolder, ImageFolderConfig
from drivers.camera.frame import Frame, FrameFormat, Stamp
from drivers.camera.header import ImageHeader, read_header, read_jpeg_header
from drivers.camera.image import decode_grey, grey_image, split_stereo
from drivers.camera.v4l2 import CameraEmulator, V4l2Camera, V4l2Config
from drivers.camera.video_file import VideoFile, VideoFileConfig
from drivers.camera.zed import (
    StereoCalibration,
    ZedCamera,
    ZedConfig,
    parse_zed_settings,
    read_zed_settings,
)

__all__ = [
    "CameraEmulator",
    "CameraFileError",
    "CameraFound",
    "Clock",
    "Frame",
    "FrameFormat",
    "FreeClock",
    "ImageFolder",
    "ImageFolderConfig",
    "ImageHeader",
    "RealClock",
    "Stamp",
    "StereoCalibration",
    "V4l2Camera",
    "V4l2Config",
    "VideoFile",
    "VideoFileConfig",
    "ZedCamera",
    "ZedConfig",
    "decode_grey",
    "grey_image",
    "list_cameras",
    "parse_zed_settings",
    "read_header",
    "read_jpeg_header",
    "read_zed_settings",
    "split_stereo",
]
