from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from geometry import wrap
from slam.config import PRESETS
from slam.ekf import EkfSlam
from slam.eyesight import SECTORS, new_eye, note, share
from slam.fastslam.config import FASTSLAM_PRESETS
from slam.fastslam.filter import FastSlam
from slam.interface import Slam


def test_what_is_believed_has_the_benefit_of_the_doubt() -> None:
    eye = new_eye()
    assert (share(eye, 0.3, True), share(eye, 0.3, False)) == (0.0, 1.0)
    for _ in range(6):
        note(eye, 0.3, True)
    for _ in range(3):
        note(eye, 0.3, False)
    assert share(eye, 0.3, True) == pytest.approx(0.6)
    assert share(eye, 0.3, False) == pytest.approx(0.7)
    assert share(eye, 0.3 + math.pi, True) == 0.0


def test_every_direction_has_its_sector_across_the_seam() -> None:
    for bearing in np.linspace(-2.0 * math.pi, 2.0 * math.pi, 97):
        eye = new_eye()
        note(eye, bearing, True)
        assert eye.sum() == 1.0
        assert share(eye, bearing + 2.0 * math.pi, True) == 0.5
    eye = new_eye()
    for bearing in (np.arange(SECTORS) + 0.5) * 2.0 * math.pi / SECTORS:
        note(eye, bearing, True)
    assert eye[:, 0].tolist() == [1.0] * SECTORS


def turning(slam: Slam, half_angle_rad: float) -> int:
    """Turn on the spot among eight landmarks, looking ahead only; how many are left in the end."""
    angle = np.arange(8) * 2.0 * math.pi / 8.0
    cones = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    heading = 0.0
    for t in range(480):
        slam.predict(np.array([[0.0, 0.0, 2.0 * math.pi / 120.0]]), np.array([0.1]))
        heading += 2.0 * math.pi / 120.0
        bearings = wrap(np.arctan2(cones[:, 1], cones[:, 0]) - heading)
        ahead = np.abs(bearings) < half_angle_rad
        slam.update(t, np.full(ahead.sum(), -1), np.ones(ahead.sum()), bearings[ahead])
    return len(slam.estimated_map())


@pytest.mark.parametrize("learns", [True, False])
def test_a_camera_does_not_lose_what_it_has_turned_away_from(learns: bool) -> None:
    robust, fast = PRESETS["robust"], FASTSLAM_PRESETS["robust"]
    rules = dataclasses.replace(robust.landmarks, learns_field_of_view=learns)
    ekf = EkfSlam(dataclasses.replace(robust, landmarks=rules), "nearest")
    cloud = FastSlam(dataclasses.replace(fast, landmarks=rules, particles=30), "likelihood")
    left = turning(ekf, 0.6), turning(cloud, 0.6)
    assert left == (8, 8) if learns else max(left) <= 4


def test_a_lidar_still_forgets_what_has_gone() -> None:
    slam = EkfSlam(PRESETS["robust"], "nearest")
    for t in range(60):
        there = [(1.0, 0.0), (1.0, 1.0), (1.0, -2.0)][: 3 if t < 30 else 2]
        ranges, bearings = np.array(there).T
        slam.update(t, np.full(len(there), -1), ranges, bearings)
    assert len(slam.estimated_map()) == 2
