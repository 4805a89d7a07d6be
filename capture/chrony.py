"""What chrony, where it runs, says of this machine's clock."""

from __future__ import annotations

import shutil
import subprocess

WAIT_S = 1.0


def chrony_words() -> str:
    """The line of `chronyc -c tracking`; "" where there is no chrony, or it does not answer."""
    program = shutil.which("chronyc")
    if program is None:
        return ""
    try:
        done = subprocess.run(
            [program, "-c", "tracking"], capture_output=True, text=True, timeout=WAIT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
