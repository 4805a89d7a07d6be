from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
import pytest
from filmed_run import CONES, RATE_HZ, SCENE, VIEW, Run, world

from geometry import Camera, Floats, looking_at, transform_points, wrap
from tracking import ImageError, TrackingError
from tracking.bridging import bridge
from tracking.ground_truth import TrackResult, track_film
from tracking.images import Image
from tracking.scene import CarRings, ConeRings, Scene


@lru_cache(maxsize=1)
def plain() -> tuple[Run, TrackResult]:
    run = Run()
    return run, track_film(run.film(), world(), SCENE)


def errors(run: Run, result: TrackResult) -> Floats:
    """x, y in metres and heading, (n, 3), of every pose."""
    path = result.truth.path
    off = path.poses - run.poses[np.searchsorted(run.t_ns, path.t_ns)]
    return np.asarray(np.column_stack([off[:, :2], wrap(off[:, 2])]))


def test_the_car_is_known_to_a_fraction_of_a_millimetre_at_every_frame() -> None:
    run, result = plain()
    np.testing.assert_array_equal(result.truth.path.t_ns, run.t_ns)
    off = errors(run, result)
    assert np.abs(off[:, :2]).max() < 3e-4
    assert np.degrees(np.abs(off[:, 2])).max() < 0.1
    assert result.judgement.good
    assert result.judgement.coverage == 1.0
    assert result.judgement.span_mean_m == pytest.approx(0.2, abs=2e-4)


def test_front_and_rear_are_told_apart_by_driving() -> None:
    """Twice, so that one of the two starts with the names swapped."""
    for heading in (0.2, 0.2 - np.pi):
        run = Run(start=np.array([0.35 if heading < 0 else -0.5, -0.1, heading]), frames=40)
        result = track_film(run.film(), world(), SCENE)
        assert np.abs(errors(run, result)[:, 2]).max() < 0.01


def test_cones_are_the_rings_that_are_neither_corner_nor_car() -> None:
    _, result = plain()
    cones = result.truth.landmarks
    assert cones is not None
    assert cones.covariances is not None
    assert cones.ids.tolist() == [1, 2, 3]
    np.testing.assert_allclose(cones.positions, CONES, atol=2e-4)
    sigma = np.sqrt(cones.covariances[:, 0, 0])
    assert (sigma > 5e-5).all()
    assert (sigma < 2e-3).all()


def test_named_cones_keep_their_numbers_and_strangers_are_told() -> None:
    run = Run(frames=20)
    places = {"7": (0.6, -0.4), "3": (-0.4, -0.1), "9": (-0.9, 0.7)}
    scene = replace(SCENE, cones=ConeRings(places=places))
    result = track_film(run.film(), world(), scene)
    cones = result.truth.landmarks
    assert cones is not None
    assert cones.ids.tolist() == [3, 7]
    np.testing.assert_allclose(cones.positions, CONES[[0, 2]], atol=2e-4)
    text = "\n".join(result.judgement.remarks)
    assert "cone 9: no ring" in text
    assert "1 rings stand where the scene names no cone" in text


def test_a_gap_is_bridged_and_flagged_and_its_covariance_holds() -> None:
    run = Run(frames=50, occluded=(32, 39))
    result = track_film(run.film(), world(), SCENE)
    assert result.bridged[32:39].all()
    assert not result.bridged[:32].any()
    assert not result.bridged[42:].any()
    off = errors(run, result)
    covariances = result.truth.path_covariances
    assert covariances is not None
    sigma = np.sqrt(covariances[:, [0, 1, 2], [0, 1, 2]])
    assert (np.abs(off) < 4.0 * sigma).all()
    assert sigma[35, 0] > 3.0 * sigma[20, 0]
    assert np.abs(off[:, :2]).max() < 0.02
    assert 8 / RATE_HZ < result.judgement.longest_gap_s + 1e-6 < 11 / RATE_HZ


def test_a_long_gap_is_left_out() -> None:
    run = Run(frames=50, occluded=(30, 42))
    result = track_film(run.film(), world(), replace(SCENE, max_bridge_s=0.2))
    assert not np.isin(run.t_ns[31:41], result.truth.path.t_ns).any()
    assert "% of the frames" in "\n".join(result.judgement.reasons)
    assert not result.judgement.good


def test_damaged_and_black_frames_are_counted_and_bridged() -> None:
    def change(k: int, image: Image) -> Image | None:
        return None if k == 30 else image

    run = Run(frames=45, change=change)
    result = track_film(run.film(), world(), SCENE)
    assert result.judgement.damaged == 1
    assert "1 frames left out, damaged: 30" in "\n".join(result.judgement.remarks)
    assert run.t_ns[30] not in result.truth.path.t_ns
    assert result.judgement.coverage == pytest.approx(44 / 45)


def test_pictures_torn_within_are_found_by_their_rings() -> None:
    """Forty bytes overwritten in the middle of a JPEG: it decodes, and parts of it are shifted."""
    rng = np.random.default_rng(0)

    def change(k: int, image: Image) -> Image | None:
        if k % 6 != 1 or k < 5:
            return image
        data = bytearray(cv2.imencode(".jpg", image)[1].tobytes())
        start = int(rng.integers(len(data) // 5, len(data) * 4 // 5))
        data[start : start + 40] = rng.integers(0, 255, 40, np.uint8).tobytes()
        decoded = cv2.imdecode(np.frombuffer(bytes(data), np.uint8), cv2.IMREAD_GRAYSCALE)
        return None if decoded is None else np.asarray(decoded, np.uint8)

    run = Run(frames=50, change=change)
    result = track_film(run.film(), world(), SCENE)
    assert np.abs(errors(run, result)[:, :2]).max() < 3e-3
    assert result.watch.bumps == ()
    assert result.watch.moved_ns is None
    told = [line for line in result.judgement.remarks if "torn" in line]
    assert len(told) == 1
    assert 4 <= int(told[0].split()[0]) <= 12
    assert result.judgement.frames == 50


def test_a_camera_that_was_knocked_is_told() -> None:
    def change(k: int, image: Image) -> Image:
        return np.roll(image, 1, axis=1) if k >= 30 else image

    result = track_film(Run(frames=48, change=change).film(), world(), SCENE)
    assert not result.judgement.good
    (reason,) = [one for one in result.judgement.reasons if "camera moved" in one]
    assert "the camera moved 1.0 s after the start, by up to 1.0 px" in reason
    assert result.watch.bumps == ()


def test_a_bumped_cone_is_named() -> None:
    result = track_film(Run(frames=60, bump=25).film(), world(), SCENE)
    (bump,) = result.watch.bumps
    assert bump.name == "cone 2"
    assert bump.moved_m == pytest.approx(np.hypot(0.03, 0.02), abs=1e-3)
    assert result.watch.moved_ns is None
    assert not result.judgement.good
    assert "cone 2 was bumped" in "\n".join(result.judgement.reasons)


def test_cones_that_stand_on_their_rings_come_from_an_earlier_film() -> None:
    _, first = plain()
    run = Run(hidden_cones=True, frames=35)
    result = track_film(run.film(), world(), SCENE, cones=first.truth.landmarks)
    assert result.truth.landmarks is first.truth.landmarks
    assert result.judgement.good
    assert "hardly ever in sight during the run: cone 1, cone 2, cone 3" in result.judgement.remarks


def test_a_wrong_height_of_the_car_is_noticed() -> None:
    scene = replace(SCENE, car=CarRings(height_m=0.1), start_heading_deg=10.0)
    result = track_film(Run(frames=30).film(), world(), scene)
    assert not result.judgement.good
    assert "height_m or the lever arms are wrong" in "\n".join(result.judgement.reasons)


def test_the_lever_arm_reaches_base_link() -> None:
    _, usual = plain()
    shifted = replace(SCENE, car=CarRings(front_x_m=0.35, rear_x_m=0.15, side_m=0.04))
    result = track_film(Run().film(), world(), shifted)
    heading = usual.truth.path.heading
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    expected = usual.truth.path.positions - 0.1 * ahead - 0.04 * left
    np.testing.assert_allclose(result.truth.path.positions, expected, atol=1e-6)


def test_rings_that_stand_askew_are_turned_back() -> None:
    """The line through the rings is turned about their middle, which stays where it is."""
    _, usual = plain()
    askew = replace(SCENE, car=CarRings(yaw_rad=0.05, side_m=0.01))
    result = track_film(Run().film(), world(), askew)
    assert np.abs(wrap(usual.truth.path.heading - 0.05 - result.truth.path.heading)).max() < 1e-9
    count = len(usual.truth.path)
    rings = transform_points(usual.truth.path.poses, np.tile([0.15, 0.0], (count, 1)))
    again = transform_points(result.truth.path.poses, np.tile([0.15, 0.01], (count, 1)))
    np.testing.assert_allclose(again, rings, atol=1e-6)


def test_what_cannot_be_tracked_is_refused() -> None:
    with pytest.raises(TrackingError, match=r"rejected, nothing can be measured.*mistyped"):
        track_film(Run().film(), world(accepted=False), SCENE)
    small = Camera(480, 360, 320.0, 319.0, 238.0, 182.0)
    view = looking_at(small, VIEW.position, np.zeros(3), np.array([0.0, 1.0, 0.0]))
    with pytest.raises(ImageError, match="960x720 pixels, the calibration is for 480x360"):
        track_film(Run(frames=5).film(), world(view), SCENE)
    black = Run(frames=5, change=lambda *_: None)
    with pytest.raises(TrackingError, match="no good picture in its first"):
        track_film(black.film(), world(), SCENE)
    with pytest.raises(TrackingError, match="the car was seen in none of 8 frames"):
        track_film(Run(frames=8, occluded=(0, 8)).film(), world(), SCENE)


def test_scenes_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match="front ring must be ahead"):
        CarRings(front_x_m=0.0, rear_x_m=0.2)
    with pytest.raises(ValueError, match="places are numbers"):
        ConeRings(places={"left": (1.0, 2.0)})
    assert Scene().car.span_m == pytest.approx(0.2)


def test_a_bridge_follows_a_constant_acceleration_and_knows_its_own_error() -> None:
    rng = np.random.default_rng(3)
    t_s = np.arange(60) / 30.0
    t_ns = np.rint(t_s * 1e9).astype(np.int64)
    true = np.stack([0.5 * t_s + 0.4 * t_s**2, 1.0 - 0.2 * t_s, 3.0 + 0.8 * t_s], axis=1)
    sigma = np.array([1e-3, 1e-3, 2e-3])
    poses = true + sigma * rng.standard_normal((60, 3))
    poses[:, 2] = wrap(poses[:, 2])
    seen = np.ones(60, bool)
    seen[25:35] = False
    smooth, spread = bridge(t_ns, poses, np.tile(np.diag(sigma**2), (60, 1, 1)), seen)
    off = np.abs(smooth - true)
    allowed = 4.0 * np.sqrt(spread[:, range(3), range(3)])
    assert (off < allowed).all()
    assert off[30, :2].max() < 0.03
    assert spread[30, 0, 0] > 10.0 * spread[10, 0, 0]
