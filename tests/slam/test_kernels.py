from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from slam import kernels


def test_the_cache_belongs_to_exactly_this_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = kernels.cache_folder()
    assert folder.parent == tmp_path / "trackside"
    copy = tmp_path / "room"
    shutil.copytree(Path(kernels.__file__).parent, copy)
    monkeypatch.setattr(kernels, "__file__", str(copy / "kernels.py"))
    assert kernels._source_hash() == kernels._SOURCE_HASH
    (copy / "fastslam" / "kernels.py").write_text("changed")
    assert kernels._source_hash() != kernels._SOURCE_HASH


def test_a_kernel_gives_what_the_python_function_gives() -> None:
    def tripled(x: float) -> float:
        return 3.0 * x

    assert kernels.kernel(tripled)(2.0) == tripled(2.0)
