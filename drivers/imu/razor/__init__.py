"""SparkFun's 9DoF Razor IMU M0 on a serial port, with its default or with the AHRS firmware.

`talk` finds out which it is, `columns` and `setting` what the default firmware prints and how to
change that, `protocol` and `ahrs` read the two streams, live and from a raw log; `driver` puts them
together. `emulator` and `ahrs_emulator` are the board's side.
"""

from drivers.imu.razor.ahrs import AhrsDecoder
from drivers.imu.razor.ahrs_emulator import AhrsModel
from drivers.imu.razor.columns import Columns
from drivers.imu.razor.driver import Razor, RazorConfig
from drivers.imu.razor.emulator import RazorModel, ReplayModel, razor_model
from drivers.imu.razor.protocol import Layout, MillisClock, RazorDecoder

__all__ = [
    "AhrsDecoder",
    "AhrsModel",
    "Columns",
    "Layout",
    "MillisClock",
    "Razor",
    "RazorConfig",
    "RazorDecoder",
    "RazorModel",
    "ReplayModel",
    "razor_model",
]
