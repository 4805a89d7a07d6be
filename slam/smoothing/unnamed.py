"""The final pass where nobody named the landmarks: path, map and association together.

On a smoothed path every sighting finds its landmark anew; a landmark whose absence says more than
its sightings goes; what is left over and agrees becomes one; and the path is smoothed again. While
the path is still off, tails are heavy, as in annealing. What no such round can repair is a part of
the map that stands there twice, once as it was met first and once as it was met again: such copies
are laid on each other, and that is kept if all data together become more likely.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace

import numpy as np

from capture import Estimate, Observations, Odometry
from geometry import Floats
from slam.errors import SlamError
from slam.smoothing import assignment
from slam.smoothing.config import UnnamedConfig
from slam.smoothing.hypothesis import (
    Evidence,
    Hypothesis,
    Ints,
    log_likelihood,
    sightings,
    smoothed,
)

_FIRST_DETECTION, _LEAST_DETECTION, _MOST_DETECTION = 0.3, 0.05, 0.95
_BIRTH_GATE = 9.21
_MOST_LEFT_OVER = 2000
_LEAST_LANDMARKS = 2
_AFTER_TIE, _AT_LAST = (4.0, 2.0, 2.0), (2.0, 2.0, 2.0, 2.0)

Tie = list[tuple[int, int]]


def smooth_unnamed(
    estimate: Estimate,
    odometry: Odometry,
    observations: Observations,
    config: UnnamedConfig = UnnamedConfig(),  # noqa: B008  # frozen
) -> Estimate:
    """The estimate with path, map and association moved to where all data together want them.

    The ids of the observations are not looked at. Landmarks are numbered anew, and told with their
    first sighting. `provenance["smoothing"]["unnamed"]` holds the log-likelihood: of several
    estimates of the same data the one with the greatest is to be preferred. Deterministic. Raises
    `SlamError` as `smooth` does.
    """
    if estimate.map is None or len(estimate.map) == 0:
        raise SlamError(
            f"estimate {estimate.name!r} has no landmarks; only a path with a map can be smoothed"
        )
    evidence = Evidence.of(estimate.path, odometry, observations, config)
    start = np.array(estimate.map.landmarks.positions)
    best = _settled(
        evidence, estimate, start, _FIRST_DETECTION, config.tail_scales, config.birth_rounds, True
    )
    best, ties = _tied(evidence, best)
    best = _settled(evidence, best.estimate, best.landmarks, best.detection, _AT_LAST, 1, True)
    told = best.estimate.provenance["smoothing"]
    assert isinstance(told, dict)
    unnamed = {
        "config": {key: value for key, value in asdict(config).items() if key != "smoothing"},
        "log_likelihood": log_likelihood(evidence, best),
        "ties": ties,
        "detection_probability": best.detection,
        "left_over": int(np.count_nonzero(best.slots < 0)),
    }
    provenance = {**best.estimate.provenance, "smoothing": {**told, "unnamed": unnamed}}
    return replace(best.estimate, provenance=provenance)


def _settled(
    evidence: Evidence, estimate: Estimate, landmarks: Floats, detection: float,
    scales: Sequence[float], births: int, learn: bool,
) -> Hypothesis:  # fmt: skip
    """Round by round: associate, give up, smooth, and in the first rounds add."""
    found = None
    for k, scale in enumerate(scales):
        landmarks, slots, detection = _pruned(
            evidence, estimate, landmarks, detection, scale, learn
        )
        found = smoothed(evidence, estimate, landmarks, slots, detection)
        estimate, landmarks = found.estimate, found.landmarks
        if k < births:
            landmarks = np.concatenate([landmarks, _born(evidence, found, scale)])
    assert found is not None
    return found


def _pruned(
    evidence: Evidence, estimate: Estimate, landmarks: Floats, detection: float, scale: float,
    learn: bool,
) -> tuple[Floats, Ints, float]:  # fmt: skip
    """Without the landmarks that all data are likelier without, the least needed first."""
    path, least = estimate.path, evidence.config.least_sightings
    while True:
        worth = evidence.worths(path, landmarks, detection, scale)
        slots = assignment.assign_all(worth, evidence.starts)
        seen = sightings(slots, len(landmarks))
        could = evidence.in_field(path, landmarks, slots)
        if learn:
            share = float(seen.sum() / max(could.sum(), 1))
            detection = min(max(share, _LEAST_DETECTION), _MOST_DETECTION)
        need = assignment.needs(worth, evidence.starts, slots) + could * np.log(1.0 - detection)
        need[seen < least] = -np.inf
        last = int(np.argmin(need))
        if need[last] > 0.0 or len(landmarks) <= _LEAST_LANDMARKS:
            return landmarks, slots, detection
        landmarks = np.delete(landmarks, last, axis=0)


def _born(evidence: Evidence, found: Hypothesis, scale: float) -> Floats:
    """(k, 2): places on which sightings that no landmark explains agree."""
    path, seen = found.estimate.path, evidence.observations
    worth = evidence.worths(path, found.landmarks, found.detection, scale)
    left = np.flatnonzero(assignment.assign_all(worth, evidence.starts) < 0)
    left = left[:: max(1, -(-left.size // _MOST_LEFT_OVER))]
    return assignment.gatherings(
        evidence.poses(path)[left], seen.range_m[left], seen.bearing_rad[left], evidence.noise,
        _BIRTH_GATE, evidence.config.least_sightings,
    )  # fmt: skip


def _tied(evidence: Evidence, best: Hypothesis) -> tuple[Hypothesis, int]:
    """Lay copies on each other as long as that makes the data more likely; how often it was."""
    likelihood, config = log_likelihood(evidence, best), evidence.config
    for ties in range(config.rounds):
        for _, tie in zip(range(config.tries), possible_ties(evidence, best), strict=False):
            try:
                tied = _laid_together(evidence, best, tie)
            except SlamError:
                continue  # a tie that leaves something undetermined was none
            found = log_likelihood(evidence, tied)
            if found > likelihood + config.least_gain:
                best, likelihood = tied, found
                break
        else:
            return best, ties
    return best, config.rounds


def possible_ties(evidence: Evidence, best: Hypothesis) -> Iterator[Tie]:
    """Pairs of landmarks (gone, stays) that one shift lays on each other, the most pairs first.

    Two that were seen together are two. Of as many pairs the smallest shift comes first.
    """
    config, landmarks, n = evidence.config, best.landmarks, len(best.landmarks)
    seen = sightings(best.slots, n)
    together = assignment.seen_together(best.slots, evidence.starts, n)
    often = config.together_share * np.minimum(seen[:, None], seen[None])
    apart = together > np.maximum(1.0, often)
    np.fill_diagonal(apart, True)
    ties: list[tuple[float, Tie]] = []
    for gone, stays in np.argwhere(~apart):
        shift = landmarks[stays] - landmarks[gone]
        size_m = float(np.hypot(*shift))
        if size_m <= config.tie_reach_m:
            offset = landmarks[:, None] + shift - landmarks[None]
            distance = np.where(apart, np.inf, np.hypot(offset[..., 0], offset[..., 1]))
            tie = _pairs_within(distance, config.tie_tolerance_m)
            ties.append((size_m - len(tie), tie))
    told = set()
    for _, tie in sorted(ties, key=lambda one: one[0]):
        pairs = frozenset(frozenset(pair) for pair in tie)
        if pairs not in told:
            told.add(pairs)
            yield tie


def _pairs_within(distance: Floats, limit: float) -> Tie:
    """The closest pair first, no landmark twice."""
    pairs: Tie = []
    distance = distance.copy()
    while True:
        i, j = np.unravel_index(int(np.argmin(distance)), distance.shape)
        if not distance[i, j] <= limit:
            return pairs
        pairs.append((int(i), int(j)))
        distance[[i, j]] = np.inf
        distance[:, [i, j]] = np.inf


def _laid_together(evidence: Evidence, best: Hypothesis, tie: Tie) -> Hypothesis:
    slots, landmarks = best.slots.copy(), best.landmarks
    for gone, stays in tie:
        slots[slots == gone] = stays
    kept = np.setdiff1d(np.arange(len(landmarks)), [gone for gone, _ in tie])
    renamed = np.full(len(landmarks) + 1, -1, dtype=np.int64)  # the last is that of -1
    renamed[kept] = np.arange(kept.size)
    tied = smoothed(evidence, best.estimate, landmarks[kept], renamed[slots], best.detection)
    return _settled(evidence, tied.estimate, tied.landmarks, best.detection, _AFTER_TIE, 1, False)
