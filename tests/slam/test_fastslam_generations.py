"""FastSLAM 1.0 and 2.0 with few particles on the same tracks."""

from __future__ import annotations

import dataclasses

import numpy as np
import world

from slam.fastslam.config import FASTSLAM_PRESETS
from slam.fastslam.filter import FastSlam
from slam.fastslam2.filter import FASTSLAM2_PRESETS, FastSlam2


def test_with_a_hundred_particles_looking_first_halves_the_error() -> None:
    few = dataclasses.replace(FASTSLAM_PRESETS["robust"], particles=100)
    assert few == FASTSLAM2_PRESETS["robust"]
    drives = [world.drive("loop", seed) for seed in range(100, 108)]
    first = [world.run(FastSlam(few, "likelihood", s), d) for s, d in enumerate(drives)]
    second = [world.run(FastSlam2(few, "likelihood", s), d) for s, d in enumerate(drives)]
    assert np.mean([o.position_m for o in second]) < 0.6 * np.mean([o.position_m for o in first])
    assert max(o.position_m for o in second) < 0.03
    assert sum(o.false_negatives + o.false_positives for o in second) <= 1


def test_even_one_particle_finds_its_way() -> None:
    """Montemerlo et al. 2003 ran Victoria Park so; FastSLAM 1.0 with one is dead reckoning."""
    one = dataclasses.replace(FASTSLAM2_PRESETS["robust"], particles=1)
    found = world.run(FastSlam2(one, "likelihood"), world.drive("s-curve", 7))
    assert found.position_m < 0.08
    assert found.false_negatives == 0
