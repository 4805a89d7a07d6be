"""The ZED stereo camera without its SDK: side-by-side frames over USB, and its factory settings.

`modes` are sizes, rates and USB ids, `driver` reads and encodes frames, `settings` reads the
factory calibration `SN<serial>.conf`.
"""

from drivers.camera.zed.driver import Encoding, ZedCamera, ZedConfig
from drivers.camera.zed.modes import MODELS, ZED_MODES, ZedMode
from drivers.camera.zed.settings import (
    EyeCalibration,
    StereoCalibration,
    parse_zed_settings,
    read_zed_settings,
)

__all__ = [
    "MODELS",
    "ZED_MODES",
    "Encoding",
    "EyeCalibration",
    "StereoCalibration",
    "ZedCamera",
    "ZedConfig",
    "ZedMode",
    "parse_zed_settings",
    "read_zed_settings",
]
