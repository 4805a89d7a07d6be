from __future__ import annotations

import numpy as np
import pytest
from score_scenes import landmark_map, lap, ring, space_spiral, stamps, straight

from geometry import Floats, LandmarkMap, SpacePath, Trajectory, inverse
from scoring import Alignment, ScoreOptions, UndefinedScoreError
from scoring.alignment import align_planar, align_space, pose_of
from scoring.synchronise import PairedPaths, synchronise

POSE = np.array([3.0, -1.0, 2.0])
"""Of the estimate's frame in the world, in all of these tests."""


def _paths(truth: Trajectory, estimate: Trajectory | None = None) -> PairedPaths[Trajectory]:
    own = truth.transformed(inverse(POSE)) if estimate is None else estimate
    return synchronise(truth, own, ScoreOptions(min_poses=1))


def _aligned(
    paths: PairedPaths[Trajectory],
    truth: LandmarkMap | None = None,
    estimate: LandmarkMap | None = None,
    **choices: object,
) -> Alignment:
    return align_planar(paths, truth, estimate, ScoreOptions(min_poses=1, **choices))  # type: ignore[arg-type]  # words from the tests below


@pytest.mark.parametrize("align", ["origin", "path"])
def test_the_frame_of_a_moved_estimate_is_found(align: str) -> None:
    found = _aligned(_paths(lap()), align=align)
    np.testing.assert_allclose(pose_of(found), POSE, atol=1e-9)
    assert found.mode == align
    assert found.heading_observed


def test_none_moves_nothing() -> None:
    np.testing.assert_array_equal(pose_of(_aligned(_paths(lap()), align="none")), np.zeros(3))


def test_the_frame_is_found_from_the_map_whatever_the_ids() -> None:
    truth = landmark_map(ring().positions + np.array([0.3, 0.1]))
    own = truth.transformed(inverse(POSE))
    shuffled = LandmarkMap(own.ids + 100, own.positions[::-1])
    rng = np.random.default_rng(0)
    bent = lap().transformed(inverse(POSE))
    bent = Trajectory(bent.t_ns, bent.x + rng.normal(0, 0.1, 200), bent.y, bent.heading)
    found = _aligned(_paths(lap(), bent), truth, shuffled, align="map")
    np.testing.assert_allclose(pose_of(found), POSE, atol=1e-9)


def test_a_path_too_far_off_for_pairs_begins_with_a_larger_cutoff() -> None:
    truth = landmark_map([(0.0, 0.0), (4.0, 0.0), (0.0, 7.0), (5.0, 5.0)])
    beside = straight(60)
    beside = Trajectory(beside.t_ns, beside.x - 0.9, beside.y - 0.8, beside.heading)
    found = _aligned(_paths(straight(60), beside), truth, truth, align="map")
    np.testing.assert_allclose(pose_of(found), np.zeros(3), atol=1e-9)


def test_a_parked_car_is_aligned_by_its_map_from_its_first_pose() -> None:
    truth, parked = ring(), straight(20, speed_m_s=0.0)
    found = _aligned(_paths(parked), truth, truth.transformed(inverse(POSE)), align="map")
    np.testing.assert_allclose(pose_of(found), POSE, atol=1e-9)


def test_a_parked_car_does_not_fix_the_heading_of_its_path() -> None:
    with pytest.raises(UndefinedScoreError, match=r"--align path: .*use --align origin or none"):
        _aligned(_paths(straight(20, speed_m_s=0.0)), align="path")
    rng = np.random.default_rng(1)
    x, y = rng.normal(0, 0.001, (2, 20))
    noisy = Trajectory(stamps(20), x, y, np.zeros(20))
    assert not _aligned(_paths(noisy), align="path").heading_observed


def test_a_file_of_positions_only_does_not_fix_the_heading_of_its_origin() -> None:
    path = lap()
    positions_only = Trajectory(path.t_ns, path.x, path.y, np.zeros(200))
    assert not _aligned(_paths(path, positions_only), align="origin").heading_observed
    assert _aligned(_paths(straight()), align="origin").heading_observed


@pytest.mark.parametrize(
    ("truth", "estimate", "text"),
    [
        (None, ring(), "the truth has no landmarks"),
        (ring(), None, "the estimate has no landmarks"),
        (ring(), landmark_map([(0.0, 0.0)]), "truth has 8 and the estimate 1"),
        (ring(), landmark_map(np.zeros((0, 2))), "truth has 8 and the estimate 0"),
        (
            landmark_map([(0, 0), (9, 0)]),
            landmark_map([(0, 0), (0.5, 0)]),
            "fewer than two landmarks",
        ),
        (landmark_map([(0, 0), (0, 0)]), landmark_map([(0, 0), (0, 0)]), "coincide"),
    ],
)
def test_maps_that_cannot_be_aligned_say_why_and_what_else_to_do(
    truth: LandmarkMap | None, estimate: LandmarkMap | None, text: str
) -> None:
    with pytest.raises(UndefinedScoreError) as caught:
        _aligned(_paths(lap(), lap()), truth, estimate, align="map")
    assert text in str(caught.value)
    assert "use --align origin or none" in str(caught.value)


def _turned(path: SpacePath, rotation: Floats, translation: Floats) -> PairedPaths[SpacePath]:
    from scipy.spatial.transform import Rotation

    own = SpacePath(
        path.t_ns,
        (path.positions - translation) @ rotation,
        Rotation.from_matrix(rotation.T @ path.rotations).as_quat(),
    )
    return synchronise(path, own, ScoreOptions(space="3d"))


@pytest.mark.parametrize("align", ["origin", "path", "none"])
def test_in_space_the_matrix_is_found(align: str) -> None:
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler("xyz", [0.4, -0.3, 1.2]).as_matrix()
    translation = np.array([1.0, 2.0, 3.0])
    paths = _turned(space_spiral(), rotation, translation)
    found = align_space(paths, ScoreOptions(space="3d", align=align))  # type: ignore[arg-type]  # one of the three words above
    expected = np.eye(4)
    if align != "none":
        expected[:3, :3], expected[:3, 3] = rotation, translation
    np.testing.assert_allclose(np.array(found.matrix), expected, atol=1e-9)
    assert found.heading is None
    assert (found.x, found.y) == pytest.approx((expected[0, 3], expected[1, 3]))


def test_in_space_a_straight_line_does_not_fix_the_rotation() -> None:
    line = space_spiral()
    straight_line = SpacePath(
        line.t_ns, np.outer(np.arange(100.0), [1.0, 0.0, 0.0]), line.quaternions
    )
    paths = synchronise(straight_line, straight_line, ScoreOptions(space="3d"))
    with pytest.raises(UndefinedScoreError, match="--align path"):
        align_space(paths, ScoreOptions(space="3d", align="path"))
