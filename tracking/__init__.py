"""Pictures of a floor -> where the ring markers are, whose they are, and how sure that is.

`find_rings` looks at one picture and knows nothing before; `RingTracker` knows camera and markers
and follows them all from frame to frame. Pictures are 8-bit; no picture is ever undistorted, only
points. OpenCV is loaded when the first picture is looked at.
"""

from tracking.errors import ImageError, TrackingError
from tracking.images import Image, grey_image
from tracking.rings import RingSearch, RingSightings, find_rings

__all__ = [
    "Image",
    "ImageError",
    "RingSearch",
    "RingSightings",
    "TrackingError",
    "find_rings",
    "grey_image",
]
