"""A video file as a camera. An MJPG video gives its JPEGs as they are; others are decoded."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from drivers.camera.clock import Clock
from drivers.camera.errors import CameraFileError
from drivers.camera.frame import Frame, Stamp
from drivers.camera.header import read_jpeg_header
from drivers.camera.playback import Pacer, Still
from drivers.device import Counters, Reading
from drivers.errors import DeviceLostError

if TYPE_CHECKING:
    import cv2

RATE_ONLY = (".avi",)
"""Containers that hold a frame rate and no stamps: what OpenCV tells of them is made from it."""


@dataclass(frozen=True)
class VideoFileConfig:
    """A video file; real_time : at its own pace, else as fast as it is asked for."""

    file: Path
    real_time: bool = True


class VideoFile:
    """A video file as a camera; a `drivers.Device` of `Frame`.

    A cut JPEG is counted in `bad_frames`, left out and told in `skipped`. At the end `read` gives
    None and `finished` is true; frames that the file announces and that did not come are
    `lost_samples`.
    """

    def __init__(self, config: VideoFileConfig, clock: Clock | None = None) -> None:
        self.config = config
        self.counters = Counters()
        self.skipped: list[str] = []
        self._pacer = Pacer(config.real_time, clock, self.counters)
        self._guard = threading.Lock()  # `close` may come from another thread
        self._video: cv2.VideoCapture | None = None
        self._jpeg, self._ended = False, False
        self._told: dict[str, object] = {}
        self._announced, self._next, self._latest_ns = 0, 0, -1
        self._rate_hz = 0.0
        self._stamp = Stamp.CONTAINER
        self._still: Still | None = None

    @property
    def name(self) -> str:
        """`video FILE`."""
        return f"video {self.config.file}"

    @property
    def finished(self) -> bool:
        """Whether the last frame was given."""
        return self._ended and self._still is None

    def connect(self) -> None:
        """Open the file; raises `CameraFileError` where it is no video that can be read."""
        import cv2

        self.close()
        file = self.config.file
        if not file.is_file():
            raise CameraFileError(f"{file}: there is no such file; a video was expected")
        video = cv2.VideoCapture(str(file), cv2.CAP_FFMPEG)
        if not video.isOpened():
            video.release()
            raise CameraFileError(
                f"{file}: is no video that OpenCV can read; convert it, "
                f"for example ffmpeg -i {file.name} -c:v mjpeg -q:v 2 {file.stem}.mkv"
            )
        code = int(video.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF
        fourcc = code.to_bytes(4, "little").decode("latin-1")
        # Format -1 gives the packets as they are in the file.
        self._jpeg = fourcc.upper() == "MJPG" and video.set(cv2.CAP_PROP_FORMAT, -1)
        self._rate_hz = video.get(cv2.CAP_PROP_FPS)
        self._announced = max(int(video.get(cv2.CAP_PROP_FRAME_COUNT)), 0)
        rate_only = file.suffix.lower() in RATE_ONLY
        self._stamp = Stamp.FRAME_RATE if rate_only else Stamp.CONTAINER
        self._next, self._latest_ns, self._ended, self._still = 0, -1, False, None
        self._pacer.restart()
        self._told = {
            "model": "video file",
            "path": str(file),
            "fourcc": fourcc,
            "decoded": not self._jpeg,
            "width_px": int(video.get(cv2.CAP_PROP_FRAME_WIDTH)),
            "height_px": int(video.get(cv2.CAP_PROP_FRAME_HEIGHT)),
            "rate_told_hz": self._rate_hz,
            "frames": self._announced,
            "stamps_by": self._stamp.value,
        }
        self._video = video

    def identify(self) -> Mapping[str, object]:
        """File, codec, size, rate, and what the stamps are; {} before `connect`."""
        return dict(self._told)

    def read(self, timeout_s: float) -> Reading[Frame] | None:
        """The next good frame when its time has come; None if that is later, or at the end."""
        if self._video is None:
            raise DeviceLostError(f"{self.name}: not connected; call connect() first")
        while self._still is None and not self._ended:
            self._still = self._load()
        if self._still is None:
            self._pacer.idle(timeout_s)
            return None
        reading = self._pacer.give(self._still, timeout_s)
        if reading is not None:
            self._still = None
        return reading

    def close(self) -> None:
        """Close the file."""
        with self._guard:
            video, self._video = self._video, None
            if video is not None:
                video.release()

    def _load(self) -> Still | None:
        """The next frame of the file; None for one that is cut, and at the end."""
        import cv2

        with self._guard:
            if self._video is None:
                raise DeviceLostError(f"{self.name}: closed while it was being read")
            good, image = self._video.read()
            position_ms = self._video.get(cv2.CAP_PROP_POS_MSEC)
        if not good:
            self._ended = True
            self._count_missing()
            return None
        sequence, self._next = self._next, self._next + 1
        footage_ns, stamp = self._footage_ns(round(position_ms * 1e6), sequence)
        data = image.tobytes()
        if not self._jpeg:
            height, width = image.shape[:2]
            return Still(sequence, footage_ns, stamp, "bgr8", data, width, height)
        header = read_jpeg_header(data)
        if header.fault is not None:
            self.counters.bad_frames += 1
            self.skipped.append(f"{self.config.file}: frame {sequence} left out: {header.fault}")
            return None
        size = header.width_px, header.height_px
        return Still(sequence, footage_ns, stamp, "jpeg", data, *size)

    def _count_missing(self) -> None:
        missing = self._announced - self._next
        if missing > 0:
            self.counters.lost_samples += missing
            self.skipped.append(
                f"{self.config.file}: ends after {self._next} of {self._announced} frames"
            )

    def _footage_ns(self, told_ns: int, sequence: int) -> tuple[int, Stamp]:
        """The frame's time in the file and what it rests on; stamps that stand still are none."""
        if told_ns <= self._latest_ns:
            if self._rate_hz <= 0:
                raise CameraFileError(
                    f"{self.config.file}: frame {sequence} has no stamp and the file no frame "
                    "rate; write its frames as images with a stamps.csv beside them"
                )
            told_ns = max(round(sequence * 1e9 / self._rate_hz), self._latest_ns + 1)
            stamp = Stamp.FRAME_RATE
        else:
            stamp = self._stamp
        self._latest_ns = told_ns
        return told_ns, stamp
