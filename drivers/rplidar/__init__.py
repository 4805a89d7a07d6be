"""The RPLidar A2M8 and its family: bytes to whole revolutions, and the emulated device.

`RPLidar` is the device; it gives a `Revolution` for each turn, in the frame `lidar` (x along the
lidar's zero, away from its cable; y left; counter-clockwise). `standard`, `legacy`, `ultra` and
`dense` decode the four types of scan answers (0x81, 0x82, 0x84, 0x85); HQ and ultra-dense scans are
not decoded. `RPLidarModel` is the device's own side; `emulated_lidar` makes one from a capture.
"""

from drivers.rplidar.beams import Beams, Decoder, Newest, bearing_rad, device_ns, range_m
from drivers.rplidar.conversation import DECODERS
from drivers.rplidar.dense import DenseDecoder
from drivers.rplidar.driver import RPLidar, RPLidarConfig
from drivers.rplidar.emulator import Faults, LidarPort, LidarSpec, RPLidarModel, a2m8
from drivers.rplidar.legacy import LegacyDecoder
from drivers.rplidar.motor import MotorPort
from drivers.rplidar.protocol import Answer, ScanMode
from drivers.rplidar.replay import emulated_lidar, read_capture, replay
from drivers.rplidar.revolution import Revolution, RevolutionSplitter
from drivers.rplidar.scene import Source, room
from drivers.rplidar.standard import StandardDecoder
from drivers.rplidar.ultra import UltraDecoder

__all__ = [
    "DECODERS",
    "Answer",
    "Beams",
    "Decoder",
    "DenseDecoder",
    "Faults",
    "LegacyDecoder",
    "LidarPort",
    "LidarSpec",
    "MotorPort",
    "Newest",
    "RPLidar",
    "RPLidarConfig",
    "RPLidarModel",
    "Revolution",
    "RevolutionSplitter",
    "ScanMode",
    "Source",
    "StandardDecoder",
    "UltraDecoder",
    "a2m8",
    "bearing_rad",
    "device_ns",
    "emulated_lidar",
    "range_m",
    "read_capture",
    "replay",
    "room",
]
