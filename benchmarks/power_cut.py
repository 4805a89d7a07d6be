"""How much a power cut costs: a recording is killed at random moments and recovered, 20 times.

    uv run python benchmarks/power_cut.py [TRIALS]

Lidar, VESC and Razor are emulated behind pseudo-terminals at real pace; `trackside record` is a
process of its own that gets SIGKILL. "lost" is the time from the last message that `trackside
recover` saved to the kill; every recovered log is read to its end by rosbags and by mcap.
(The operating system lives on, so what it had not yet brought to the disk is not put to the test.)
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from capture.recording.recover import recover
from capture.session import Session
from dialogue import Cell, Table
from drivers import DeviceModel, PtyEmulator
from drivers.imu.razor import razor_model
from drivers.rplidar import emulated_lidar
from drivers.vesc import emulated_vesc

LOST_AT_MOST_S = 1.0
KILLED_AFTER_S = (0.5, 5.0)


def main() -> None:
    """Print what each kill cost."""
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    rng = np.random.default_rng(0)
    rows: list[tuple[Cell, ...]] = []
    for trial, after_s in enumerate(rng.uniform(*KILLED_AFTER_S, trials).tolist()):
        lost_s, messages = _killed(after_s)
        met = lost_s is not None and lost_s <= LOST_AT_MOST_S
        rows.append((trial + 1, after_s, lost_s, messages, "met" if met else "MISSED"))
    columns = ("trial", "killed after [s]", "lost [s]", "messages read by both", "")
    print(Table(columns, tuple(rows), f"{trials} kills, at most {LOST_AT_MOST_S} s").render("md"))
    lost = [row[2] for row in rows if isinstance(row[2], float)]
    print(
        f"\nworst {max(lost):.3f} s, mean {np.mean(lost):.3f} s, {len(lost)} of {trials} readable"
    )


def _killed(after_s: float) -> tuple[float | None, int]:
    """Seconds that are missing and messages that are there; None where nothing can be read."""
    models: dict[str, DeviceModel] = {
        "lidar": emulated_lidar(),
        "vesc": emulated_vesc(),
        "razor": razor_model(),
    }
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        blocks = []
        for device, model in models.items():
            emulator = stack.enter_context(PtyEmulator(model))
            blocks.append(f"{device}:\n  port: {emulator.path}\n")
        (folder / "rig.yaml").write_text("recording:\n  still_s: 0.0\n" + "".join(blocks))
        killed_ns = _record_and_kill(folder, after_s)
        (session,) = (folder / "sessions").glob("*")
        recover(session)
        return _lost_s(session, killed_ns)


def _record_and_kill(folder: Path, after_s: float) -> int:
    """When the recording was killed, so long after every device gave something."""
    command = [sys.executable, "-m", "trackside", "record", "--map", "cut"]
    with subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        while "drive;" not in process.stderr.readline():
            assert process.poll() is None
        time.sleep(after_s)
        killed_ns = time.time_ns()
        process.kill()
    return killed_ns


def _lost_s(session: Path, killed_ns: int) -> tuple[float | None, int]:
    topics = Session.open(session).topics
    if not topics:
        return None, 0
    with AnyReader([session]) as reader:
        by_rosbags = sum(1 for _ in reader.messages())
    with (session / "car.mcap").open("rb") as stream:
        by_mcap = sum(1 for _ in make_reader(stream).iter_messages())
    assert by_rosbags == by_mcap == sum(topic.count for topic in topics)
    return (killed_ns - max(topic.last_ns for topic in topics)) * 1e-9, by_mcap


if __name__ == "__main__":
    main()
