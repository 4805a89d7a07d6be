"""Visual odometry: stereo pictures of the car -> how it moved, how well that is known, or lost.

The idea of libviso2 (Geiger, Ziegler, Stiller, StereoScan, 2011), which the thesis used: points
matched in a circle over both eyes and two times, the motion that most of them agree on.
"""

from visual_odometry.config import VoConfig
from visual_odometry.errors import VisualOdometryError
from visual_odometry.odometer import State, VisualOdometer, VoFrame
from visual_odometry.rectification import Eyes, Rectifier

__all__ = [
    "Eyes",
    "Rectifier",
    "State",
    "VisualOdometer",
    "VisualOdometryError",
    "VoConfig",
    "VoFrame",
]
