"""Pictures of a floor -> where the ring markers are, whose they are, and how sure that is.

`find_rings` looks at one picture and knows nothing before; `RingTracker` knows camera and markers
and follows them all from frame to frame. Pictures are 8-bit; no picture is ever undistorted, only
points. OpenCV is loaded when the first picture is looked at.
"""

from tracking.errors import ImageError, TrackingError
from tracking.film import Film, session_film
from tracking.ground_truth import TrackResult, track_film
from tracking.identity import (
    CarMemory,
    RingPair,
    car_pose,
    heading_between,
    pair_match,
    unique_matches,
)
from tracking.images import Image, grey_image
from tracking.markers import Marker, State, TrackedFrame
from tracking.measuring import TrackerConfig
from tracking.rings import RingSearch, RingSightings, find_rings
from tracking.scene import CarRings, Scene, read_scene
from tracking.still_rings import StillRings, average_rings
from tracking.tracker import RingTracker
from tracking.whole_film import (
    scene_of,
    summary,
    write_pictures,
)

__all__ = [
    "CarMemory",
    "CarRings",
    "Film",
    "Image",
    "ImageError",
    "Marker",
    "RingPair",
    "RingSearch",
    "RingSightings",
    "RingTracker",
    "Scene",
    "State",
    "StillRings",
    "TrackResult",
    "TrackedFrame",
    "TrackerConfig",
    "TrackingError",
    "average_rings",
    "car_pose",
    "find_rings",
    "grey_image",
    "heading_between",
    "pair_match",
    "read_scene",
    "scene_of",
    "session_film",
    "summary",
    "track_film",
    "unique_matches",
    "write_pictures",
]
