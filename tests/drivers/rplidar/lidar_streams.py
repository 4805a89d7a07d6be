"""Streams of nodes and capsules, and ways to compare what becomes of them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from drivers.rplidar import Beams, Decoder
from drivers.rplidar.beams import joined
from drivers.rplidar.encoding import encode_dense, encode_legacy, encode_nodes, encode_ultra

FIELDS = ("index", "epoch", "angle_q6", "distance_q2", "quality", "start")


def nodes(count: int, *, step_q6: int = 46, seed: int = 0) -> bytes:
    """Nodes of a turning lidar, with the optics' wobble and a tenth without echo."""
    rng = np.random.default_rng(seed)
    plain = 100 + step_q6 * np.arange(count)
    distance = rng.integers(600, 40_000, count) * (rng.random(count) > 0.1)
    wobble = np.where(distance > 0, 0, 6 * 64)
    turn = (plain + step_q6) // 23040
    start = np.diff(turn, append=turn[-1:]) > 0
    return encode_nodes((plain - wobble) % 23040, distance, np.where(distance, 47, 0), start)


def capsule_starts(count: int, advance_q6: int) -> NDArray[np.int64]:
    return (1000 + advance_q6 * np.arange(count)) % 23040


def legacy(count: int, *, advance_q6: int = 1876, seed: int = 0, s_at: int = -1) -> list[bytes]:
    rng = np.random.default_rng(seed)
    return [
        encode_legacy(
            int(start),
            number == s_at,
            rng.integers(0, 12_000, 32) << 2,
            rng.integers(0, 64, 32),
        )
        for number, start in enumerate(capsule_starts(count, advance_q6))
    ]


def dense(count: int, *, advance_q6: int = 1170, seed: int = 0) -> list[bytes]:
    rng = np.random.default_rng(seed)
    return [
        encode_dense(int(start), False, rng.integers(0, 40_000, 40) << 2)
        for start in capsule_starts(count, advance_q6)
    ]


def ultra(count: int, *, advance_q6: int = 2813, seed: int = 0, s_at: int = -1) -> list[bytes]:
    """Walls of all distances; each beam a little beside the last, some without echo."""
    rng = np.random.default_rng(seed)
    distance = np.abs(np.cumsum(rng.normal(0.0, 12.0, 96 * count + 1)) + 900.0).astype(np.int64)
    distance *= rng.random(len(distance)) > 0.1
    return [
        encode_ultra(int(start), number == s_at, distance[96 * number : 96 * number + 97] << 2)
        for number, start in enumerate(capsule_starts(count, advance_q6))
    ]


def fed(decoder: Decoder, pieces: Iterable[bytes]) -> Beams:
    """All beams of a stream that came in these pieces."""
    return joined([beams for piece in pieces if len(beams := decoder.feed(piece))])


def parts(data: bytes, cuts: Iterable[int]) -> list[bytes]:
    """A stream cut at these places."""
    places = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    return [data[begin:end] for begin, end in pairwise(places)]


def assert_same(one: Beams, other: Beams) -> None:
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
