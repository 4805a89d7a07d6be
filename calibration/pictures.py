"""Where pictures come from: a folder, a video file, or any camera that is plugged in."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from calibration.errors import CalibrationError
from capture import LoggedImage, Session
from capture.session_info import FILE_NAME
from drivers import Device, DriverError
from drivers.camera import (
    Frame,
    VideoFile,
    VideoFileConfig,
    decode_grey,
    grey_image,
    read_jpeg_header,
)
from tracking import Image

SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".pgm")
_PATIENCE_S = 3.0
_STEP_S = 0.02
"""Footage runs on a clock of its own, on which waiting takes no time."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A grey picture with a name that a person can find again."""

    name: str
    image: Image


@dataclass
class Skipped:
    """Pictures that could not be read, and why; it grows while they are read."""

    lines: list[str] = field(default_factory=list)


def pictures_of(place: Path, skipped: Skipped) -> Iterator[Picture]:
    """The pictures of a folder in the order of their names, of a film or of a video file.

    What cannot be read is left out and told in `skipped`. Raises `CalibrationError` when there is
    nothing to read.
    """
    if (place / FILE_NAME).is_file():
        return _of_session(place, skipped)
    if place.is_dir():
        return _of_folder(place, skipped)
    if place.is_file():
        return _of_video(place, skipped)
    raise CalibrationError(f"{place}: there is no such folder or video file")


def pictures_from(
    device: Device[Frame],
    skipped: Skipped,
    over: Callable[[], bool] = lambda: False,
    patience_s: float = _PATIENCE_S,
) -> Generator[Picture]:
    """The frames of a camera until `over`, or until it gives none any more.

    Raises `DriverError` when it cannot be opened; frames that cannot be decoded are skipped.
    """
    with closing(device):
        device.connect()
        while not over():
            reading = device.read(patience_s)
            if reading is None:
                return
            for frame in reading.samples:
                name = f"frame {frame.sequence}"
                try:
                    yield Picture(name, grey_image(frame))
                except DriverError as err:
                    skipped.lines.append(str(err))


def _of_folder(folder: Path, skipped: Skipped) -> Iterator[Picture]:
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES)
    if not files:
        raise CalibrationError(f"{folder}: holds no pictures; expected {', '.join(SUFFIXES)}")
    return _read_all(files, skipped)


def _read_all(files: list[Path], skipped: Skipped) -> Iterator[Picture]:
    for file in files:
        image = decode_grey(file.read_bytes())
        if image is None:
            skipped.lines.append(f"{file}: left out: no picture that can be read")
            continue
        yield Picture(file.name, image)


def decoded(logged: LoggedImage) -> Image | None:
    """The picture, grey; None where its bytes are cut off or no picture."""
    if logged.format == "jpeg" and read_jpeg_header(logged.data).fault is not None:
        return None
    return decode_grey(logged.data)


def _of_session(folder: Path, skipped: Skipped) -> Iterator[Picture]:
    for logged in Session.open(folder).overhead_images():
        image = decoded(logged)
        if image is None:
            skipped.lines.append(f"{folder}: picture {logged.sequence} left out: damaged")
            continue
        yield Picture(f"picture {logged.sequence}", image)


def _of_video(file: Path, skipped: Skipped) -> Iterator[Picture]:
    with closing(VideoFile(VideoFileConfig(file, real_time=False))) as video:
        video.connect()
        while not video.finished:
            reading = video.read(_STEP_S)
            for frame in reading.samples if reading is not None else ():
                yield Picture(f"frame {frame.sequence}", grey_image(frame))
        skipped.lines += video.skipped
