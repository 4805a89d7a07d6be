"""Rendered runs of a car with a ZED, with their truth, as frames and as sessions."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from capture import GroundTruth, Observations, Session, SessionInfo, write_calibration
from capture.log_writer import LogWriter
from capture.sensor_messages import image_message
from capture.topics import IMAGE_TYPE, ZED_LOG_NAME, ZED_TOPIC
from geometry import Floats, LandmarkMap, Trajectory, between, compose
from simulation.stereo import StereoScene, zed_calibration
from visual_odometry import State, VisualOdometer, VoFrame

Image = npt.NDArray[np.uint8]
Change = Callable[[int, Image], Image]
RATE_HZ, SPEED_M_S, LENGTH_M = 15, 0.6, 4.0
START_NS = 1_700_000_000_000_000_000
CONES = np.array(
    [[1.5, -0.3], [2.9, 0.6], [3.6, 2.0], [2.0, 1.2], [1.2, 1.2], [3.4, 3.3], [2.6, 3.8]]
)


def arc(
    radius_m: float = 1.5,
    length_m: float = LENGTH_M,
    start: tuple[float, float, float] = (0.6, 0.4, 0.1),
) -> Floats:
    """Poses (n, 3) of a turn to the left at constant speed."""
    way = np.arange(0.0, length_m + 1e-9, SPEED_M_S / RATE_HZ)
    turn = way / radius_m
    moved = np.stack([radius_m * np.sin(turn), radius_m * (1.0 - np.cos(turn)), turn], axis=1)
    return compose(np.array(start), moved)


def straight(length_m: float = LENGTH_M) -> Floats:
    """Poses (n, 3) across the room."""
    way = np.arange(0.0, length_m + 1e-9, SPEED_M_S / RATE_HZ)
    return compose(np.array([-0.8, 0.3, 0.7]), np.stack([way, 0.0 * way, 0.0 * way], axis=1))


@lru_cache(maxsize=2)
def scene(seed: int = 0) -> StereoScene:
    """A room; its floor takes a second to make."""
    return StereoScene(CONES, seed=seed)


def stamps(count: int) -> npt.NDArray[np.int64]:
    """(n,) of so many frames."""
    return START_NS + np.round(np.arange(count) * 1e9 / RATE_HZ).astype(np.int64)


def as_it_is(_: int, image: Image) -> Image:
    """No change."""
    return image


def dark(first: int, last: int) -> Change:
    """Frames of a camera in a bag: nothing but the noise of the sensor."""
    rng = np.random.default_rng(1)

    def change(k: int, image: Image) -> Image:
        noise = np.clip(rng.normal(3.0, 1.5, image.shape), 0.0, 255.0).astype(np.uint8)
        return noise if first <= k < last else image

    return change


def seen(poses: Floats, change: Change = as_it_is, seed: int = 0) -> list[VoFrame]:
    """What visual odometry tells of a run."""
    room = scene(seed)
    odometer = VisualOdometer(room.pair, room.mounting)
    return [
        odometer.add(t_ns, change(k, room.frame(pose)))
        for k, (t_ns, pose) in enumerate(zip(stamps(len(poses)).tolist(), poses, strict=True))
    ]


def off_at_end(poses: Floats, frames: list[VoFrame]) -> Floats:
    """(3,): told end against true end, from the first pose."""
    return between(between(poses[0], poses[-1]), between(frames[0].pose, frames[-1].pose))


def key_errors(poses: Floats, frames: list[VoFrame]) -> tuple[Floats, Floats]:
    """Errors (n, 3) and covariances (n, 3, 3) of the steps from key frame to key frame."""
    errors, covariances, before = [], [], poses[0]
    for pose, frame in zip(poses, frames, strict=True):
        if frame.key and frame.state is State.TRACKED:
            errors.append(between(between(before, pose), frame.motion_pose))
            covariances.append(frame.motion_covariance)
        if frame.key:
            before = pose
    return np.array(errors), np.array(covariances)


def nees(errors: Floats, covariances: Floats) -> Floats:
    """(n,): 3 in the mean where the covariances are right."""
    solved = np.linalg.solve(covariances, errors[..., None])[..., 0]
    return np.asarray((errors * solved).sum(axis=1))


def session(
    folder: Path, poses: Floats, change: Change = as_it_is, *, calibrated: bool = True
) -> Session:
    """A session with the frames as the recorder logs them, sightings of cones, and the truth."""
    t_ns = stamps(len(poses))
    info = SessionInfo(map="turn", power="low", trial=1)
    with Session.create(folder, info) as writer:
        writer.add_observations(_sightings(t_ns, poses))
        cones = LandmarkMap(np.arange(len(CONES)), CONES)
        path = Trajectory.from_poses(t_ns, poses)
        writer.add_ground_truth(GroundTruth(path, cones, {"source": "simulation"}))
    room = scene()
    with LogWriter(folder / ZED_LOG_NAME, sync_period_s=None, compressed=False) as log:
        for k, (at_ns, pose) in enumerate(zip(t_ns.tolist(), poses, strict=True)):
            _, jpeg = cv2.imencode(
                ".jpg", change(k, room.frame(pose)), [cv2.IMWRITE_JPEG_QUALITY, 90]
            )
            data = image_message(at_ns, "zed_left", "jpeg", jpeg.tobytes())
            log.write(ZED_TOPIC, IMAGE_TYPE, data, log_t_ns=at_ns + 20_000_000, stamp_ns=at_ns)
    if calibrated:
        write_calibration(folder / "calibration", zed_calibration())
    return Session.open(folder)


def _sightings(t_ns: npt.NDArray[np.int64], poses: Floats) -> Observations:
    """Every cone at every frame, as a sensor without error."""
    apart = CONES[None] - poses[:, None, :2]
    range_m = np.hypot(apart[..., 0], apart[..., 1])
    bearing = np.arctan2(apart[..., 1], apart[..., 0]) - poses[:, 2:]
    ids = np.tile(np.arange(len(CONES)), len(poses))
    return Observations(
        np.repeat(t_ns, len(CONES)), ids, range_m.ravel(), np.angle(np.exp(1j * bearing)).ravel()
    )
