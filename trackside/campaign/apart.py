"""A session in a process of its own, as a cluster needs it.

Dask runs jobs in threads; a step wants its process for itself, for what it prints and for signals.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys

from trackside.campaign.work import Done, SessionJob, attempt
from trackside.workers import ONE_THREAD, Failure


def attempt_apart(job: SessionJob) -> Done | Failure:
    """As `attempt`; a process that dies is a failure of its session."""
    paths = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-m", "trackside.campaign.apart"],
        input=pickle.dumps(job),
        capture_output=True,
        check=False,
        env={**os.environ, **ONE_THREAD, "PYTHONPATH": paths},
    )
    if done.returncode != 0:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        return Failure(f"its process died ({lines[-1] if lines else done.returncode})")
    result = pickle.loads(done.stdout)
    assert isinstance(result, Done | Failure)
    return result


def main() -> None:
    """The other side: a job comes in, what became of it goes out."""
    result = attempt(pickle.load(sys.stdin.buffer))
    sys.stdout.buffer.write(pickle.dumps(result))


if __name__ == "__main__":
    main()
