"""A drive as calibrations see it: where the car was, what was counted and steered, in windows.

A window is a third of a second: the film knows places, not speeds, and between two places of it
the counts of the motor and the turning of the wheels have had something to do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from calibration.errors import CalibrationError
from calibration.turning import GyroFit, fit_gyro
from capture import MissingStreamError, Session
from geometry import Floats, Stamps, Trajectory

WINDOW_S = 0.35
MAX_GAP_S = 0.12
CLUSTER_WINDOWS = 6
MOVING_M_S = 0.05
GYRO_RMS_RAD = 0.02
"""A gyro that leaves more of the filmed headings over does not belong to this film."""


@dataclass(frozen=True, eq=False)
class Driven:
    """One session's samples (n,) at the stamps of the motor controller, else of the film.

    t_s : from `start_ns`; xy (n, 2), heading : of the truth, the latter unwrapped; counts, erpm :
    of the motor, None without one; servo_t_s, servo : raw commands (k,), empty without; pairs :
    (w, 2) rows at the ends of the windows in which the car moved; gyro : None where the headings
    are the film's own.
    """

    name: str
    start_ns: int
    t_s: Floats
    xy: Floats
    heading: Floats
    counts: Floats | None
    erpm: Floats | None
    servo_t_s: Floats
    servo: Floats
    pairs: npt.NDArray[np.int64]
    gyro: GyroFit | None

    @property
    def speed_m_s(self) -> Floats:
        """(w,) mean speed in each window, along the chord."""
        i, j = self.pairs.T
        chord = np.linalg.norm(self.xy[j] - self.xy[i], axis=1)
        half = 0.5 * np.abs(self.heading[j] - self.heading[i])
        arc = chord / np.sinc(half / np.pi)
        return np.asarray(arc / (self.t_s[j] - self.t_s[i]))

    @property
    def turn_rad(self) -> Floats:
        """(w,) how far the car turned in each window."""
        i, j = self.pairs.T
        return np.asarray(self.heading[j] - self.heading[i])

    @property
    def clusters(self) -> npt.NDArray[np.int64]:
        """(w,) windows whose errors may go together: some seconds of a drive."""
        return np.arange(len(self.pairs)) // CLUSTER_WINDOWS

    def servo_means(self, lag_s: float) -> Floats:
        """(n - 1,) what the servo was told on average in each step, `lag_s` before.

        Before the first command it is taken to have stood where that put it.
        """
        first = min(float(self.t_s[0]), float(self.servo_t_s[0])) - 10.0
        last = max(float(self.t_s[-1]), float(self.servo_t_s[-1])) + 10.0
        edges = np.concatenate([[first], self.servo_t_s[1:], [last]])
        summed = np.concatenate([[0.0], np.cumsum(self.servo * np.diff(edges))])
        at = np.interp(self.t_s - lag_s, edges, summed)
        return np.asarray(np.diff(at) / np.diff(self.t_s))


def driven_of(session: Session) -> Driven:
    """The drive of a session with ground truth.

    Raises `CalibrationError` where truth and log do not overlap, `MissingStreamError` where there
    is no truth.
    """
    truth = session.ground_truth().path
    try:
        state = session.vesc_state()
        t_ns, counts, erpm = state.t_ns, state.tachometer, state.speed_erpm
    except MissingStreamError:
        t_ns, counts, erpm = truth.t_ns, None, None
    inside = truth.covers(t_ns, MAX_GAP_S)
    if np.count_nonzero(inside) < 20:
        raise CalibrationError(
            f"{session.folder}: the ground truth and the recording of the car do not overlap; are "
            "both on the car's clock? trackside join puts them there"
        )
    t_ns = t_ns[inside]
    placed = truth.interpolated(t_ns)
    gyro = _gyro(session, truth, t_ns)
    heading = np.unwrap(placed.heading) if gyro is None else gyro.heading_at(t_ns)
    start_ns = int(t_ns[0])
    servo_t_s, servo = _servo(session, start_ns)
    t_s = np.asarray((t_ns - start_ns) * 1e-9, np.float64)
    return Driven(
        session.name,
        start_ns,
        t_s,
        placed.positions,
        heading,
        None if counts is None else counts[inside],
        None if erpm is None else erpm[inside],
        servo_t_s,
        servo,
        _windows(t_s, placed),
        gyro,
    )


def _gyro(session: Session, truth: Trajectory, t_ns: Stamps) -> GyroFit | None:
    """The gyro, fitted to the truth, where it tells the headings better than the film."""
    try:
        found = fit_gyro(truth, session.imu())
    except MissingStreamError:
        return None
    usable = found is not None and found.covers(t_ns) and found.rms_rad < GYRO_RMS_RAD
    return found if usable else None


def _servo(session: Session, start_ns: int) -> tuple[Floats, Floats]:
    """Raw servo commands; `/drive` holds angles as the rig believed them when it was recorded."""
    none: Floats = np.zeros(0)
    try:
        drive = session.drive()
    except MissingStreamError:
        return none, none
    believed = session.recorded_motor_calibration()
    if believed is None:
        raise CalibrationError(
            f"{session.folder}: session.yaml does not say with which vesc_calibration its steering "
            "was written; record it with a rig that has one"
        )
    told = np.isfinite(drive.steering_rad)
    gain, offset = (
        believed.steering_angle_to_servo_gain,
        believed.steering_angle_to_servo_offset,
    )
    t_s = np.asarray((drive.t_ns[told] - start_ns) * 1e-9, np.float64)
    return t_s, gain * drive.steering_rad[told] + offset


def _windows(t_s: Floats, placed: Trajectory) -> npt.NDArray[np.int64]:
    """(w, 2) rows of successive windows without gaps in which the car moved."""
    broken = np.concatenate([[0], np.cumsum(np.diff(t_s) > MAX_GAP_S)])
    xy, pairs, i = placed.positions, [], 0
    while i < t_s.size - 1:
        j = int(np.searchsorted(t_s, t_s[i] + WINDOW_S - 1e-6))
        if j >= t_s.size:
            break
        moved = np.linalg.norm(xy[j] - xy[i]) > MOVING_M_S * WINDOW_S
        if broken[i] == broken[j] and moved:
            pairs.append((i, j))
        i = j
    return np.array(pairs, np.int64).reshape(-1, 2)


def window_sums(pairs: npt.NDArray[np.int64], per_step: Floats) -> Floats:
    """(w, ...) sums of values (n - 1, ...) over the steps of each window."""
    zero = np.zeros((1, *per_step.shape[1:]))
    summed = np.concatenate([zero, np.cumsum(per_step, axis=0)])
    return np.asarray(summed[pairs[:, 1]] - summed[pairs[:, 0]])


def stacked_clusters(drives: Sequence[Driven]) -> npt.NDArray[np.int64]:
    """(all windows,) clusters of several drives, told apart."""
    found, first = [np.zeros(0, np.int64)], 0
    for drive in drives:
        found.append(drive.clusters + first)
        first += int(drive.clusters.max(initial=0)) + 1
    return np.concatenate(found)
