"""A frame with everything drawn on it that was found: what a person looks at first."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from geometry import Floats, View, at_height
from tracking.errors import TrackingError
from tracking.film import Film
from tracking.following import FRONT, REAR
from tracking.ground_truth import TrackResult
from tracking.images import Image
from tracking.markers import State
from tracking.scene import Scene

Picture: TypeAlias = npt.NDArray[np.uint8]

SEEN, PARTLY, BRIDGED, AXES = (80, 200, 60), (0, 190, 255), (0, 110, 255), (230, 160, 40)
_CAR, RIM, WORDS = (255, 200, 60), (20, 20, 20), (245, 245, 245)
_CLIP_WIDTH_PX, _CLIP_HZ, _CLIP_FRAMES = 960, 15.0, 300


def preview_picture(result: TrackResult, view: View, scene: Scene) -> Picture:
    """The frame in which most was seen: markers by name, axes, the whole path; blue, green, red.

    Raises `TrackingError` when no frame could be used.
    """
    if result.tracks.preview is None:
        raise TrackingError("there is no frame to show")
    row, image = result.tracks.preview
    return _annotated(result, view, scene, row, image, len(result.rows))


def write_picture(file: Path, picture: Picture) -> None:
    """A PNG or JPEG; raises `TrackingError` when the disk does not take it."""
    import cv2

    good, data = cv2.imencode(file.suffix, picture)
    try:
        file.write_bytes(data.tobytes())
    except OSError as err:
        raise TrackingError(f"cannot write {file}: {err.strerror or err}") from err
    assert good, "OpenCV encodes PNG and JPEG"


def write_clip(file: Path, film: Film, result: TrackResult, view: View, scene: Scene) -> int:
    """A short MP4 of the run with the path growing; how many frames it has.

    Of long runs every so many frames are shown, evenly over the whole of it.
    """
    import cv2

    every = max(1, -(-len(result.tracks.t_ns) // _CLIP_FRAMES))
    scale = min(1.0, _CLIP_WIDTH_PX / view.camera.width_px)
    camera = view.camera
    wide, high = (2 * round(scale * side / 2) for side in (camera.width_px, camera.height_px))
    size = (wide, high)
    rows = {int(n): row for row, n in enumerate(result.tracks.sequence)}
    clip = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"mp4v"), _CLIP_HZ, size)
    if not clip.isOpened():
        raise TrackingError(f"cannot write {file}: OpenCV has no MP4 writer, or the disk refuses")
    count = 0
    try:
        for frame in film.frames():
            row = rows.get(frame.sequence)
            if row is None or row % every or frame.image is None:
                continue
            upto = int(np.searchsorted(result.rows, row, side="right"))
            picture = _annotated(result, view, scene, row, frame.image, upto)
            clip.write(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
            count += 1
    finally:
        clip.release()
    return count


def _annotated(
    result: TrackResult, view: View, scene: Scene, row: int, image: Image, upto: int
) -> Picture:
    import cv2

    picture = np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8)
    wide = max(1, round(view.camera.width_px / 960))
    _draw_axes(picture, view, wide)
    _draw_path(picture, result, view, scene, upto, wide)
    for k, name in enumerate(result.tracks.names):
        state = result.tracks.states[row, k]
        if state == State.LOST:
            continue
        colour = PARTLY if state == State.PARTLY else _CAR if name in (FRONT, REAR) else SEEN
        place = _pixel(result.tracks.pixels[row, k])
        cv2.drawMarker(picture, place, colour, cv2.MARKER_CROSS, 12 * wide, wide, cv2.LINE_AA)
        words = name.removeprefix("marker_").removeprefix("cone ")
        # The car's two rings are close together: one name above, one below.
        down = 36 if name == REAR else -16
        corner = (place[0] + 24 * wide, place[1] + down * wide)
        _write(picture, words, corner, wide)
    return picture


def _write(picture: Picture, words: str, corner: tuple[int, int], wide: int) -> None:
    """Light words with a dark rim, to be read on the path and on white paper too."""
    import cv2

    font, size = cv2.FONT_HERSHEY_SIMPLEX, 0.6 * wide
    for colour, width in ((RIM, 4 * wide), (WORDS, wide)):
        cv2.putText(picture, words, corner, font, size, colour, width, cv2.LINE_AA)


def _draw_axes(picture: Picture, view: View, wide: int) -> None:
    import cv2

    ends = view.project(np.array([[0.0, 0, 0], [0.5, 0, 0], [0, 0.5, 0]]))
    if not np.isfinite(ends).all():
        return
    for end in ends[1:]:
        cv2.arrowedLine(picture, _pixel(ends[0]), _pixel(end), AXES, 2 * wide, cv2.LINE_AA)


def _draw_path(
    picture: Picture, result: TrackResult, view: View, scene: Scene, upto: int, wide: int
) -> None:
    """base_link's path at the height of the rings, so that it lies on the car in the picture."""
    import cv2

    places = path_pixels(result.truth.path.positions[:upto], view, scene)
    steps = np.diff(result.rows[:upto]) if upto else np.zeros(0, np.int64)
    for k in range(1, len(places)):
        # A step of more than a frame is a gap too long to be bridged.
        if steps[k - 1] > 1 or not np.isfinite(places[k - 1 : k + 1]).all():
            continue
        colour = BRIDGED if result.bridged[k] else _CAR
        cv2.line(picture, _pixel(places[k - 1]), _pixel(places[k]), colour, 2 * wide, cv2.LINE_AA)


def path_pixels(xy: Floats, view: View, scene: Scene) -> Floats:
    """Where places (n, 2) at the height of the car's rings are seen, (n, 2)."""
    return view.project(at_height(xy, scene.car.height_m))


def _pixel(place: Floats) -> tuple[int, int]:
    return round(float(place[0])), round(float(place[1]))
