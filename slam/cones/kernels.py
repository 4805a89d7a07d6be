"""The inner loops of cone extraction: placing beams, clustering, fitting a circle of known radius.

Coordinates are those of the lidar's place at the stamp of the revolution, with the axes of the car.
Beams stand in the order of their bearing; index 0 follows the last one (the seam at pi).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from geometry import Floats, Stamps
from slam.kernels import kernel, wrapped
from slam.observation import variances

Indices = npt.NDArray[np.int64]
Pose = tuple[float, float, float]

REFUSALS = (
    "too few hits", "too many hits", "too wide", "out of range", "hidden", "not round",
)  # fmt: skip
FEW, MANY, WIDE, FAR, HIDDEN, UNROUND = range(6)
ACCEPTED = -1
CENTROID, SHIFTED, FIT = range(3)

NEIGHBOUR_GAPS = 2.5
"""Beams further apart than this many usual gaps are not neighbours: some between were not told."""
CONTEXT_BEAMS = 3
NO_DIRECTION_RAD = 1e6
"""A bearing beyond this, or NaN, is no direction; wrapping it would leave only rounding errors."""
ITERATIONS = 30
CONVERGED_M = 1e-6
OUTLIER_VARIANCES = 9.0


@kernel
def pose_between(t_ns: Stamps, poses: Floats, before: int, at_ns: int) -> Pose:
    """The pose at a time on the line through samples `before` and the next."""
    after = before + 1
    fraction = (at_ns - t_ns[before]) / (t_ns[after] - t_ns[before])
    return (
        poses[before, 0] + fraction * (poses[after, 0] - poses[before, 0]),
        poses[before, 1] + fraction * (poses[after, 1] - poses[before, 1]),
        poses[before, 2] + fraction * wrapped(poses[after, 2] - poses[before, 2]),
    )


@kernel
def sample_before(t_ns: Stamps, near: int, at_ns: int) -> int:
    """The row after which `at_ns` falls, searched from row `near`; never the last row."""
    while near < t_ns.size - 2 and at_ns >= t_ns[near + 1]:
        near += 1
    while near > 0 and at_ns < t_ns[near]:
        near -= 1
    return near


@kernel
def lidar_moved(here: Pose, there: Pose, mounting: Floats) -> Pose:
    """Where the lidar of a car at `there` stands beside that of one at `here`, and how turned."""
    dx, dy, turned = there[0] - here[0], there[1] - here[1], there[2] - here[2]
    cos_here, sin_here = math.cos(here[2]), math.sin(here[2])
    less, sin = math.cos(turned) - 1.0, math.sin(turned)
    return (
        cos_here * dx + sin_here * dy + less * mounting[0] - sin * mounting[1],
        cos_here * dy - sin_here * dx + sin * mounting[0] + less * mounting[1],
        turned,
    )


@kernel
def place_beams(
    beam_t_ns: Stamps,
    range_m: Floats,
    bearing_rad: Floats,
    stamp_ns: int,
    odometry_t_ns: Stamps,
    odometry_pose: Floats,
    mounting: Floats,
    nearest_m: float,
    furthest_m: float,
    placed: Floats,
) -> tuple[int, int, int]:
    """Beams as if all had been shot at the stamp; fills placed (4, beams): x, y, bearing, distance.

    A beam without echo, or with one outside the limits, has distance 0. Gives how many are placed
    (a beam without a direction is not), how many gave no echo, and how many one outside the limits.
    """
    row = sample_before(odometry_t_ns, 0, stamp_ns)
    here = pose_between(odometry_t_ns, odometry_pose, row, stamp_ns)
    count, silent, outside = 0, 0, 0
    for i in range(beam_t_ns.size):
        if not abs(bearing_rad[i]) < NO_DIRECTION_RAD:
            silent += 1
            continue
        row = sample_before(odometry_t_ns, row, beam_t_ns[i])
        there = pose_between(odometry_t_ns, odometry_pose, row, beam_t_ns[i])
        x, y, turned = lidar_moved(here, there, mounting)
        direction = bearing_rad[i] + mounting[2] + turned
        placed[2, count], placed[3, count] = wrapped(direction), 0.0
        if not (math.isfinite(range_m[i]) and range_m[i] > 0.0):
            silent += 1
        elif range_m[i] < nearest_m or range_m[i] > furthest_m:
            outside += 1
        else:
            x, y = x + range_m[i] * math.cos(direction), y + range_m[i] * math.sin(direction)
            placed[0, count], placed[1, count] = x, y
            placed[2, count], placed[3, count] = math.atan2(y, x), math.hypot(x, y)
        count += 1
    return count, silent, outside


@kernel
def root_of(parent: Indices, i: int) -> int:
    """The member that stands for the cluster of i; shortens the way there."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def linked(beams: Floats, echo: Indices, join_m: float) -> Indices:
    """(e,) root of the cluster of each echo: all within `join_m` of one another, chained.

    A point within `join_m` of another lies within asin(join / distance) of its bearing: only so far
    is looked, forwards, around the circle.
    """
    count = echo.size
    parent = np.empty(count, np.int64)
    for i in range(count):
        parent[i] = i
    for i in range(count):
        a = echo[i]
        x, y, bearing, distance = beams[0, a], beams[1, a], beams[2, a], beams[3, a]
        reach = math.asin(join_m / distance) if distance > join_m else math.pi
        for step in range(1, count):
            j = i + step
            turn = 0.0
            if j >= count:
                j -= count
                turn = 2.0 * math.pi
            b = echo[j]
            if beams[2, b] + turn - bearing > reach:
                break
            dx, dy = beams[0, b] - x, beams[1, b] - y
            if dx * dx + dy * dy <= join_m * join_m:
                root, other = root_of(parent, i), root_of(parent, j)
                parent[max(root, other)] = min(root, other)
    for i in range(count):
        parent[i] = root_of(parent, i)
    return parent


@kernel
def grouped(root: Indices, echo: Indices) -> tuple[Indices, Indices]:
    """Beams (e,) cluster after cluster, and (e + 1,) where the cluster with each root starts."""
    count = root.size
    starts = np.zeros(count + 1, np.int64)
    for i in range(count):
        starts[root[i] + 1] += 1
    for i in range(count):
        starts[i + 1] += starts[i]
    members, filled = np.empty(count, np.int64), np.zeros(count, np.int64)
    for i in range(count):
        members[starts[root[i]] + filled[root[i]]] = echo[i]
        filled[root[i]] += 1
    return members, starts


@kernel
def gap_after(beams: Floats, i: int) -> float:
    """The angle from a beam to the next one around the circle."""
    following, turn = (i + 1, 0.0) if i + 1 < beams.shape[1] else (0, 2.0 * math.pi)
    gap: float = beams[2, following] + turn - beams[2, i]
    return gap


@kernel
def local_spacing(beams: Floats, first: int, last: int, usual: float) -> float:
    """The mean angle between beams over a cluster and a few beams to its sides."""
    count = beams.shape[1]
    gaps = min((last - first) % count + 2 * CONTEXT_BEAMS, count - 1)
    i = (first - CONTEXT_BEAMS) % count
    total, counted = 0.0, 0
    for _ in range(gaps):
        gap = gap_after(beams, i)
        if gap <= NEIGHBOUR_GAPS * usual:
            total += gap
            counted += 1
        i = (i + 1) % count
    return total / counted if counted > 0 else usual


@kernel
def half_hidden(beams: Floats, first: int, last: int, usual: float) -> bool:
    """Whether the beam beside either end of a cluster struck something nearer."""
    count = beams.shape[1]
    before, after = (first - 1) % count, (last + 1) % count
    reach = NEIGHBOUR_GAPS * usual
    left = gap_after(beams, last) <= reach and 0.0 < beams[3, after] < beams[3, last]
    right = gap_after(beams, before) <= reach and 0.0 < beams[3, before] < beams[3, first]
    return left or right


@kernel
def off_circle(
    beams: Floats, i: int, radius_m: float, x: float, y: float, noise: Floats
) -> tuple[float, float, float, float]:
    """Normal of a circle towards a hit, the hit's distance outside it, and the variance of that.

    Along the normal act range noise times cos(incidence), bearing noise times sin, and the second
    order of a tangential error, which alone is left where a beam grazes.
    """
    dx, dy, distance = beams[0, i] - x, beams[1, i] - y, beams[3, i]
    away = max(math.hypot(dx, dy), 1e-9)
    nx, ny = dx / away, dy / away
    cos = (nx * beams[0, i] + ny * beams[1, i]) / distance
    across = 1.0 - cos * cos
    var_range, var_bearing = variances(distance, noise)
    grazing = var_range * across / radius_m
    variance = var_range * cos * cos + var_bearing * distance * distance * across
    return nx, ny, away - radius_m, variance + 0.5 * grazing * grazing


@kernel
def fitted_circle(
    beams: Floats, members: Indices, radius_m: float, x: float, y: float, noise: Floats
) -> tuple[float, float, float, float, float, float]:
    """Centre of the circle of known radius through the hits, its covariance, share on the circle.

    Gauss-Newton from (x, y) on the distance of each hit to the circle, with Cauchy weights.
    """
    xx, xy, yy, on_circle = 0.0, 0.0, 0.0, 0
    for _ in range(ITERATIONS):
        a, b, c, gx, gy = 0.0, 0.0, 0.0, 0.0, 0.0
        xx, xy, yy, on_circle = 0.0, 0.0, 0.0, 0
        for i in members:
            nx, ny, error, variance = off_circle(beams, i, radius_m, x, y, noise)
            weight = 1.0 / (variance + error * error / OUTLIER_VARIANCES)
            a, b, c = a + weight * nx * nx, b + weight * nx * ny, c + weight * ny * ny
            gx, gy = gx + weight * nx * error, gy + weight * ny * error
            if error * error <= OUTLIER_VARIANCES * variance:
                on_circle += 1
                xx, xy, yy = (
                    xx + nx * nx / variance,
                    xy + nx * ny / variance,
                    yy + ny * ny / variance,
                )
        determinant = a * c - b * b
        if not determinant > 1e-9 * a * c:
            return x, y, 0.0, 0.0, 0.0, 0.0
        step_x, step_y = (c * gx - b * gy) / determinant, (a * gy - b * gx) / determinant
        x, y = x + step_x, y + step_y
        if abs(step_x) + abs(step_y) < CONVERGED_M:
            break
    determinant = xx * yy - xy * xy
    if not determinant > 1e-9 * xx * yy:
        return x, y, 0.0, 0.0, 0.0, 0.0
    share = on_circle / members.size
    return x, y, yy / determinant, -xy / determinant, xx / determinant, share


@kernel
def ends_of(beams: Floats, members: Indices, bearing_rad: float) -> tuple[int, int]:
    """The first and the last beam of a cluster, counter-clockwise, as seen around its middle."""
    first, last = members[0], members[0]
    low, high = math.inf, -math.inf
    for i in members:
        side = wrapped(beams[2, i] - bearing_rad)
        if side < low:
            low, first = side, i
        if side > high:
            high, last = side, i
    return first, last


@kernel
def middle_of(beams: Floats, members: Indices) -> tuple[float, float, float]:
    """The mean of the hits, and how far the furthest of them lies from it."""
    x, y, furthest = 0.0, 0.0, 0.0
    for i in members:
        x += beams[0, i]
        y += beams[1, i]
    x, y = x / members.size, y / members.size
    for i in members:
        furthest = max(furthest, math.hypot(beams[0, i] - x, beams[1, i] - y))
    return x, y, furthest


@kernel
def mean_spread(
    x: float, y: float, hits: int, spacing: float, noise: Floats
) -> tuple[float, float, float]:
    """Covariance xx, xy, yy of the mean of the hits.

    Across the line of sight the first hit may fall anywhere within one beam spacing.
    """
    squared = max(x * x + y * y, 1e-12)
    var_range, var_bearing = variances(math.sqrt(squared), noise)
    along = var_range / hits
    across = (var_bearing / hits + spacing * spacing / 12.0) * squared
    return (
        (x * x * along + y * y * across) / squared,
        x * y * (along - across) / squared,
        (y * y * along + x * x * across) / squared,
    )


@kernel
def judged(
    beams: Floats, members: Indices, usual: float, rule: Floats, noise: Floats, cone: Floats
) -> int:
    """Why a cluster is no cone, or ACCEPTED; then cone (6,) is x, y, xx, xy, yy, hits."""
    radius, hits = rule[0], members.size
    if hits < rule[4]:
        return FEW
    if hits > rule[5]:
        return MANY
    x, y, furthest = middle_of(beams, members)
    if furthest > rule[3]:
        return WIDE
    near = max(math.hypot(x, y), 1e-6)
    distance = near + radius * math.pi / 4.0
    if rule[9] != 0.0 and (distance < rule[1] or distance > rule[2]):
        return FAR
    first, last = ends_of(beams, members, math.atan2(y, x))
    spacing = local_spacing(beams, first, last, usual)
    if rule[9] != 0.0 and half_hidden(beams, first, last, usual):
        return HIDDEN
    if rule[6] < math.inf:
        expected = 2.0 * math.asin(min(radius / distance, 1.0)) / spacing
        if hits < (1.0 - rule[6]) * expected - 1.0:
            return FEW
        if hits > (1.0 + rule[6]) * expected + 1.0:
            return MANY
    xx, xy, yy = mean_spread(x, y, hits, spacing, noise)
    if rule[8] != CENTROID:
        x, y = x * distance / near, y * distance / near
    if rule[8] == FIT:
        start_x, start_y = x, y
        x, y, xx, xy, yy, share = fitted_circle(beams, members, radius, x, y, noise)
        if not (share > rule[7] and math.hypot(x - start_x, y - start_y) < radius):
            return UNROUND
    cone[0], cone[1], cone[2], cone[3], cone[4], cone[5] = x, y, xx, xy, yy, float(hits)
    return ACCEPTED


@kernel
def find_cones(
    beams: Floats, echo: Indices, usual: float, rule: Floats, noise: Floats, refused: Indices
) -> Floats:
    """Cones (k, 6) among beams (4, n) sorted by bearing, `echo` the columns that struck something.

    Counts into refused (6,) the clusters that are none, by the reasons in `REFUSALS`.
    """
    root = linked(beams, echo, rule[10])
    members, starts = grouped(root, echo)
    cones, found = np.empty((echo.size, 6)), 0
    for i in range(echo.size):
        if starts[i + 1] > starts[i]:
            cluster = members[starts[i] : starts[i + 1]]
            verdict = judged(beams, cluster, usual, rule, noise, cones[found])
            if verdict == ACCEPTED:
                found += 1
            else:
                refused[verdict] += 1
    return cones[:found]


@kernel
def as_seen_from_car(cones: Floats, mounting: Floats, floor: Floats, seen: Floats) -> None:
    """Fills seen (k, 5) from cones (k, 6): range, bearing, and their covariance rr, rb, bb."""
    for i in range(cones.shape[0]):
        x, y = cones[i, 0] + mounting[0], cones[i, 1] + mounting[1]
        xx, xy, yy = cones[i, 2], cones[i, 3], cones[i, 4]
        distance = max(math.hypot(x, y), 1e-6)
        cos, sin = x / distance, y / distance
        var_range, var_bearing = variances(distance, floor)
        seen[i, 0], seen[i, 1] = distance, math.atan2(y, x)
        seen[i, 2] = cos * cos * xx + 2.0 * cos * sin * xy + sin * sin * yy + var_range
        seen[i, 3] = (cos * sin * (yy - xx) + (cos * cos - sin * sin) * xy) / distance
        across = sin * sin * xx - 2.0 * cos * sin * xy + cos * cos * yy
        seen[i, 4] = across / (distance * distance) + var_bearing
