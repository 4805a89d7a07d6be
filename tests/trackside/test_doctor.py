from __future__ import annotations

import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from trackside import doctor as module
from trackside.doctor import doctor, examine
from trackside.finding import Finding


def finding(what: str, folder: Path) -> Finding:
    return next(f for f in examine(folder) if f.what == what)


def test_this_environment_is_well(tmp_path: Path) -> None:
    assert [f for f in examine(tmp_path) if not f.well] == []


def test_faults_are_listed_together_and_end_with_1(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LIBRARIES", {"numpy": "numpy", "no_such_library": "x"})
    monkeypatch.setattr(module, "packages_distributions", lambda: {"slam": ["slam-toys"]})
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=10_000_000))
    done = CliRunner().invoke(doctor)
    assert done.exit_code == 1
    assert "3 to mend" in done.output
    assert "slam by slam-toys" in done.output
    assert "No module named 'no_such_library'" in done.output
    assert "free 500 MB" in done.output


def test_a_shell_that_shadows_us_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "slam").mkdir()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    seen = finding("search path", tmp_path)
    assert not seen.well
    assert str(tmp_path) in seen.seen
    assert "unset PYTHONPATH" in seen.remedy


def test_kernels_that_cannot_be_kept_are_a_fault_with_a_remedy(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr("slam.ekf.EkfSlam.__init__", broken)
    seen = finding("slam kernels", tmp_path)
    assert not seen.well
    assert "NUMBA_CACHE_DIR" in seen.remedy


def test_a_log_that_comes_back_different_is_a_fault(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def broken(*_: object) -> None:
        raise OSError("no space")

    monkeypatch.setattr("capture.Session.observations", broken)
    assert not finding("log format", tmp_path).well
