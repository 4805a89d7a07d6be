"""Processes that do jobs, and end when nobody wants the rest."""

from __future__ import annotations

import multiprocessing
import threading
from multiprocessing.connection import wait
from pathlib import Path

import pytest

from dialogue import UsageError
from trackside.workers import Failure, chosen_runner, on_cores, one_after_the_other


def long_but_the_first(folder: Path) -> str | Failure:
    """Tells that it begins, and that it cleared up."""
    try:
        (folder / "begun").touch()
        if folder.name != "0":
            threading.Event().wait(120)
    finally:
        (folder / "cleared").touch()
    return folder.name


def test_who_stops_listening_stops_the_work(tmp_path: Path) -> None:
    folders = [tmp_path / str(k) for k in range(6)]
    for folder in folders:
        folder.mkdir()
    before = multiprocessing.active_children()
    done = on_cores(folders, 2, long_but_the_first)
    assert next(done) == (folders[0], "0")
    own = [child for child in multiprocessing.active_children() if child not in before]
    assert own
    done.close()  # type: ignore[attr-defined]  # a generator behind an Iterator
    for child in own:
        # Not `join`: the pool's thread waits for the child, too, and only one of both is told.
        assert wait([child.sentinel], timeout=30)
    begun = [folder for folder in folders if (folder / "begun").exists()]
    assert len(begun) < len(folders)
    assert all((folder / "cleared").exists() for folder in begun)


def test_one_worker_is_this_process(tmp_path: Path) -> None:
    (tmp_path / "0").mkdir()
    runner = chosen_runner(long_but_the_first, 1, None, "--workers")
    before = multiprocessing.active_children()
    assert list(runner([tmp_path / "0"])) == [(tmp_path / "0", "0")]
    assert list(one_after_the_other([], long_but_the_first)) == []
    assert multiprocessing.active_children() == before


def test_the_flag_that_contradicts_a_scheduler_is_named() -> None:
    with pytest.raises(UsageError, match="--workers is for this machine"):
        chosen_runner(long_but_the_first, 2, "tcp://127.0.0.1:9", "--workers")
