"""Fixtures of all rooms' tests."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import Browser, missing_programs
from hypothesis import settings

REPOSITORY = Path(__file__).parent.parent


# The same examples in every run, and no deadline: two shared cores can be slow without being wrong.
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real recordings; tests that need it are skipped where it is absent."""
    folder = Path(os.environ.get("TRACKSIDE_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the real recordings are not at {folder} (set TRACKSIDE_DATA)")
    return folder


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """A headless Chromium; tests that need it are skipped where it is not installed."""
    if missing := missing_programs():
        pytest.skip(f"not installed: {', '.join(missing)} (Debian: chromium, chromium-driver)")
    opened = Browser()
    yield opened
    opened.close()
