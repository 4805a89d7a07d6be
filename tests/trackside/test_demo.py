from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from browser import Browser, faults
from click.testing import CliRunner

from dialogue import TracksideError
from trackside.demo import _free_name, demo
from trackside.shipped import example

NUMBER = re.compile(r"\d+\.\d+")
REPOSITORY = Path(__file__).parent.parent.parent


@pytest.fixture(scope="module")
def whole_road(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of a demo, and what it printed."""
    folder = tmp_path_factory.mktemp("demo") / "demo"
    done = CliRunner().invoke(demo, ["-o", str(folder)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return folder, done.output


@pytest.mark.slow
def test_the_demo_goes_the_whole_road(whole_road: tuple[Path, str]) -> None:
    folder, printed = whole_road
    assert (folder / "run" / "report.html").stat().st_size > 50_000
    assert (folder / "run" / "ground_truth" / "track.html").exists()
    for name in ("ekf", "fastslam"):
        file = folder / "run" / "scores" / f"{name}.json"
        (score,) = json.loads(file.read_text())["scores"]
        assert score["counts"]["pairs"] == score["counts"]["landmarks_true"] == 14
        assert score["total"] < 0.5
    for line in readme_block():
        assert any(alike(line, other) for other in printed.splitlines()), line


@pytest.mark.slow
def test_each_step_is_shown_as_the_command_that_it_is(whole_road: tuple[Path, str]) -> None:
    folder, printed = whole_road
    shown = [line.split()[2] for line in printed.splitlines() if line.startswith("$ trackside ")]
    assert shown == ["simulate", "join", "vo", "slam", "slam", "score"]
    assert f"Look at {folder / 'run' / 'report.html'}" in printed


@pytest.mark.slow
@pytest.mark.parametrize("page", ["report.html", "ground_truth/track.html"])
def test_a_browser_shows_its_pages_without_a_fault(
    browser: Browser, whole_road: tuple[Path, str], page: str
) -> None:
    assert faults(browser, whole_road[0] / "run" / page) == []


def alike(shown: str, printed: str) -> bool:
    """Whether two lines have the same words, and numbers that another processor may round."""
    pairs = list(zip(shown.split(), printed.split(), strict=False))
    if len(shown.split()) != len(printed.split()):
        return False
    numbers = [(a, b) for a, b in pairs if NUMBER.fullmatch(a) and NUMBER.fullmatch(b)]
    words = [(a, b) for a, b in pairs if (a, b) not in numbers]
    near = all(abs(float(a) - float(b)) < 0.0025 for a, b in numbers)
    return near and all(a == b for a, b in words)


def readme_block() -> list[str]:
    """The lines of the README's picture of the demo."""
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    block = text.partition("<!-- demo")[2].partition("```text\n")[2].partition("```")[0]
    lines = [line for line in block.splitlines() if line.strip()]
    assert len(lines) >= 4
    return lines


def test_the_first_free_name_is_taken(tmp_path: Path) -> None:
    assert _free_name(tmp_path / "demo") == tmp_path / "demo"
    (tmp_path / "demo").mkdir()
    assert _free_name(tmp_path / "demo") == tmp_path / "demo-2"
    (tmp_path / "demo-2").mkdir()
    assert _free_name(tmp_path / "demo") == tmp_path / "demo-3"


def test_an_existing_folder_is_not_touched(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").mkdir()
    done = CliRunner().invoke(demo, ["-o", "mine"])
    assert isinstance(done.exception, TracksideError)
    assert "mine exists already" in str(done.exception)


def test_a_missing_example_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("trackside.shipped._FOLDERS", (tmp_path,))
    with pytest.raises(TracksideError, match="missing from this installation; reinstall"):
        example("thesis.yaml")


def test_the_example_is_made_again_to_the_byte(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from make_loop import main

    monkeypatch.setattr("sys.argv", ["make_loop.py", str(tmp_path / "loop")])
    main()
    for file in ("car.mcap", "ground_truth/car.tum", "ground_truth/cones.csv", "session.yaml"):
        ours = (REPOSITORY / "examples" / "loop" / file).read_bytes()
        assert (tmp_path / "loop" / file).read_bytes() == ours, file
