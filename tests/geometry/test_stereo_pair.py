from __future__ import annotations

import numpy as np
import pytest

from geometry import Camera, CameraError, Mounting, StereoPair

EYE = Camera(672, 376, 350.0, 350.0, 336.0, 188.0)


def test_an_eye_without_a_turn_looks_ahead() -> None:
    rotation = Mounting().rotation
    np.testing.assert_allclose(rotation @ [0, 0, 1], [1, 0, 0], atol=1e-15)  # ahead
    np.testing.assert_allclose(rotation @ [1, 0, 0], [0, -1, 0], atol=1e-15)  # its right
    np.testing.assert_allclose(rotation @ [0, 1, 0], [0, 0, -1], atol=1e-15)  # its down


def test_turns_are_those_of_rep_103() -> None:
    ahead, right = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    down = Mounting(pitch_rad=0.2).rotation @ ahead
    np.testing.assert_allclose(down, [np.cos(0.2), 0.0, -np.sin(0.2)])
    left = Mounting(yaw_rad=0.3).rotation @ ahead
    np.testing.assert_allclose(left, [np.cos(0.3), np.sin(0.3), 0.0])
    leaning = Mounting(roll_rad=0.1).rotation @ right
    np.testing.assert_allclose(leaning, [0.0, -np.cos(0.1), -np.sin(0.1)])
    both = Mounting(pitch_rad=0.2, yaw_rad=0.3).rotation @ ahead
    np.testing.assert_allclose(
        both, [np.cos(0.2) * np.cos(0.3), np.cos(0.2) * np.sin(0.3), -np.sin(0.2)]
    )


def test_a_pair_tells_its_baseline_and_size() -> None:
    pair = StereoPair(EYE, EYE, np.eye(3), np.array([-0.12, 0.0, 0.05]))
    assert pair.baseline_m == pytest.approx(0.13)
    assert pair.eye_size_px == (672, 376)


@pytest.mark.parametrize(
    ("rotation", "translation", "right", "what"),
    [
        (np.eye(3), [0.12, 0, 0], EYE, "are the eyes swapped"),
        (2 * np.eye(3), [-0.12, 0, 0], EYE, "not a rotation"),
        (np.diag([1.0, 1, -1]), [-0.12, 0, 0], EYE, "not a rotation"),
        (np.eye(2), [-0.12, 0, 0], EYE, "shapes"),
        (np.eye(3), [-0.12, 0, 0], Camera(640, 480, 1.0, 1.0, 1.0, 1.0), "one size"),
    ],
)
def test_what_is_no_pair_is_refused(
    rotation: np.ndarray, translation: list[float], right: Camera, what: str
) -> None:
    with pytest.raises(CameraError, match=what):
        StereoPair(EYE, right, rotation, np.array(translation))
