from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from capture import LogError, SessionError, new_folder, write_text


def full_disk(_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def fail_within(target: Path, error: type[BaseException]) -> None:
    with new_folder(target) as partial:
        (partial / "x").write_text("1")
        raise error


def test_a_folder_appears_when_the_block_ends(tmp_path: Path) -> None:
    with new_folder(tmp_path / "a" / "b") as partial:
        (partial / "x").write_text("1")
        assert not (tmp_path / "a" / "b").exists()
    assert (tmp_path / "a" / "b" / "x").read_text() == "1"
    assert [child.name for child in (tmp_path / "a").iterdir()] == ["b"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_an_error_leaves_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    with pytest.raises(error):
        fail_within(tmp_path / "a", error)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(SessionError, match=r"a exists already .* give another name"):
        new_folder(tmp_path / "a").__enter__()
    assert [child.name for child in tmp_path.iterdir()] == ["a"]


def test_replacing_swaps_the_whole_folder(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "old").touch()
    with new_folder(tmp_path / "a", replace=True) as partial:
        (partial / "new").touch()
    assert [file.name for file in (tmp_path / "a").iterdir()] == ["new"]
    assert [child.name for child in tmp_path.iterdir()] == ["a"]


def test_a_failed_replacement_keeps_the_old(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "old").touch()
    with pytest.raises(RuntimeError), new_folder(tmp_path / "a", replace=True):
        raise RuntimeError
    assert [file.name for file in (tmp_path / "a").iterdir()] == ["old"]


def test_a_swap_that_fails_halfway_puts_the_old_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "old").touch()
    with new_folder(tmp_path / "a", replace=True) as partial:
        partial.touch()
        monkeypatch.setattr(Path, "rename", lambda *_: full_disk(None))
        context = new_folder(tmp_path / "a", replace=True)
        context.__enter__()
        with pytest.raises(LogError, match="No space left"):
            context.__exit__(None, None, None)
        monkeypatch.undo()
        assert [file.name for file in (tmp_path / "a").iterdir()] == ["old"]


def test_a_full_disk_leaves_the_old_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a.txt"
    write_text(file, "old")
    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(
        LogError, match=r"cannot write .*a\.txt: No space left .*MB free.*make room"
    ):
        write_text(file, "new")
    assert file.read_text() == "old"
    assert [child.name for child in tmp_path.iterdir()] == ["a.txt"]
