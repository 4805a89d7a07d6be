"""The frames of a filmed session or of old footage, each with the middle of its exposure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from capture import Session
from drivers import DriverError
from drivers.camera import VideoFile, VideoFileConfig, decode_grey, grey_image, read_jpeg_header
from tracking.errors import TrackingError
from tracking.images import Image
from tracking.still_rings import BLACK


@dataclass(frozen=True, eq=False)
class FilmFrame:
    """A frame; image is None where it cannot be used, and fault says why."""

    sequence: int
    t_ns: int
    image: Image | None
    fault: str = ""


@dataclass(frozen=True)
class Film:
    """Something filmed, played from its beginning as often as it is asked for.

    source : its name; count : of frames, as far as it is known; stamps : what the times rest on.
    """

    source: str
    count: int
    stamps: str
    frames: Callable[[], Iterator[FilmFrame]]


def session_film(session: Session) -> Film:
    """The film of a session; raises `MissingStreamError` where there is none."""
    session.overhead_images()

    def frames() -> Iterator[FilmFrame]:
        for logged in session.overhead_images():
            image, fault = _decoded(logged.format, logged.data)
            yield FilmFrame(logged.sequence, logged.t_ns, image, fault)

    stamps = "middle of the exposure, as recorded"
    return Film(session.name, session.overhead_count, stamps, frames)


def video_film(file: Path) -> Film:
    """A video file; raises `CameraFileError` where it cannot be read."""
    with closing(VideoFile(VideoFileConfig(file, real_time=False))) as video:
        video.connect()
        told = video.identify()

    def frames() -> Iterator[FilmFrame]:
        with closing(VideoFile(VideoFileConfig(file, real_time=False))) as video:
            video.connect()
            start_ns: int | None = None
            while not video.finished:
                # Footage runs on a clock of its own, on which waiting takes no time.
                reading = video.read(0.02)
                for frame in reading.samples if reading is not None else ():
                    start_ns = frame.t_ns if start_ns is None else start_ns
                    t_ns = frame.t_ns - start_ns
                    try:
                        image = grey_image(frame)
                    except DriverError as err:
                        yield FilmFrame(frame.sequence, t_ns, None, f"damaged: {err}")
                        continue
                    yield FilmFrame(frame.sequence, t_ns, *_judged(image))

    count = told.get("frames")
    stamps = str(told.get("stamps_by", "unknown"))
    return Film(file.name, count if isinstance(count, int) else 0, stamps, frames)


def still_images(film: Film, seconds: float) -> Iterator[Image]:
    """The good pictures of the first seconds; raises `TrackingError` where there is none."""
    start_ns: int | None = None
    good = 0
    for frame in film.frames():
        start_ns = frame.t_ns if start_ns is None else start_ns
        if (frame.t_ns - start_ns) * 1e-9 > seconds:
            break
        if frame.image is not None:
            good += 1
            yield frame.image
    if not good:
        raise TrackingError(
            f"{film.source}: no good picture in its first {seconds:g} s; is the lens cap on, the "
            "file damaged?"
        )


def _decoded(kind: str, data: bytes) -> tuple[Image | None, str]:
    if kind == "jpeg":
        fault = read_jpeg_header(data).fault
        if fault is not None:
            return None, f"damaged: {fault}"
    image = decode_grey(data)
    if image is None:
        return None, f"damaged: {len(data)} bytes of {kind} are no picture"
    return _judged(image)


def _judged(image: Image) -> tuple[Image | None, str]:
    return (None, "black") if int(image.max()) < BLACK else (image, "")
