"""The report of a real estimate, as the commands make it, in a real browser."""

from __future__ import annotations

import shutil
from pathlib import Path

from browser import Browser, faults
from click.testing import CliRunner

from trackside.cli import trackside

REPOSITORY = Path(__file__).parent.parent.parent


def call(*words: object) -> None:
    done = CliRunner().invoke(trackside, [str(word) for word in words], catch_exceptions=False)
    assert done.exit_code == 0, done.output


def test_a_browser_shows_the_report_of_a_session_without_a_fault(
    browser: Browser, tmp_path: Path
) -> None:
    run = tmp_path / "loop"
    shutil.copytree(REPOSITORY / "examples" / "loop", run)
    for preset in ("thesis", "robust"):
        call("slam", run, "--association", "nearest", "--preset", preset, "--name", preset)
    call("score", run)
    assert faults(browser, run / "report.html") == []
