"""A campaign whose sessions are synthetic."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import Result
from fake_steps import SMALL, Campaign, do_campaign


@pytest.fixture
def run_campaign(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Campaign:
    """Write a campaign file and do it, by default in this process."""

    def run(text: str = SMALL, *words: str, workers: int | None = 1) -> Result:
        return do_campaign(monkeypatch, tmp_path, text, *words, workers=workers)

    return run
