"""The whole rig at real pace for ten minutes: what is lost, what it takes, how true its stamps are.

    uv run python benchmarks/recorder.py [MINUTES]

Lidar 8000 samples/s (ultra capsules), VESC 50 Hz, IMU 200 Hz, camera 30 frames/s of 1080p JPEG
(0.5 MB each). Lidar and VESC are emulated in a process of their own behind pseudo-terminals; the
IMU's bus and the camera in the recorder's, whose share of a core includes them. Runs a second time
without the camera. "missing" is what the devices sent and the log does not hold; "jitter" is one
sigma of the stamps about the true times, which every sample carries within itself, from when every
device gave something (the lidar spins up for two seconds).
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "capture" / "recording"))

from full_rig import Emulated, Use, record
from rig_audit import Audit, audited

from dialogue import Cell, Table

JITTER_AT_MOST_S = 0.2e-3
SHARE_AT_MOST = {True: 0.35, False: 0.15}
GROWTH_AT_MOST_MB = 10.0


def main() -> None:
    """Print what was found, with and without the camera."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    for camera in (True, False):
        _measure(60.0 * minutes, camera=camera)


def _measure(seconds: float, *, camera: bool) -> None:
    folder = Path(tempfile.mkdtemp(prefix="trackside-rig-"))
    emulated = Emulated.start()
    try:
        use = record(folder, emulated, seconds, camera=camera)
        streams = audited(folder, emulated)
    finally:
        emulated.stop()
        shutil.rmtree(folder)
    with_camera = "with" if camera else "without"
    print(_streams(streams, f"{seconds:.0f} s {with_camera} the camera").render("md"))
    print()
    print(_use(use, SHARE_AT_MOST[camera]).render("md"))
    print(f"\nverdict: {use.verdict.verdict}: {use.verdict.text}\n")


def _streams(streams: list[Audit], title: str) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            s.name,
            s.messages,
            s.missing,
            1e3 * s.bias_s,
            1e3 * s.jitter_s,
            1e3 * JITTER_AT_MOST_S,
            _met(s.missing == 0 and s.jitter_s <= JITTER_AT_MOST_S),
        )
        for s in streams
    ]
    columns = (
        "stream", "messages", "missing", "mean error [ms]", "jitter [ms]", "at most [ms]", ""
    )  # fmt: skip
    return Table(columns, tuple(rows), title, digits=4)


def _use(use: Use, share_at_most: float) -> Table:
    early_mb, late_mb = use.memory_mb
    rows: tuple[tuple[Cell, ...], ...] = (
        ("share of one core", use.core_share, share_at_most, _met(use.core_share <= share_at_most)),
        ("memory, first quarter [MB]", early_mb, None, ""),
        (
            "memory, last quarter [MB]",
            late_mb,
            early_mb + GROWTH_AT_MOST_MB,
            _met(late_mb <= early_mb + GROWTH_AT_MOST_MB),
        ),
        ("most readings waiting", use.most_waiting, None, ""),
    )
    return Table(("figure", "found", "at most", " "), rows)


def _met(met: bool) -> str:
    return "met" if met else "MISSED"


if __name__ == "__main__":
    main()
