"""Visual odometry frame by frame: key frames, motion from the last of them, and being lost."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from geometry import Floats, Mounting, StereoPair, between, compose
from visual_odometry.config import VoConfig
from visual_odometry.following import EyePair, KeyFrame, brought_to_place, followed, key_frame
from visual_odometry.motion import Motion, MotionFit, coarse_motion, fitted_motion
from visual_odometry.mounting import CameraOnCar, CarMotion
from visual_odometry.rectification import Image, Rectifier


class State(Enum):
    """What is known after a frame.

    START : the first frame that can be used; TRACKED : how the car moved since the frame before;
    MISSED : nothing, but the key frame may be seen again; LOST : nothing, and what was driven since
    the last frame that was tracked will stay unknown.
    """

    START = "start"
    TRACKED = "tracked"
    MISSED = "missed"
    LOST = "lost"


@dataclass(frozen=True, eq=False)
class VoFrame:
    """What one frame told.

    pose : (3,) of the car where it was first seen, covariance : (3, 3); the last known ones unless
    tracked. motion_pose, motion_covariance : from the key frame that was in force. points,
    inliers : found again, and of these in agreement; sigma_px : of one of them. key : whether it is
    the new key frame; why : it is not tracked.
    """

    t_ns: int
    state: State
    pose: Floats
    covariance: Floats
    motion_pose: Floats
    motion_covariance: Floats
    points: int = 0
    inliers: int = 0
    sigma_px: float = 0.0
    key: bool = False
    why: str = ""


_NOTHING = np.zeros(3), np.zeros((3, 3))


class VisualOdometer:
    """Takes side-by-side pictures in the order of time and tells how the car moved."""

    def __init__(
        self, pair: StereoPair, mounting: Mounting, config: VoConfig | None = None
    ) -> None:
        self.config = config or VoConfig()
        self.rectifier = Rectifier(pair)
        self._car = CameraOnCar(mounting, self.rectifier.turn)
        self._key: KeyFrame | None = None
        self._key_pose, self._key_covariance = _NOTHING
        self._anchored = False  # whether what the key frame stands at follows from the one before
        self._motion: Floats = np.zeros(3)  # from the key frame to the last frame that was tracked
        self._speed: Floats = np.zeros(3)
        self._last_ns = 0
        self._started = False

    def add(self, t_ns: int, picture: Image) -> VoFrame:
        """The next picture (height, 2 * width), grey; t_ns : the middle of its exposure."""
        pair = EyePair.of(*self.rectifier.rectified(picture))
        if self._key is None:
            return self._begun(t_ns, pair)
        elapsed_s = (t_ns - self._last_ns) * 1e-9
        fit, told, why = self._tracked(self._key, pair, elapsed_s)
        if fit is None or told is None:
            return self._missed(t_ns, pair, elapsed_s, why)
        step = between(self._motion, told.pose)
        self._speed, self._motion, self._last_ns = step / elapsed_s, told.pose, t_ns
        self._anchored = True
        pose, covariance = self._placed(told)
        seen = int(fit.inliers.sum())
        key = self._is_key(told, seen) and self._renewed(pair, pose, covariance)
        return VoFrame(
            t_ns, State.TRACKED, pose, covariance, told.pose, told.covariance,
            fit.inliers.size, seen, fit.sigma_px, key,
        )  # fmt: skip

    def _begun(self, t_ns: int, pair: EyePair) -> VoFrame:
        """Make this frame the key frame, if it shows enough, where the car was known last."""
        self._last_ns = t_ns
        key = self._renewed(pair, self._key_pose, self._key_covariance)
        state = State.START if key and not self._started else State.LOST
        self._started, self._anchored = self._started or key, state is State.START
        why = "" if state is State.START else "begins anew here" if key else "too few points"
        points = 0 if self._key is None else len(self._key)
        return VoFrame(t_ns, state, self._key_pose, self._key_covariance, *_NOTHING,
                       points=points, key=key, why=why)  # fmt: skip

    def _missed(self, t_ns: int, pair: EyePair, elapsed_s: float, why: str) -> VoFrame:
        """Wait for the key frame to be seen again, or give it up."""
        pose, covariance = compose(self._key_pose, self._motion), self._key_covariance
        if self._anchored and elapsed_s < self.config.patience_s:
            return VoFrame(t_ns, State.MISSED, pose, covariance, *_NOTHING, why=why)
        self._key, self._key_pose = None, pose
        self._motion, self._anchored = np.zeros(3), False
        begun = self._begun(t_ns, pair)
        return VoFrame(t_ns, State.LOST, pose, covariance, *_NOTHING, points=begun.points,
                       key=begun.key, why=why)  # fmt: skip

    def _tracked(
        self, key: KeyFrame, pair: EyePair, elapsed_s: float
    ) -> tuple[MotionFit | None, CarMotion | None, str]:
        """The motion since the key frame, or why there is none."""
        config, eyes = self.config, self.rectifier.eyes
        turn = float(self._speed[2]) * elapsed_s
        ahead = compose(self._motion, np.array([*(self._speed[:2] * elapsed_s), turn]))
        expected = self._car.camera_motion(ahead)
        good, seen = followed(key, pair, eyes, expected, config)
        if len(seen) < config.least_inliers:
            return None, None, f"{len(seen)} points followed"
        found = coarse_motion(key.points[good], seen, eyes, expected, config.ransac_px)
        if found is None:
            return None, None, "the points agree on no motion"
        motion, agree = found
        if not self._enough(int(agree.sum()), agree.size):
            return None, None, f"{agree.sum()} of {agree.size} points agree on a motion"
        fit = self._refined(key, pair, motion)
        if fit is None:
            return None, None, "too few patches are found to be the same"
        told = self._car.car_motion(fit, config.covariance_factor)
        return (fit, told, "") if self._possible(told, elapsed_s) else (None, None, "impossible")

    def _refined(self, key: KeyFrame, pair: EyePair, motion: Motion) -> MotionFit | None:
        """The motion by patches that are bent as it tells, over all points that should be seen."""
        eyes = self.rectifier.eyes
        there = motion.applied(key.points)
        ahead = there[:, 2] > 0.05
        start = eyes.seen(np.where(ahead[:, None], there, key.points))
        exact, good = brought_to_place(key, pair, eyes, start, motion, self.config)
        good &= ahead
        if np.count_nonzero(good) < self.config.least_inliers:
            return None
        fit = fitted_motion(key.seen[good], exact[good], eyes, motion, self.config.pixel_sigma_px)
        seen_again = int(fit.inliers.sum())
        return fit if self._enough(seen_again, fit.inliers.size) else None

    def _enough(self, inliers: int, points: int) -> bool:
        config = self.config
        return inliers >= max(config.least_inliers, config.least_inlier_share * points)

    def _possible(self, told: CarMotion, elapsed_s: float) -> bool:
        """Whether a car could have moved so."""
        config = self.config
        step = between(self._motion, told.pose)
        return (
            float(np.hypot(*step[:2])) <= config.max_speed_m_s * elapsed_s
            and abs(float(step[2])) <= config.max_yaw_rate_rad_s * elapsed_s
            and told.tilt_rad <= np.radians(config.max_tilt_deg)
        )

    def _placed(self, told: CarMotion) -> tuple[Floats, Floats]:
        """Pose and covariance of the car where it was first seen."""
        x, y, _ = told.pose
        cos, sin = np.cos(self._key_pose[2]), np.sin(self._key_pose[2])
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        carry = np.eye(3)
        carry[:2, 2] = turn[:2, :2] @ (-y, x)
        own = turn @ told.covariance @ turn.T
        covariance: Floats = carry @ self._key_covariance @ carry.T + own
        return compose(self._key_pose, told.pose), covariance

    def _is_key(self, told: CarMotion, seen: int) -> bool:
        config, key = self.config, self._key
        assert key is not None
        return (
            float(np.hypot(*told.pose[:2])) > config.key_frame_m
            or abs(float(told.pose[2])) > np.radians(config.key_frame_deg)
            or seen < config.key_frame_share * len(key)
        )

    def _renewed(self, pair: EyePair, pose: Floats, covariance: Floats) -> bool:
        """Make a pair the key frame, if it shows enough."""
        key = key_frame(pair, self.rectifier.eyes, self._car.up, self._car.height_m, self.config)
        if len(key) < 2 * self.config.least_inliers:
            return False
        self._key, self._key_pose, self._key_covariance = key, pose, covariance
        self._motion = np.zeros(3)
        return True
