"""The second step: every frame of the run through the tracker, and which way the car points.

The car's rings look alike. Without being told, the tracker follows them under names that may be
swapped; what decides is that a car drives forwards more than backwards. That is settled for each
stretch in which it was never lost out of sight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from capture import WorldCalibration
from geometry import Floats, LandmarkMap, Stamps, circle_centres, wrap
from tracking.errors import TrackingError
from tracking.film import Film
from tracking.identity import heading_between
from tracking.images import Image
from tracking.markers import Marker, State, TrackedFrame
from tracking.measuring import TrackerConfig
from tracking.rings import RingSearch, find_rings
from tracking.scene import Scene
from tracking.tracker import RingTracker

_OFFLINE = TrackerConfig(search_period_s=0.1)
"""Nobody waits for the next frame: what is lost is searched for at once and often."""
FRONT, REAR = "marker_front", "marker_rear"
_SPAN_M, _KNOWN_M = 0.02, 0.10
_AGAIN_S = 0.5
"""Lost for so long, the car may have turned round: it is looked for in any direction."""
_TELLING_M = 0.10
"""Driven so far, it is clear which end is the front."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """n frames, m markers, the car's front and rear last.

    sequence : (n,) of the frames; states : (n, m); pixels, xy : (n, m, 2); covariances :
    (n, m, 2, 2); scatter_px : (n, m). stretch : (n,) number of the stretch. faults : sequence and
    fault of frames that could not be used. preview : a picture in which much is seen, and its row.
    """

    names: tuple[str, ...]
    t_ns: Stamps
    sequence: npt.NDArray[np.int64]
    states: npt.NDArray[np.int8]
    pixels: Floats
    xy: Floats
    covariances: Floats
    scatter_px: Floats
    stretch: npt.NDArray[np.int64]
    faults: tuple[tuple[int, str], ...]
    unsettled: tuple[int, ...]
    preview: tuple[int, Image] | None

    @property
    def seen(self) -> npt.NDArray[np.bool_]:
        """(n, m)."""
        return np.asarray(self.states != State.LOST)


def follow(
    film: Film,
    world: WorldCalibration,
    scene: Scene,
    cones: LandmarkMap,
    advance: Callable[[int], None] = lambda _: None,
) -> Tracks:
    """All markers in all frames; raises `ImageError` for a film of another camera."""
    run = _Run(world, scene, cones)
    last_ns: int | None = None
    for frame in film.frames():
        advance(1)
        if frame.image is None:
            run.faults.append((frame.sequence, frame.fault))
        elif last_ns is not None and frame.t_ns <= last_ns:
            run.faults.append((frame.sequence, "stamped before the frame before it"))
        else:
            last_ns = frame.t_ns
            run.step(frame.sequence, frame.t_ns, frame.image)
    return run.tracks()


@dataclass
class _Run:
    world: WorldCalibration
    scene: Scene
    cones: LandmarkMap
    faults: list[tuple[int, str]] = field(default_factory=list)
    frames: list[TrackedFrame] = field(default_factory=list)
    sequence: list[int] = field(default_factory=list)
    stretch: list[int] = field(default_factory=list)
    preview: tuple[int, Image] | None = None

    def __post_init__(self) -> None:
        self.markers = _markers(self.world, self.scene, self.cones)
        pair = (FRONT, REAR, self.scene.car.span_m)
        view = self.world.view
        self.tracker = RingTracker(view, self.markers, _OFFLINE, pair=pair)
        self._search = RingSearch(shape=self.world.ring, smallest_px=8.0)
        self._seen_ns: int | None = None
        self._looked_ns: int | None = None
        self._heading: float | None = None
        self._stretch = 0
        self._best = -1
        if self.scene.start_heading_deg is not None:
            self._heading = float(np.radians(self.scene.start_heading_deg))
            self.tracker.expect_heading(self._heading)

    def step(self, sequence: int, t_ns: int, image: Image) -> None:
        """One frame, whose picture is usable."""
        if self._is_due(t_ns):
            self._look_round(image, t_ns)
        frame = self.tracker.step(image, t_ns)
        if frame.seen[-2:].all():
            self._heading = heading_between(*frame.xy_m[-2:])
            self._seen_ns = t_ns
        self.frames.append(frame)
        self.sequence.append(sequence)
        self.stretch.append(self._stretch)
        count = int(frame.seen.sum()) + 2 * int(frame.seen[-2:].all())
        if count > self._best:
            self._best, self.preview = count, (len(self.frames) - 1, image.copy())

    def _is_due(self, t_ns: int) -> bool:
        """Whether the direction must be guessed: never known, or the car long out of sight."""
        if self._heading is not None and self._seen_ns is None:
            return False
        if self._seen_ns is not None and (t_ns - self._seen_ns) * 1e-9 < _AGAIN_S:
            return False
        return self._looked_ns is None or (t_ns - self._looked_ns) * 1e-9 >= 0.1

    def _look_round(self, image: Image, t_ns: int) -> None:
        """Find the car's two rings without knowing which way it points, and begin a stretch."""
        self._looked_ns = t_ns
        found = find_rings(image, self._search).centres_px
        for place, height in [(m.place_m, m.height_m) for m in self.markers if not m.moves]:
            at = circle_centres(self.world.view, found, height, self.world.ring.radius_m)
            assert place is not None
            found = found[~(np.linalg.norm(at - place, axis=1) < _KNOWN_M)]
        car = self.scene.car
        xy = circle_centres(self.world.view, found, car.height_m, self.world.ring.radius_m)
        pairs = [
            (i, j)
            for i in range(len(xy))
            for j in range(i)
            if abs(float(np.hypot(*(xy[i] - xy[j]))) - car.span_m) < _SPAN_M
        ]
        if len(pairs) != 1:
            return
        heading = heading_between(xy[pairs[0][0]], xy[pairs[0][1]])
        if self._heading is not None:
            if abs(float(wrap(heading - self._heading))) > np.pi / 2.0:
                heading = float(wrap(heading + np.pi))
            self._stretch += 1
        self._heading = heading
        self.tracker.expect_heading(heading)

    def tracks(self) -> Tracks:
        """All of it as columns, the car's rings under their right names."""
        if not self.frames:
            raise TrackingError(
                f"not one of {len(self.faults)} frames could be used: "
                + "; ".join(sorted({fault for _, fault in self.faults}))
            )
        columns = {
            name: np.stack([getattr(frame, name) for frame in self.frames])
            for name in ("states", "centres_px", "xy_m", "covariance_m2", "scatter_px")
        }
        t_ns = np.array([frame.t_ns for frame in self.frames], np.int64)
        stretch = np.array(self.stretch, np.int64)
        told = self.scene.start_heading_deg is not None
        unsettled = _turn_round(columns, stretch, told)
        return Tracks(
            tuple(marker.name for marker in self.markers), t_ns, np.array(self.sequence, np.int64),
            columns["states"], columns["centres_px"], columns["xy_m"], columns["covariance_m2"],
            columns["scatter_px"], stretch, tuple(self.faults), unsettled, self.preview,
        )  # fmt: skip


def _markers(world: WorldCalibration, scene: Scene, cones: LandmarkMap) -> list[Marker]:
    shape = world.ring
    corners = [
        Marker(one.name, one.xyz_m[2], one.xyz_m[:2], shape)
        for one in world.markers
        if one.corner is not None
    ]
    stand = [
        Marker(f"cone {number}", scene.cones.height_m, (x, y), shape)
        for number, (x, y) in zip(cones.ids.tolist(), cones.positions.tolist(), strict=True)
    ]
    car = [Marker(name, scene.car.height_m, None, shape) for name in (FRONT, REAR)]
    return [*corners, *stand, *car]


def _turn_round(
    columns: dict[str, npt.NDArray[np.generic]], stretch: npt.NDArray[np.int64], told: bool
) -> tuple[int, ...]:
    """Swap front and rear, in place, in stretches in which the car drove backwards.

    Returns the stretches in which it hardly moved: they follow the one before them.
    """
    flipped, unsettled = list[int](), list[int]()
    both = (columns["states"][:, -2:] != State.LOST).all(axis=1)
    for number in np.unique(stretch).tolist():
        rows = np.flatnonzero((stretch == number) & both)
        if not rows.size or (told and number == 0):
            continue
        forward_m = _forward_m(np.asarray(columns["xy_m"], np.float64)[rows])
        settled = abs(forward_m) >= _TELLING_M
        if not settled:
            unsettled.append(number)
        # An unsettled stretch was begun in the sense of the one before it.
        if forward_m < 0.0 if settled else number - 1 in flipped:
            flipped.append(number)
            whole = np.flatnonzero(stretch == number)
            for column in columns.values():
                column[whole[:, None], [-2, -1]] = column[whole[:, None], [-1, -2]]
    return tuple(unsettled)


def _forward_m(xy: Floats) -> float:
    """How far the rear-to-front direction was driven along, over frames (n, m, 2)."""
    middle = xy[:, -2:].mean(axis=1)
    along = xy[:, -2] - xy[:, -1]
    along /= np.linalg.norm(along, axis=1)[:, None]
    step = np.diff(middle, axis=0)
    return float((step * (along[1:] + along[:-1]) / 2.0).sum())
