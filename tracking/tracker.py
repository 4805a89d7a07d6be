"""All known markers from frame to frame.

Those that stand and those that move are measured by one look each; what is lost is searched for in
the region where it can be, and comes back only when it can be nothing else. A marker without a
position is LOST, and says so: no position is ever guessed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from geometry import Floats, View
from tracking.errors import ImageError, TrackingError
from tracking.identity import NOBODY, CarMemory, RingPair, heading_between, unique_matches
from tracking.images import Image, grey_image
from tracking.markers import Marker, State, TrackedFrame
from tracking.measuring import Look, TrackerConfig
from tracking.moving import MovingMarkers
from tracking.outlines import RingPlanes, half_axes
from tracking.recovery import Recovery, in_place, match_moving, may_be
from tracking.rings import RingSearch
from tracking.standing import Found, StandingMarkers

Indices = npt.NDArray[np.int64]
_Enter: TypeAlias = Callable[
    [Indices, npt.NDArray[np.bool_], Floats, float, Floats, npt.NDArray[np.int8]], None
]
_LOST = int(State.LOST)
_REMEMBERED_NS = 1_000_000_000
_FAR_M = 0.6
"""Looking for a marker further around than this is as dear as searching the whole picture."""


class RingTracker:
    """Follows markers in the frames of one camera that does not move.

    view : the camera in its place. markers : all of them, one ratio of diameters. pair : front and
    rear ring of the car, by name, and how far apart they are. Frames go through `step` in the order
    of their time; the first one is searched as a whole. Constructing one loads compiled kernels,
    half a second, or ten once after an installation; no frame ever waits for that.
    """

    def __init__(
        self,
        view: View,
        markers: Sequence[Marker],
        config: TrackerConfig | None = None,
        pair: tuple[str, str, float] | None = None,
        search: RingSearch | None = None,
    ) -> None:
        self.markers = tuple(markers)
        from tracking.kernels import enter

        self.config, self._enter = config or TrackerConfig(), enter
        names = [marker.name for marker in self.markers]
        if len(set(names)) != len(names) or not names:
            raise TrackingError(f"markers need names, each its own; got {names}")
        ratios = {round(marker.shape.ratio, 6) for marker in self.markers}
        if len(ratios) > 1:
            raise TrackingError(f"all markers must have one ratio of diameters, got {ratios}")
        moves = np.array([marker.moves for marker in self.markers])
        self._stand, self._move = np.flatnonzero(~moves), np.flatnonzero(moves)
        planes = RingPlanes(
            np.array([marker.height_m for marker in self.markers]),
            np.array([marker.shape.radius_m for marker in self.markers]),
            ratios.pop(),
        )
        look = Look(self.config, self.markers[0].shape)
        places = [m.place_m for m in self.markers if m.place_m is not None]
        self._standing = StandingMarkers(
            view, planes.take(self._stand), np.array(places).reshape(-1, 2), look
        )
        self._places = self._standing.xy.copy()
        self._moving = MovingMarkers(view, planes.take(self._move), look)
        self._pair = None if pair is None else self._ring_pair(*pair)
        self._told: CarMemory | None = None
        self._ends = np.full((2, 2), np.nan)
        self._remembered_ns: int | None = None
        self._recovery = Recovery(view, planes, search or _search_for(view, self.markers, planes))
        self._states = np.full(len(names), State.LOST, np.int8)
        self._shape = (view.camera.height_px, view.camera.width_px)
        self._t_ns: int | None = None
        self._searched_ns: int | None = None

    def expect_heading(self, heading_rad: float) -> None:
        """Tell which way the car points, to a sixth of a turn; its rings alone do not say.

        Needed before the first frame, and when the car was lost for more than a second.
        """
        self._told = CarMemory(float(heading_rad), np.full(2, np.nan))
        self._remembered_ns = None

    def step(self, image: npt.NDArray[np.generic] | None, t_ns: int) -> TrackedFrame:
        """The markers in a frame whose exposure's middle was at t.

        Raises `ImageError` for what is no picture of this camera, `TrackingError` when time does
        not go on.
        """
        grey = grey_image(image)
        if grey.shape != self._shape:
            raise ImageError(
                f"the picture has {grey.shape[1]}x{grey.shape[0]} pixels, the calibration is for "
                f"{self._shape[1]}x{self._shape[0]}: film and calibrate at one resolution"
            )
        if self._t_ns is not None and t_ns <= self._t_ns:
            raise TrackingError(f"frames must come in order of time: {t_ns} after {self._t_ns}")
        self._t_ns = t_ns
        report = _Report(len(self.markers), self.config.whole_inliers, self._enter)
        if self._stand.size:
            report.put(self._stand, self._standing.look(grey))
            if not self._standing.settled.all():
                self._settle_in_place(grey, report)
        self._follow(grey, t_ns, report)
        if (report.states == _LOST).any():
            self._search(grey, t_ns, report)
        self._states = report.states
        self._remember_car(report, t_ns)
        return report.frame(t_ns)

    def _settle_in_place(self, grey: Image, report: _Report) -> None:
        """Markers not seen before may stand just where they are said to, to a few pixels."""
        fresh = np.flatnonzero(~self._standing.settled)
        settled = self._standing.settle(grey, fresh, self._places[fresh])
        if settled.size:
            seen = self._standing.look(grey)
            report.put(self._stand, seen, only=self._stand[settled])

    def _follow(self, grey: Image, t_ns: int, report: _Report) -> None:
        """Movers whose speed is known are looked for where they must be."""
        known = np.isfinite(self._moving.velocity).all(axis=1)
        local = np.flatnonzero(known & (self._states[self._move] != _LOST))
        if not local.size:
            return
        found = self._moving.look(grey, local, self._moving.predicted(t_ns)[local])
        found = self._held_together(found, local)
        self._moving.keep(local, found, t_ns, fresh=False)
        report.put(self._move[local], found)

    def _held_together(self, found: Found, local: Indices) -> Found:
        """The rings of the car keep their distance; if not, neither is believed."""
        if self._pair is None:
            return found
        order = local.tolist()
        if not (self._pair.front in order and self._pair.rear in order):
            return found
        front, rear = order.index(self._pair.front), order.index(self._pair.rear)
        x, y = (found.xy[front] - found.xy[rear]).tolist()
        span = math.hypot(x, y)
        if not abs(span - self._pair.distance_m) <= self._pair.tolerance_m:
            found.good[[front, rear]] = False
        return found

    def _search(self, grey: Image, t_ns: int, report: _Report) -> None:
        """Look for what is lost; only now and then where that means much of the picture."""
        due = self._searched_ns is None or (
            (t_ns - self._searched_ns) * 1e-9 >= self.config.search_period_s
        )
        standing = np.flatnonzero(report.states[self._stand] == State.LOST)
        movers = np.flatnonzero(report.states[self._move] == State.LOST)
        reach = self._reach(t_ns)
        if due:
            self._searched_ns = t_ns
        else:
            standing, movers = standing[:0], movers[reach[movers] < _FAR_M]
        if not (standing.size or movers.size):
            return
        expected = self._moving.predicted(t_ns)
        region = self._region(standing, movers, expected, reach)
        found = self._recovery.sightings(grey, region, report.known_px())
        if not len(found):
            return
        stand_places = self._recovery.places(found, self._stand[standing])
        move_places = self._recovery.places(found, self._move)
        lost = np.zeros(self._move.size, bool)
        lost[movers] = True
        gates = np.full(standing.size, self.config.place_gate_m)
        theirs = unique_matches(self._places[standing], gates, stand_places)
        sure = in_place(theirs, stand_places, self._places[standing])
        # A ring right where a marker stands is that marker, and cannot be one that moves.
        move_places[:, theirs[sure]] = np.nan
        possible = may_be(move_places[movers], expected[movers], reach[movers])
        # One beside it may be the marker, moved, or a lost mover: then it is neither.
        theirs[~sure & (theirs != NOBODY) & possible[theirs]] = NOBODY
        mine = match_moving(
            move_places,
            expected,
            reach,
            lost,
            report.xy[self._move],
            self._pair,
            self._car_memory(t_ns),
        )
        self._stand_again(grey, standing, theirs, stand_places, report)
        self._move_again(grey, mine, move_places, t_ns, report)

    def _region(
        self, standing: Indices, movers: Indices, expected: Floats, reach: Floats
    ) -> tuple[slice, slice] | None:
        """The part of the picture in which these can be, None for all of it."""
        if not (reach[movers] < _FAR_M).all():
            return None
        which = np.concatenate([self._stand[standing], self._move[movers]])
        xy = np.concatenate([self._places[standing], expected[movers]])
        gates = np.full(standing.size, self.config.place_gate_m)
        return self._recovery.region(which, xy, np.concatenate([gates, reach[movers]]))

    def _stand_again(
        self, grey: Image, local: Indices, matches: Indices, places: Floats, report: _Report
    ) -> None:
        hit = np.flatnonzero(matches != NOBODY)
        settled = self._standing.settle(grey, local[hit], places[hit, matches[hit]])
        if settled.size:
            seen = self._standing.look(grey)
            report.put(self._stand, seen, only=self._stand[settled])

    def _move_again(
        self, grey: Image, matches: Indices, places: Floats, t_ns: int, report: _Report
    ) -> None:
        hit = np.flatnonzero(matches != NOBODY)
        if not hit.size:
            return
        seen = self._moving.look(grey, hit, places[hit, matches[hit]])
        seen = self._held_together(seen, hit)
        self._moving.keep(hit, seen, t_ns, fresh=True)
        report.put(self._move[hit], seen)

    def _reach(self, t_ns: int) -> Floats:
        """How far each mover (n,) can be from its prediction; infinite when never seen."""
        config, after_s = self.config, self._moving.since(t_ns)
        slow = np.isfinite(self._moving.velocity).all(axis=1)
        unsure = np.where(
            slow, config.max_acceleration_m_s2 * after_s**2, config.max_speed_m_s * after_s
        )
        seen = np.isfinite(self._moving.xy).all(axis=1)
        return np.where(seen, 0.02 + unsure, np.inf)

    def _car_memory(self, t_ns: int) -> CarMemory | None:
        """How the car stood, unless it may have turned round since."""
        if self._remembered_ns is None:
            return self._told
        if t_ns - self._remembered_ns > _REMEMBERED_NS:
            return None
        return CarMemory(heading_between(*self._ends), self._ends.mean(axis=0))

    def _remember_car(self, report: _Report, t_ns: int) -> None:
        if self._pair is None:
            return
        front, rear = int(self._move[self._pair.front]), int(self._move[self._pair.rear])
        if report.states[front] != _LOST and report.states[rear] != _LOST:
            self._ends[0], self._ends[1] = report.xy[front], report.xy[rear]
            self._remembered_ns = t_ns

    def _ring_pair(self, front: str, rear: str, distance_m: float) -> RingPair:
        movers = [self.markers[i].name for i in self._move]
        if front == rear or front not in movers or rear not in movers:
            raise TrackingError(f"{front!r} and {rear!r} must be two of the movers {movers}")
        return RingPair(movers.index(front), movers.index(rear), distance_m)


class _Report:
    """A frame's results while they come in."""

    def __init__(self, n: int, whole: float, enter: _Enter) -> None:
        self._whole, self._enter = whole, enter
        self.states = np.full(n, _LOST, np.int8)
        self._rows = np.full((n, 11), np.nan)
        self.centres, self.xy = self._rows[:, :2], self._rows[:, 2:4]

    def put(self, which: Indices, found: Found, only: Indices | None = None) -> None:
        """Enter what was found of the markers `which`, or of those of them that are in `only`."""
        good = found.good if only is None else found.good & np.isin(which, only)
        self._enter(which, good, found.rows, self._whole, self._rows, self.states)

    def known_px(self) -> Floats:
        """Where rings are that need no owner any more, (j, 2)."""
        return np.asarray(self.centres[self.states != State.LOST])

    def frame(self, t_ns: int) -> TrackedFrame:
        """What the user gets."""
        covariance = self._rows[:, 4:8].reshape(-1, 2, 2)
        return TrackedFrame(
            t_ns, self.states, self.centres, self.xy, covariance, *self._rows[:, 8:].T
        )


def _search_for(view: View, markers: Sequence[Marker], planes: RingPlanes) -> RingSearch:
    """A search for rings as small as the smallest of these in this view."""
    places = [marker.place_m for marker in markers if marker.place_m is not None]
    size = np.array([view.camera.width_px, view.camera.height_px]) - 1.0
    corners = size * np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9], [0.9, 0.9], [0.5, 0.5]])
    xy = view.on_plane(corners, float(planes.heights.min()))
    xy = np.concatenate([xy[np.isfinite(xy).all(axis=1)], np.array(places).reshape(-1, 2)])
    if not len(xy):
        raise TrackingError("the camera does not look at the floor: is the view the right one?")
    slopes = view.plane_jacobian(xy, float(planes.heights.min()))
    smallest = 2.0 * half_axes(slopes, np.full(len(xy), planes.radii.min()))[:, 1].min()
    return RingSearch(shape=markers[0].shape, smallest_px=max(6.0, 0.9 * float(smallest)))
