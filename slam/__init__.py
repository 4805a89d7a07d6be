"""Session -> estimate: landmark SLAM that knows nothing of the truth.

One class per algorithm behind the `Slam` protocol; `slam.run` drives any of them over a session.
The filters live in modules of their own (`from slam.ekf import EkfSlam`) because numba is loaded
with them; this package's surface is light.
"""

from slam.config import PRESETS, EkfConfig, MotionNoise, ObservationNoise
from slam.errors import SlamError
from slam.interface import Algorithm, Configuration, Slam, UpdateReport

__all__ = [
    "PRESETS",
    "Algorithm",
    "Configuration",
    "EkfConfig",
    "MotionNoise",
    "ObservationNoise",
    "Slam",
    "SlamError",
    "UpdateReport",
]
