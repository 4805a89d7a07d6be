"""An emulated camera, one that is connected to it, and what every conversation asks."""

from __future__ import annotations

from camera_pictures import jpeg

from drivers import Reading
from drivers.camera import CameraEmulator, Frame, V4l2Camera, V4l2Config

PATH = "/dev/v4l/by-id/usb-emulated-video-index0"
CONFIG = V4l2Config(PATH, exposure_s=0.005)


def emulator(width: int = 1920, height: int = 1080) -> CameraEmulator:
    return CameraEmulator(lambda t_ns: jpeg(width, height, t_ns % 7))


def connected(camera: CameraEmulator, config: V4l2Config = CONFIG) -> V4l2Camera:
    device = V4l2Camera(config, camera.open)
    device.connect()
    return device


def one(reading: Reading[Frame] | None) -> Frame:
    assert reading is not None
    assert reading.raw == ()
    assert len(reading.samples) == 1
    return reading.samples[0]


def elapsed_s(camera: CameraEmulator) -> float:
    return camera.clock.now_ns() * 1e-9
