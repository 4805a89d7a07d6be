"""A folder of images as a camera: for tests and for old footage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from drivers.camera.clock import Clock
from drivers.camera.errors import CameraFileError
from drivers.camera.frame import Frame, Stamp
from drivers.camera.header import read_header
from drivers.camera.playback import Pacer, Still
from drivers.camera.stamps_file import STAMPS_FILE, read_stamps, stamps_of
from drivers.device import Counters, Reading
from drivers.errors import DeviceLostError

SUFFIXES = (".jpg", ".jpeg", ".png")


@dataclass(frozen=True)
class ImageFolderConfig:
    """Images (.jpg, .jpeg, .png) of a folder, in the order of their names.

    rate_hz : makes the stamps where there is no `stamps.csv`, and each frame says so; real_time :
    at the footage's pace, else as fast as they are asked for.
    """

    folder: Path
    rate_hz: float | None = None
    real_time: bool = True

    def __post_init__(self) -> None:
        if self.rate_hz is not None and not self.rate_hz > 0:
            raise ValueError(f"rate_hz {self.rate_hz:g} is no frame rate")


class ImageFolder:
    """A folder of images as a camera; a `drivers.Device` of `Frame`.

    An image that is cut off or none at all is counted in `bad_frames`, left out, and told in
    `skipped`; its number stays free. After the last image `read` gives None and `finished` is true.
    """

    def __init__(self, config: ImageFolderConfig, clock: Clock | None = None) -> None:
        self.config = config
        self.counters = Counters()
        self.skipped: list[str] = []
        self._pacer = Pacer(config.real_time, clock, self.counters)
        self._files: list[Path] = []
        self._stamps_ns: list[int] = []
        self._stamp = Stamp.LISTED
        self._next = 0
        self._still: Still | None = None
        self._connected = False

    @property
    def name(self) -> str:
        """`images in FOLDER`."""
        return f"images in {self.config.folder}"

    @property
    def finished(self) -> bool:
        """Whether the last image was given."""
        return self._connected and self._still is None and self._next == len(self._files)

    def connect(self) -> None:
        """Look at the folder; raises `CameraFileError` where there is nothing to play."""
        self.close()
        files = _images(self.config.folder)
        names = [file.name for file in files]
        listed = self.config.folder / STAMPS_FILE
        if listed.exists():
            stamps, stamp = stamps_of(names, read_stamps(listed), listed), Stamp.LISTED
        elif self.config.rate_hz is not None:
            stamps = [round(k * 1e9 / self.config.rate_hz) for k in range(len(files))]
            stamp = Stamp.FRAME_RATE
        else:
            raise CameraFileError(
                f"{self.config.folder}: nothing says when its images were taken; write "
                f"{STAMPS_FILE} (name,t_ns) beside them, or give rate_hz"
            )
        self._files, self._stamps_ns, self._stamp = files, stamps, stamp
        self._next, self._still = 0, None
        self._pacer.restart()
        self._connected = True

    def identify(self) -> Mapping[str, object]:
        """Folder, number of images, and what the stamps are; {} before `connect`."""
        if not self._connected:
            return {}
        return {
            "model": "folder of images",
            "path": str(self.config.folder),
            "images": len(self._files),
            "stamps_by": self._stamp.value,
            "first_stamp_ns": self._stamps_ns[0],
            "rate_asked_hz": self.config.rate_hz,
        }

    def read(self, timeout_s: float) -> Reading[Frame] | None:
        """The next good image when its time has come; None if that is later, or at the end."""
        if not self._connected:
            raise DeviceLostError(f"{self.name}: not connected; call connect() first")
        while self._still is None and self._next < len(self._files):
            self._still = self._load(self._next)
            self._next += 1
        if self._still is None:
            self._pacer.idle(timeout_s)
            return None
        reading = self._pacer.give(self._still, timeout_s)
        if reading is not None:
            self._still = None
        return reading

    def close(self) -> None:
        """Forget the folder."""
        self._connected = False

    def _load(self, k: int) -> Still | None:
        file = self._files[k]
        try:
            data = file.read_bytes()
        except OSError as err:
            self._skip(file, f"cannot be read: {err.strerror}")
            return None
        header = read_header(data)
        if header.format is None or header.fault is not None:
            self._skip(file, header.fault or "no image")
            return None
        return Still(
            k,
            self._stamps_ns[k],
            self._stamp,
            header.format,
            data,
            header.width_px,
            header.height_px,
        )

    def _skip(self, file: Path, why: str) -> None:
        self.counters.bad_frames += 1
        self.skipped.append(f"{file}: left out: {why}")


def _images(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise CameraFileError(f"{folder}: is no folder; a folder with images was expected")
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES)
    if not files:
        raise CameraFileError(f"{folder}: holds no images; {', '.join(SUFFIXES)} were expected")
    return files
