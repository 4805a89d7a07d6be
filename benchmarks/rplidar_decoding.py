"""What decoding a lidar costs: `uv run python benchmarks/rplidar_decoding.py`.

The same canned stream goes through our decoders, in reads as a driver makes them, and through the
PyPI package pyrplidar, which reads packet by packet from a port in memory. One thread; both in
turn, round for round; the ratio is the median of the rounds' ratios. Exit code 1 below a limit.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

from pyrplidar import PyRPlidar

from drivers.rplidar import DECODERS, Answer, ScanMode
from drivers.rplidar.emulator import BOOST, EXPRESS, STANDARD
from drivers.rplidar.protocol import ANSWER_BYTES, Descriptor
from drivers.rplidar.scene import Rotor, Scan, room

SECONDS, ROUNDS = 8.0, 15


@dataclass(frozen=True)
class Case:
    """A stream, how many of its packets a read brings, and how much faster we must be."""

    mode: ScanMode
    packets: int
    limit: float | None


CASES = (
    Case(STANDARD, 400, 15.0),
    Case(STANDARD, 20, None),
    Case(EXPRESS, 4, None),
    Case(BOOST, 1, None),
    Case(BOOST, 4, 7.0),
    Case(BOOST, 20, None),
)


def stream(mode: ScanMode) -> bytes:
    """What an emulated lidar in a room sends in `SECONDS`."""
    rotor = Rotor()
    rotor.jump(10.0, 0)
    scan, sent = Scan(mode, rotor, room(), 0), []
    while scan.ready_ns() < SECONDS * 1e9:
        sent.append(scan.take(restart=False))
    return b"".join(sent)


def ours(mode: ScanMode, reads: list[bytes]) -> tuple[float, int]:
    """Seconds, and how many beams."""
    decoder, count = DECODERS[mode.answer](), 0
    begin = time.perf_counter()
    for data in reads:
        count += len(decoder.feed(data))
    return time.perf_counter() - begin, count


class Memory:
    """A port for pyrplidar that holds a descriptor and a stream."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def send_data(self, data: bytes) -> None:
        """Nobody is there to hear it."""

    def receive_data(self, size: int) -> bytes:
        """The next bytes."""
        self._at += size
        return self._data[self._at - size : self._at]

    def close(self) -> None:
        """Nothing to close."""


def theirs(mode: ScanMode, data: bytes, beams: int) -> float:
    """Seconds for as many beams."""
    answer = Answer(mode.answer)
    head = Descriptor(answer, ANSWER_BYTES[answer], many=True).encode()
    lidar = PyRPlidar()
    lidar.lidar_serial = Memory(head + data)
    standard = mode.answer == Answer.STANDARD
    scan: Iterator[object] = (lidar.start_scan() if standard else lidar.start_scan_express(2))()
    begin = time.perf_counter()
    for _ in islice(scan, beams):
        pass
    spent = time.perf_counter() - begin
    lidar.lidar_serial = None  # else it tells that it is disconnected
    return spent


def measure(case: Case) -> bool:
    """Print a line; whether the limit is held."""
    data = stream(case.mode)
    size = case.packets * ANSWER_BYTES[Answer(case.mode.answer)]
    reads = [data[at : at + size] for at in range(0, len(data), size)]
    ratios, speeds = [], []
    for _ in range(ROUNDS):
        spent, beams = ours(case.mode, reads)
        ratios.append(theirs(case.mode, data, beams) / spent)
        speeds.append(beams / spent / 1e6)
    ratio = statistics.median(ratios)
    limit = "" if case.limit is None else f"   limit {case.limit:.0f}"
    print(
        f"{case.mode.name:9} {case.packets:4} packets a read  "
        f"{statistics.median(speeds):6.2f} M beams/s   ratio to pyrplidar {ratio:6.1f}{limit}"
    )
    return case.limit is None or ratio >= case.limit


def main() -> int:
    """Measure all cases; 1 if a limit is broken."""
    held = [measure(case) for case in CASES]
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
