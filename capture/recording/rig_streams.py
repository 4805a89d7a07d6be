"""From a rig to the streams that a recorder takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from capture.clock import UtcLine
from capture.recording.camera import CameraTranslator
from capture.recording.imu import ImuTranslator
from capture.recording.lidar import LidarTranslator
from capture.recording.rig import Rig
from capture.recording.still import StillPeriod
from capture.recording.stream import Stream
from capture.recording.vesc import VescTranslator
from capture.topics import OVERHEAD_LOG_NAME, OVERHEAD_TOPIC, ZED_LOG_NAME, ZED_TOPIC
from drivers import Device
from drivers.camera import ImageFolder, VideoFile
from drivers.camera.v4l2 import V4l2Camera
from drivers.camera.zed import ZedCamera
from drivers.imu import ImuSample
from drivers.imu.mpu9250 import Mpu9250
from drivers.imu.razor import Razor
from drivers.rplidar import RPLidar
from drivers.vesc import Vesc

IMAGES_WAITING = 300
"""Ten seconds of a camera: what a card may stall."""

ON_CAR = ("lidar", "vesc", "mpu9250", "razor", "zed")
AT_TRACK = ("overhead",)


def streams_of(rig: Rig, names: Sequence[str], utc: UtcLine) -> Mapping[str, Stream]:
    """The streams of the named devices of a rig; nothing is opened yet."""
    made: dict[str, Stream] = {}
    if rig.lidar is not None:
        made["lidar"] = Stream(RPLidar(rig.lidar), LidarTranslator(utc), rig.lidar.rotation_hz)
    if rig.vesc is not None:
        translator = VescTranslator(utc, rig.vesc_calibration)
        made["vesc"] = Stream(Vesc(rig.vesc), translator, rig.vesc.rate_hz)
    if rig.mpu9250 is not None:
        made["mpu9250"] = _imu(Mpu9250(rig.mpu9250), utc)
    if rig.razor is not None:
        made["razor"] = _imu(Razor(rig.razor), utc)
    if rig.zed is not None:
        pairs = CameraTranslator(utc, ZED_TOPIC, ZED_LOG_NAME, "zed_left")
        made["zed"] = Stream(ZedCamera(rig.zed), pairs, rig.zed.rate_hz, IMAGES_WAITING)
    images = CameraTranslator(utc, OVERHEAD_TOPIC, OVERHEAD_LOG_NAME, "overhead")
    if rig.overhead is not None:
        camera = V4l2Camera(rig.overhead)
        made["overhead"] = Stream(camera, images, rig.overhead.rate_hz, IMAGES_WAITING)
    footage = _footage(rig)
    if footage is not None:
        made["overhead"] = Stream(
            footage, images, None, IMAGES_WAITING, is_finished=lambda: footage.finished
        )
    return {name: made[name] for name in names}


def _imu(device: Device[ImuSample], utc: UtcLine) -> Stream:
    """Its rate is what it says of itself."""
    still = StillPeriod()
    return Stream(device, ImuTranslator(utc, still), still=still)


def _footage(rig: Rig) -> ImageFolder | VideoFile | None:
    """Old footage in the place of the overhead camera."""
    if rig.overhead_images is not None:
        return ImageFolder(rig.overhead_images)
    if rig.overhead_video is not None:
        return VideoFile(rig.overhead_video)
    return None
