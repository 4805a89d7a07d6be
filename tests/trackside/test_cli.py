from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click
import pytest

from dialogue import TracksideError, UsageError
from dialogue.lazy_group import LazyGroup
from trackside import cli


def stopped(monkeypatch: pytest.MonkeyPatch, raised: BaseException) -> int:
    """The exit code when a command raises."""

    @click.command()
    def broken() -> None:
        raise raised

    monkeypatch.setattr(LazyGroup, "get_command", lambda *_: broken)
    with pytest.raises(SystemExit) as end:
        cli.main(["demo"])
    assert isinstance(end.value.code, int)
    return end.value.code


@pytest.mark.parametrize(
    ("raised", "code", "told"),
    [
        (TracksideError("no such car; look in the garage"), 1, "no such car; look in the garage"),
        (UsageError("--speed 9: at most 3"), 2, "--speed 9: at most 3"),
        (KeyboardInterrupt(), 130, "stopped"),
        (click.exceptions.Exit(3), 3, ""),
    ],
)
def test_a_known_error_is_one_line_and_a_code(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    raised: BaseException,
    code: int,
    told: str,
) -> None:
    assert stopped(monkeypatch, raised) == code
    printed = capsys.readouterr()
    assert told in printed.err
    assert "Traceback" not in printed.err
    assert printed.out == ""


def test_a_fault_of_ours_leaves_a_trace_in_a_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert stopped(monkeypatch, ZeroDivisionError("by nothing")) == 70
    told = capsys.readouterr().err
    (log,) = tmp_path.glob("trackside-*.log")
    assert str(log) in told
    assert "ZeroDivisionError" in log.read_text()


def test_a_command_that_ends_well_ends_with_0() -> None:
    with pytest.raises(SystemExit) as end:
        cli.main(["--version"])
    assert end.value.code == 0


def test_an_unknown_command_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        cli.main(["scor"])
    assert end.value.code == 2
    assert "score" in capsys.readouterr().err


@pytest.mark.parametrize("name", sorted(cli.COMMANDS))
def test_every_command_is_there_and_explains_itself(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        cli.main([name, "--help"])
    assert end.value.code == 0
    assert "--help" in capsys.readouterr().out


def test_help_loads_no_room_that_works() -> None:
    program = (
        "import sys, runpy; sys.argv = ['trackside', '--help']\n"
        "try: runpy.run_module('trackside', run_name='__main__')\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'numba', 'scipy', 'matplotlib', 'rosbags', 'mcap', 'rich', 'capture'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], check=True, capture_output=True)


def test_a_reader_that_goes_away_is_no_error() -> None:
    command = f"{sys.executable} -m trackside --help | head -n 1"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
