"""A session's stereo pictures -> odometry with covariance, lost where nothing is known."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np

from capture import LoggedImage, Odometry, Session, StereoCalibration, UncertainOdometry
from drivers import DriverError
from drivers.camera import Frame, grey_image, read_jpeg_header
from drivers.camera import Stamp as StampSource
from drivers.camera.frame import FrameFormat
from geometry import Floats, Stamps, between
from visual_odometry.config import VoConfig
from visual_odometry.errors import VisualOdometryError
from visual_odometry.odometer import State, VisualOdometer, VoFrame
from visual_odometry.rectification import Image

SOURCE = "viso"


@dataclass(frozen=True, eq=False)
class VoRun:
    """What visual odometry made of a recording.

    told : the odometry; frames : what each picture told, in order; damaged : pictures that could
    not be read; lost_s : (k, 2) when each lost stretch began, after the first picture, and for how
    long nothing was known.
    """

    told: UncertainOdometry
    frames: tuple[VoFrame, ...]
    damaged: int
    lost_s: Floats

    @property
    def tracked(self) -> int:
        """Pictures whose motion is known, the first included."""
        return int(self.told.odometry.t_ns.size)

    @property
    def distance_m(self) -> float:
        """Driven, as far as it is known."""
        pose = self.told.odometry.pose_odom_base
        return float(np.hypot(*np.diff(pose[:, :2], axis=0).T).sum())


def run_session(
    session: Session,
    calibration: StereoCalibration,
    config: VoConfig | None = None,
    advance: Callable[[], object] = lambda: None,
) -> VoRun:
    """Visual odometry over a session; `advance` is called after each picture.

    Raises `MissingStreamError` for a session without stereo pictures, `VisualOdometryError` where
    none of them can be used.
    """
    odometer = VisualOdometer(calibration.pair, calibration.mounting, config)
    pictures = _Pictures(calibration.pair.eye_size_px)
    frames = []
    for t_ns, picture in pictures.of(session.stereo_images()):
        frames.append(odometer.add(t_ns, picture))
        advance()
    return run_of(frames, pictures.damaged, str(session.folder))


def run_of(frames: list[VoFrame], damaged: int, name: str) -> VoRun:
    """The odometry of frames. Those that were missed and made good are left out, not lost."""
    samples = [frame for frame in frames if frame.state in (State.START, State.TRACKED)]
    if len(samples) < 2:
        whys = [frame.why for frame in frames if frame.why]
        raise VisualOdometryError(
            f"{name}: none of {len(frames) + damaged} pictures tells a motion "
            f"({whys[-1] if whys else 'there are too few'}); are the eyes uncovered and lit, and "
            "is the calibration that of this camera and mode?"
        )
    lost_t_ns = _lost(frames)
    t_ns = np.array([frame.t_ns for frame in samples], np.int64)
    pose = np.array([frame.pose for frame in samples])
    speed, yaw_rate = _rates(t_ns, pose, lost_t_ns)
    period_s = np.diff(t_ns, prepend=2 * t_ns[0] - t_ns[1])[:, None, None] * 1e-9
    own = np.array([frame.motion_covariance for frame in samples])
    told = UncertainOdometry(
        Odometry(SOURCE, t_ns, pose, speed, yaw_rate, lost_t_ns),
        np.array([frame.covariance for frame in samples]),
        own / period_s**2,
    )
    return VoRun(told, tuple(frames), damaged, _stretches(t_ns, lost_t_ns))


class _Pictures:
    """Reads logged pictures of two eyes of a size; counts those that are damaged."""

    def __init__(self, eye_size_px: tuple[int, int]) -> None:
        self._width_px, self._height_px = 2 * eye_size_px[0], eye_size_px[1]
        self.damaged = 0

    def of(self, logged: Iterable[LoggedImage]) -> Iterator[tuple[int, Image]]:
        """Stamp and picture of each that can be read, in the order of time."""
        before = -1
        for one in logged:
            picture = self._decoded(one)
            if picture is None or one.t_ns <= before:
                self.damaged += 1
                continue
            before = one.t_ns
            yield one.t_ns, picture

    def _decoded(self, one: LoggedImage) -> Image | None:
        width, height = self._width_px, self._height_px
        if one.format == "jpeg":
            header = read_jpeg_header(one.data)
            if header.fault is not None:
                return None
            width, height = header.width_px, header.height_px
        frame = Frame(
            one.t_ns, StampSource.LISTED, one.sequence, cast(FrameFormat, one.format), one.data,
            width, height, one.t_ns,
        )  # fmt: skip
        try:
            return grey_image(frame)
        except DriverError:
            return None


def _lost(frames: list[VoFrame]) -> Stamps:
    """Stamps of frames whose motion stays unknown."""
    lost: list[int] = []
    missed: list[int] = []
    for frame in frames:
        if frame.state is State.MISSED:
            missed.append(frame.t_ns)
            continue
        if frame.state is State.LOST:
            lost += [*missed, frame.t_ns]
        missed = []
    return np.array([*lost, *missed], np.int64)


def _rates(t_ns: Stamps, pose: Floats, lost_t_ns: Stamps) -> tuple[Floats, Floats]:
    """Forward speed and turn rate (n,): the mean of the steps before and after, where known."""
    step = between(pose[:-1], pose[1:])
    period_s = np.diff(t_ns) * 1e-9
    known = np.searchsorted(lost_t_ns, t_ns[:-1]) == np.searchsorted(lost_t_ns, t_ns[1:])
    ahead = np.copysign(np.hypot(step[:, 0], step[:, 1]), step[:, 0])
    rates = []
    for moved in (ahead, step[:, 2]):
        moved = np.where(known, moved, 0.0)
        spent = np.where(known, period_s, 0.0)
        way = np.append(moved, 0.0) + np.append(0.0, moved)
        time = np.append(spent, 0.0) + np.append(0.0, spent)
        rates.append(way / np.where(time > 0.0, time, 1.0))
    return rates[0], rates[1]


def _stretches(t_ns: Stamps, lost_t_ns: Stamps) -> Floats:
    """(k, 2): when each stretch without knowledge began, since the first picture, its length."""
    if not lost_t_ns.size:
        return np.zeros((0, 2))
    begin_ns = min(int(t_ns[0]), int(lost_t_ns[0]))
    after = np.unique(np.searchsorted(t_ns, lost_t_ns))
    first = [int(t_ns[k - 1]) if k else int(lost_t_ns[0]) for k in after]
    last = [int(t_ns[k]) if k < t_ns.size else int(lost_t_ns[-1]) for k in after]
    return np.array(
        [[(a - begin_ns) * 1e-9, (b - a) * 1e-9] for a, b in zip(first, last, strict=True)]
    )
