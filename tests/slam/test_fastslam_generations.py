"""FastSLAM 1.0 and 2.0 with few particles on the same tracks."""

from __future__ import annotations

import dataclasses

import numpy as np
import world

from slam.fastslam.config import FASTSLAM_PRESETS
from slam.fastslam.filter import FastSlam
from slam.fastslam2.filter import FASTSLAM2_PRESETS, FastSlam2


def outcomes(particles: int) -> tuple[list[world.Outcome], list[world.Outcome]]:
    """Of both generations on the same drives, with as many particles."""
    config = dataclasses.replace(FASTSLAM_PRESETS["robust"], particles=particles)
    drives = [world.drive(track, seed) for track in ("turn", "loop") for seed in range(100, 108)]
    first = [world.run(FastSlam(config, "likelihood", s), d) for s, d in enumerate(drives)]
    second = [world.run(FastSlam2(config, "likelihood", s), d) for s, d in enumerate(drives)]
    return first, second


def mean_m(found: list[world.Outcome]) -> float:
    return float(np.mean([outcome.position_m for outcome in found]))


def test_with_few_particles_it_pays_to_look_before_moving() -> None:
    assert FASTSLAM2_PRESETS["robust"].particles == 100
    for particles, ratio in ((20, 0.75), (100, 0.9)):
        first, second = outcomes(particles)
        assert mean_m(second) < ratio * mean_m(first)
        assert max(outcome.position_m for outcome in second) < 0.06
        assert sum(o.false_negatives + o.false_positives for o in second) <= 2


def test_even_one_particle_finds_its_way() -> None:
    """Montemerlo et al. 2003 ran Victoria Park so; FastSLAM 1.0 with one is dead reckoning."""
    one = dataclasses.replace(FASTSLAM2_PRESETS["robust"], particles=1)
    found = world.run(FastSlam2(one, "likelihood"), world.drive("s-curve", 7))
    assert found.position_m < 0.08
    assert found.false_negatives == 0
