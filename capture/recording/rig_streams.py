"""From a rig to the streams that a recorder takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from capture.clock import UtcLine
from capture.recording.camera import CameraTranslator
from capture.recording.imu import ImuTranslator
from capture.recording.lidar import LidarTranslator
from capture.recording.recorder import Stream
from capture.recording.rig import Rig
from capture.recording.vesc import VescTranslator
from capture.topics import OVERHEAD_LOG_NAME, OVERHEAD_TOPIC, ZED_LOG_NAME, ZED_TOPIC
from drivers.camera.v4l2 import V4l2Camera
from drivers.camera.zed import ZedCamera
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
        made["mpu9250"] = Stream(Mpu9250(rig.mpu9250), ImuTranslator(utc), rig.mpu9250.rate_hz)
    if rig.razor is not None:
        made["razor"] = Stream(Razor(rig.razor), ImuTranslator(utc))
    if rig.zed is not None:
        images = CameraTranslator(utc, ZED_TOPIC, ZED_LOG_NAME, "zed_left")
        made["zed"] = Stream(ZedCamera(rig.zed), images, rig.zed.rate_hz, IMAGES_WAITING)
    if rig.overhead is not None:
        images = CameraTranslator(utc, OVERHEAD_TOPIC, OVERHEAD_LOG_NAME, "overhead")
        camera = V4l2Camera(rig.overhead)
        made["overhead"] = Stream(camera, images, rig.overhead.rate_hz, IMAGES_WAITING)
    return {name: made[name] for name in names}
