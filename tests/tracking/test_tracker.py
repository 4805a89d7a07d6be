"""Markers from frame to frame: accuracy, what is in the way, what is lost, and who is who."""

from __future__ import annotations

import numpy as np
import pytest
from ring_scenes_small import (
    CAR,
    CONES,
    PERIOD_NS,
    Track,
    car_markers,
    cone_markers,
    sheet,
    small_oblique_view,
    small_view,
)

from geometry import Floats, RingShape, View, wrap
from simulation import Light, OverheadScene, Ring
from tracking import (
    ImageError,
    Marker,
    RingTracker,
    State,
    TrackedFrame,
    TrackerConfig,
    TrackingError,
    heading_between,
)


def drive(track: Track, poses: Floats, speed: float = 0.0) -> list[tuple[TrackedFrame, Floats]]:
    """What the tracker says of a car on these poses (n, 3), and the true centres (m, 2)."""
    results = []
    for pose in poses:
        velocity = (speed * float(np.cos(pose[2])), speed * float(np.sin(pose[2])))
        frame = track.picture(pose, velocity)
        results.append((track.tracker.step(frame.image, track.t_ns()), frame.xyz_m[:, :2]))
    return results


def bend(n: int, speed: float = 1.0, radius: float = 0.6) -> Floats:
    """Poses (n, 3) on a circle, from the left to the right."""
    angle = np.pi - np.arange(n) * speed * PERIOD_NS * 1e-9 / radius
    along = angle - np.pi / 2.0
    return np.stack([radius * np.cos(angle), radius * np.sin(angle) - 0.3, wrap(along)], axis=1)


@pytest.mark.parametrize(
    ("view", "limit_px"), [(small_view(), 0.008), (small_oblique_view(), 0.015)]
)
def test_standing_rings_are_followed_to_a_hundredth_of_a_pixel(view: View, limit_px: float) -> None:
    track, errors, told = Track(view), [], []
    for _ in range(25):
        frame = track.picture()
        seen = track.tracker.step(frame.image, track.t_ns())
        assert (seen.states == State.SEEN).all()
        errors.append(seen.centres_px - frame.centres_px)
        off = seen.xy_m - frame.xyz_m[:, :2]
        told.append(np.einsum("ni,nij,nj->n", off, np.linalg.inv(seen.covariance_m2), off))
    assert np.sqrt(np.mean(np.square(errors))) < limit_px
    # Two degrees of freedom: the covariance is neither boast nor excuse.
    assert 0.4 < np.mean(told) / 2.0 < 2.5


def test_a_driving_car_is_followed_with_its_heading() -> None:
    track = Track(small_view(), car=True, exposure_s=0.005)
    poses = bend(40)
    track.tracker.expect_heading(float(poses[0, 2]) + 0.6)
    results = drive(track, poses, 1.0)
    assert all(seen.seen.all() for seen, _ in results)
    off = np.array([seen.xy_m[-2:] - true[-2:] for seen, true in results])
    assert 1e3 * np.sqrt((off**2).sum(axis=-1).mean()) < 0.1
    turns = [heading_between(*seen.xy_m[-2:]) for seen, _ in results]
    assert np.degrees(np.abs(wrap(np.array(turns) - poses[:, 2]))).max() < 0.1


def test_a_cable_across_a_ring_does_not_move_it() -> None:
    track = Track(small_view())
    track.tracker.step(track.picture().image, track.t_ns())
    frame = track.picture(occluders=[(sheet(track.picture().centres_px[2], (200.0, 2.0)), 20.0)])
    seen = track.tracker.step(frame.image, track.t_ns())
    assert seen.states[2] == State.PARTLY
    assert np.abs(seen.centres_px[2] - frame.centres_px[2]).max() < 0.06
    others = [0, 1, 3, 4]
    assert seen.covariance_m2[2, 0, 0] > 1.1 * seen.covariance_m2[others, 0, 0].mean()


@pytest.mark.parametrize(("share", "limit_px"), [(0.15, 0.06), (0.30, 0.12)])
def test_a_sheet_over_a_part_is_told_and_harmless(share: float, limit_px: float) -> None:
    track = Track(small_view())
    first = track.picture()
    track.tracker.step(first.image, track.t_ns())
    # The sheet's edge cuts off a share of the diameter of 27.9 px from the right.
    corner = first.centres_px[0] + np.array([14.0 - 28.0 * share + 30.0, 0.0])
    frame = track.picture(occluders=[(sheet(corner, (30.0, 40.0)), 110.0)])
    seen = track.tracker.step(frame.image, track.t_ns())
    assert seen.states[0] == State.PARTLY
    assert seen.inliers[0] < 0.9
    assert np.hypot(*(seen.centres_px[0] - frame.centres_px[0])) < limit_px


def test_a_covered_marker_is_lost_and_comes_back() -> None:
    track = Track(small_view())
    first = track.picture()
    track.tracker.step(first.image, track.t_ns())
    cover = [(sheet(first.centres_px[1], (40.0, 40.0)), 110.0)]
    for _ in range(20):
        seen = track.tracker.step(track.picture(occluders=cover).image, track.t_ns())
        assert seen.states[1] == State.LOST
        assert np.isnan(seen.xy_m[1]).all()
        assert np.isnan(seen.covariance_m2[1]).all()
        assert (seen.states[[0, 2, 3, 4]] == State.SEEN).all()
    seen = track.tracker.step(track.picture().image, track.t_ns())
    assert (seen.states == State.SEEN).all()


@pytest.mark.parametrize("level", [0, 255])
def test_without_a_picture_all_are_lost_and_all_come_back(level: int) -> None:
    track = Track(small_view(), car=True)
    poses = bend(2)
    track.tracker.expect_heading(float(poses[0, 2]))
    assert drive(track, poses)[-1][0].seen.all()
    for _ in range(5):
        seen = track.tracker.step(np.full((480, 640), level, np.uint8), track.t_ns())
        assert (seen.states == State.LOST).all()
    track.frame_number += 15
    assert drive(track, poses[-1:])[0][0].seen.all()


def test_a_bumped_cone_is_followed_to_its_new_place() -> None:
    track = Track(small_view())
    track.tracker.step(track.picture().image, track.t_ns())
    bumped = [*CONES[:4], (CONES[4][0] + 0.08, CONES[4][1] - 0.05)]
    track.scene = OverheadScene(track.view, [Ring((x, y, 0.0)) for x, y in bumped])
    seen = None
    for _ in range(20):
        seen = track.tracker.step(track.picture().image, track.t_ns())
    assert seen is not None
    assert seen.seen.all()
    np.testing.assert_allclose(seen.xy_m[4], bumped[4], atol=2e-4)


def test_a_lost_cone_is_not_mistaken_for_a_ring_of_the_car() -> None:
    """The car hides the cone; its rings stand within the cone's gate, and are the car's."""
    places = [*CONES[:4], (0.0, 0.0)]
    track = Track(small_view(), places, car=True)
    track.tracker.expect_heading(0.0)
    poses = np.array([[x, 0.0, 0.0] for x in np.arange(-0.9, 0.6, 0.03)])
    for seen, true in drive(track, poses, 0.9):
        off = np.linalg.norm(seen.xy_m - true, axis=1)
        assert not (off > 0.002).any()
    assert (seen.states[[0, 1, 2, 3, 5, 6]] == State.SEEN).all()


def test_a_car_that_was_hidden_is_found_again_as_itself() -> None:
    track = Track(small_view(), car=True)
    poses = bend(60)
    track.tracker.expect_heading(float(poses[0, 2]))
    cover = [(np.array([[0.0, 0], [640, 0], [640, 480], [0, 480]]), 110.0)]
    back = 0
    for k, pose in enumerate(poses):
        hidden = 10 <= k < 22
        frame = track.picture(pose, occluders=cover if hidden else [])
        seen = track.tracker.step(frame.image, track.t_ns())
        off = np.linalg.norm(seen.xy_m - frame.xyz_m[:, :2], axis=1)
        assert not (off > 0.002).any()
        assert hidden <= (seen.states == State.LOST).all()
        back += int(k >= 40 and seen.seen.all())
    assert back == 20


def test_two_cars_that_look_alike_are_neither() -> None:
    track = Track(small_view(), car=True)
    track.tracker.expect_heading(0.0)
    poses = [np.array([-0.3, -0.4, 0.0]), np.array([0.2, 0.3, 0.0])]
    rings = [ring for pose in poses for ring in CAR.rings(pose)]
    frame = track.scene.frame(track.rng, moving=rings)
    seen = track.tracker.step(frame.image, track.t_ns())
    assert (seen.states[:5] == State.SEEN).all()
    assert (seen.states[5:] == State.LOST).all()


def test_a_car_whose_direction_nobody_told_is_lost() -> None:
    track = Track(small_view(), car=True)
    assert (drive(track, bend(3))[-1][0].states[5:] == State.LOST).all()
    track.tracker.expect_heading(float(bend(1)[0, 2]))
    track.frame_number += 20
    assert drive(track, bend(1))[0][0].seen.all()


def test_one_ring_alone_may_move_too() -> None:
    view, rng = small_view(), np.random.default_rng(0)
    tracker = RingTracker(view, [*cone_markers(), Marker("robot", 0.1)])
    scene = OverheadScene(view, [Ring((x, y, 0.0)) for x, y in CONES])
    for k in range(10):
        xy = (-0.5 + 0.03 * k, 0.02 * k)
        frame = scene.frame(rng, moving=[Ring((*xy, 0.1))])
        seen = tracker.step(frame.image, k * PERIOD_NS)
        np.testing.assert_allclose(seen.xy_m[-1], xy, atol=2e-4)


def test_a_shadow_edge_costs_little() -> None:
    track, errors = Track(small_view()), []
    columns = np.arange(640, dtype=np.float32)
    for k in range(20):
        edge = track.picture().centres_px[3, 0] - 10.0 + k
        soft = 0.5 + 0.5 * np.tanh((columns - edge) / 3.0)
        factor = np.broadcast_to(1.0 - 0.5 * soft, (480, 640)).astype(np.float32)
        frame = track.picture(light=Light(factor))
        seen = track.tracker.step(frame.image, track.t_ns())
        errors.append(seen.centres_px[2:4] - frame.centres_px[2:4])
    assert np.sqrt(np.mean(np.square(errors))) < 0.04


def test_more_lines_are_a_little_better() -> None:
    """Offline, twice the lines for twice the time."""

    def error(lines: int) -> float:
        track = Track(small_view(), config=TrackerConfig(lines=lines), seed=5)
        frames = [track.picture() for _ in range(40)]
        off = [track.tracker.step(f.image, track.t_ns()).centres_px - f.centres_px for f in frames]
        return float(np.sqrt(np.mean(np.square(off))))

    assert error(128) < error(32)


def test_bad_calls_are_told_what_to_do() -> None:
    track = Track(small_view())
    with pytest.raises(ImageError, match="640x480"):
        track.tracker.step(np.zeros((720, 1280), np.uint8), 1)
    with pytest.raises(ImageError, match="uint8"):
        track.tracker.step(np.zeros((480, 640)), 1)
    track.tracker.step(np.zeros((480, 640), np.uint8), 5)
    with pytest.raises(TrackingError, match="order"):
        track.tracker.step(np.zeros((480, 640), np.uint8), 5)


def test_bad_markers_are_told_what_is_wrong() -> None:
    view = small_view()
    with pytest.raises(TrackingError, match="names"):
        RingTracker(view, [])
    with pytest.raises(TrackingError, match="names"):
        RingTracker(view, [Marker("a", 0.0), Marker("a", 0.0)])
    odd = Marker("b", 0.0, shape=RingShape(0.1, 0.05))
    with pytest.raises(TrackingError, match="ratio"):
        RingTracker(view, [Marker("a", 0.0), odd])
    with pytest.raises(TrackingError, match="two of the movers"):
        RingTracker(view, [*cone_markers(), *car_markers()], pair=("front", "cone 1", 0.2))
