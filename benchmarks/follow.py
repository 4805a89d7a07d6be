"""How far behind the car `trackside slam --follow` is, while a recorder writes at the car's pace.

    uv run python benchmarks/follow.py

A thread writes the recording of tests/slam/recording.py (8 s: lidar 10 Hz with 400 points, odometry
50 Hz, IMU 200 Hz) as it would come from the car; the log is flushed once a second. One process for
both, so the writer's work is in the times too.
"""

from __future__ import annotations

import struct
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "slam"))

from recording import START_NS, Message, messages  # tests/slam, which is no package

from capture import Session, SessionInfo
from capture.log_writer import LogWriter
from capture.session_info import write_session_info
from capture.topics import LOG_NAME
from dialogue import Table
from slam.algorithms import Request
from slam.follow import follow_session

PERIOD_MS = 1000.0 / 15.0
"""A scan must be done before the next comes; the car's lidar turns at most 15 times a second."""
FLUSH_S = 1.0
AGE_LIMIT_S = FLUSH_S + 0.25
"""What is written reaches the file once a second, and has then a quarter of one to be taken."""
STILL_S = 1.0
"""With the gyro a slow car is waited for until it is known whether it stands (`still_s`)."""


def main() -> None:
    """Print the table."""
    content = messages()
    rows = [
        _row(name, request, content, age_limit_s)
        for name, request, age_limit_s in (
            ("ekf", Request(), AGE_LIMIT_S),
            ("ekf, imu+vesc", Request(odometry="imu+vesc"), AGE_LIMIT_S + STILL_S),
            ("fastslam", Request(algorithm="fastslam"), AGE_LIMIT_S),
        )
    ]
    columns = (
        "algorithm", "scans", "update median [ms]", "p99 [ms]", "max [ms]", "at most [ms]",
        "p99 / at most", "age median [s]", "age p99 [s]", "at most [s]", "age p99 / at most",
    )  # fmt: skip
    print(Table(columns, tuple(rows), "following a recording").render("md"))


def _row(
    name: str, request: Request, content: list[Message], age_limit_s: float
) -> tuple[str | float | int, ...]:
    with tempfile.TemporaryDirectory() as folder:
        told = _followed(Path(folder), request, content)
    update, age = told["update_s"], told["age_s"]
    milliseconds = {key: value * 1e3 for key, value in update.items()}
    return (
        name,
        told["scans"],
        milliseconds["median"],
        milliseconds["p99"],
        milliseconds["max"],
        PERIOD_MS,
        milliseconds["p99"] / PERIOD_MS,
        age["median"],
        age["p99"],
        age_limit_s,
        age["p99"] / age_limit_s,
    )


def _followed(folder: Path, request: Request, content: list[Message]) -> dict[str, Any]:
    write_session_info(folder, SessionInfo())
    # The recorder starts once following has compiled its kernels and looks.
    looking = threading.Event()
    writer = threading.Thread(target=_record, args=(folder, content, looking))
    writer.start()
    done = follow_session(
        Session.open(folder), request, "live", patience_s=20.0, show=lambda _: looking.set()
    )
    writer.join()
    told = done.estimate.provenance["latency"]
    assert isinstance(told, dict)
    return told


def _record(folder: Path, content: list[Message], looking: threading.Event) -> None:
    looking.wait()
    began_ns = time.time_ns()
    with LogWriter(folder / LOG_NAME, sync_period_s=FLUSH_S) as log:
        for log_t_ns, stamp_ns, topic, kind, data in content:
            due_ns, at_ns = (began_ns + t_ns - START_NS for t_ns in (log_t_ns, stamp_ns))
            # After the encapsulation a message begins with its stamp.
            now = data[:4] + struct.pack("<iI", *divmod(at_ns, 1_000_000_000)) + data[12:]
            time.sleep(max(due_ns - time.time_ns(), 0) * 1e-9)
            log.write(topic, kind, now, log_t_ns=due_ns, stamp_ns=at_ns)


if __name__ == "__main__":
    main()
