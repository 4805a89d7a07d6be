"""Sightings of a board in both eyes -> two cameras and how they stand to each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.board import BoardSighting
from calibration.errors import CalibrationError
from calibration.intrinsics import fit_intrinsics
from calibration.stereo.sightings import PairSighting
from geometry import Camera, Floats, StereoPair, camera_of

_LENS, _POSE = 6, 6
"""Parameters of a lens (fx, fy, cx, cy, k1, k2); of a pose (turn, translation)."""
_OWN = 2 * _LENS


@dataclass(frozen=True, eq=False)
class StereoFit:
    """A pair, residuals (n, 4) of each view (left u, v, right u, v), covariance (6, 6).

    covariance : of the turn (Rodrigues) and translation from the left eye to the right.
    epipolar_px : rows apart of the two images of each point (n,), rectified.
    """

    pair: StereoPair
    residuals: tuple[Floats, ...]
    covariance: Floats
    epipolar_px: Floats

    @property
    def rms_px(self) -> float:
        """Root mean square distance of a point in one eye from where it should be."""
        return float(np.sqrt((np.concatenate(self.residuals) ** 2).sum(axis=1).mean() / 2.0))

    @property
    def view_rms_px(self) -> Floats:
        """The same of each view."""
        return np.array([np.sqrt((one**2).sum(axis=1).mean() / 2.0) for one in self.residuals])

    @property
    def epipolar_rms_px(self) -> float:
        """Root mean square of `epipolar_px`."""
        return float(np.sqrt((self.epipolar_px**2).mean()))


def fit_stereo(views: Sequence[PairSighting], size_px: tuple[int, int]) -> StereoFit:
    """The pair with the least squared residuals, both lenses and every board adjusted together.

    size_px : width, height of one eye. Raises `CalibrationError` when nothing fits.
    """
    import cv2

    lenses = [
        _lens([BoardSighting(v.name, v.points_m, at) for v, at in eye], size_px)
        for eye in ([(v, v.left) for v in views], [(v, v.right) for v in views])
    ]
    points = [view.points_m.astype(np.float32) for view in views]
    lefts = [view.left.astype(np.float32) for view in views]
    rights = [view.right.astype(np.float32) for view in views]
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-10)
    try:
        _, k1, d1, k2, d2, rotation, move, _, _, turns, moves, _ = cv2.stereoCalibrateExtended(
            points, lefts, rights, *lenses[0], *lenses[1], size_px, np.eye(3), np.zeros(3),
            flags=cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3,
            criteria=stop,
        )  # fmt: skip
    except cv2.error as err:
        raise CalibrationError(
            f"no pair of cameras explains these pictures: {err.err}; is the board flat, as large "
            "and as fine as was told?"
        ) from err
    left, right = (
        _camera(np.asarray(matrix, np.float64), np.asarray(bent, np.float64), size_px)
        for matrix, bent in ((k1, d1), (k2, d2))
    )
    translation = np.asarray(move, np.float64).ravel()
    pair = StereoPair(left, right, _square(np.asarray(rotation, np.float64)), translation)
    places = [np.concatenate([np.ravel(t), np.ravel(m)]) for t, m in zip(turns, moves, strict=True)]
    residuals, covariance = _residuals(views, places, pair)
    return StereoFit(pair, residuals, covariance, epipolar_errors(pair, views))


def _lens(sightings: Sequence[BoardSighting], size_px: tuple[int, int]) -> tuple[Floats, Floats]:
    """Matrix and distortion of one eye, to begin with.

    Without tangential terms and k3, as the factory has it: they would be told apart from a turn of
    the eye by nothing but noise.
    """
    camera = fit_intrinsics(sightings, size_px, 0.0).camera
    return camera.matrix, np.array([*camera.distortion[:2], 0.0, 0.0, 0.0])


def epipolar_errors(pair: StereoPair, views: Sequence[PairSighting]) -> Floats:
    """Rows (n,) by which the right eye sees each point lower than the left one, rectified."""
    import cv2

    lenses = [(c.matrix, np.array(c.distortion)) for c in (pair.left, pair.right)]
    turns = cv2.stereoRectify(
        *lenses[0], *lenses[1], pair.eye_size_px, np.array(pair.rotation),
        np.array(pair.translation), flags=cv2.CALIB_ZERO_DISPARITY, alpha=0.0,
    )  # fmt: skip
    rows = [
        np.concatenate([
            np.asarray(cv2.undistortPoints(eye.reshape(-1, 1, 2), *lens, R=turn, P=way))[:, 0, 1]
            for eye in eyes
        ])
        for eyes, lens, turn, way in (
            ([v.left for v in views], lenses[0], turns[0], turns[2]),
            ([v.right for v in views], lenses[1], turns[1], turns[3]),
        )
    ]  # fmt: skip
    apart: Floats = rows[1] - rows[0]
    return apart


def _camera(matrix: Floats, bent: Floats, size_px: tuple[int, int]) -> Camera:
    values = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *np.ravel(bent)[:5]]
    return camera_of(np.array(values), *size_px)


def _square(rotation: Floats) -> Floats:
    """The nearest rotation: OpenCV's is one to a few digits less than ours must be."""
    u, _, v = np.linalg.svd(rotation)
    nearest: Floats = u @ v
    return nearest


def _residuals(
    views: Sequence[PairSighting], places: Sequence[Floats], pair: StereoPair
) -> tuple[tuple[Floats, ...], Floats]:
    """Residuals of each view, and the covariance (6, 6) of the pair's turn and translation.

    The sandwich over views (Liang and Zeger, 1986), every board's place eliminated: errors of one
    view go together, as one board is bent, lit and blurred in one way.
    """
    import cv2

    turn = np.ravel(cv2.Rodrigues(np.array(pair.rotation))[0])
    between = np.concatenate([turn, pair.translation])
    size = _OWN + _POSE
    information, scatter = np.zeros((size, size)), np.zeros((size, size))
    residuals = []
    for view, place in zip(views, places, strict=True):
        off, shared, own = _linearised(view, place, between, pair)
        residuals.append(off)
        free = shared - own @ np.linalg.solve(own.T @ own, own.T @ shared)
        pull = free.T @ np.concatenate([off[:, :2].ravel(), off[:, 2:].ravel()])
        information += free.T @ free
        scatter += np.outer(pull, pull)
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information * scale[:, None] * scale) * scale[:, None] * scale
    few = len(views) / max(len(views) - size / 6.0, 1.0)
    covariance = few * inverse @ scatter @ inverse
    return tuple(residuals), covariance[_OWN:, _OWN:]


def _linearised(
    view: PairSighting, place: Floats, between: Floats, pair: StereoPair
) -> tuple[Floats, Floats, Floats]:
    """Residuals (n, 4); slopes (4n, 18) by lenses and the pair's pose, (4n, 6) by the board's."""
    import cv2

    turn, move = place[:3], place[3:]
    composed = cv2.composeRT(turn, move, between[:3], between[3:])
    right_turn, right_move = (np.ravel(part) for part in composed[:2])
    dr_turn, dr_move, dr_turn2, dr_move2, dt_turn, dt_move, dt_turn2, dt_move2 = composed[2:]
    by_board = np.block([[dr_turn, dr_move], [dt_turn, dt_move]])
    by_pair = np.block([[dr_turn2, dr_move2], [dt_turn2, dt_move2]])
    seen, slopes = [], []
    for camera, t, m in ((pair.left, turn, move), (pair.right, right_turn, right_move)):
        at, slope = cv2.projectPoints(
            view.points_m, t, m, camera.matrix, np.array(camera.distortion)
        )
        seen.append(np.asarray(at).reshape(-1, 2))
        slopes.append(np.asarray(slope))
    count = 2 * len(view.points_m)
    shared, own = np.zeros((2 * count, _OWN + _POSE)), np.zeros((2 * count, _POSE))
    lens = slice(_POSE, _POSE + _LENS)
    shared[:count, :_LENS], shared[count:, _LENS:_OWN] = slopes[0][:, lens], slopes[1][:, lens]
    shared[count:, _OWN:] = slopes[1][:, :6] @ by_pair
    own[:count], own[count:] = slopes[0][:, :6], slopes[1][:, :6] @ by_board
    return np.concatenate([view.left - seen[0], view.right - seen[1]], axis=1), shared, own
