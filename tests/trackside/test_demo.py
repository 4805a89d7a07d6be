from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from dialogue import TracksideError
from trackside import demo as module
from trackside.demo import demo

NUMBER = re.compile(r"\d+\.\d+")
REPOSITORY = Path(__file__).parent.parent.parent


def run_demo(monkeypatch: pytest.MonkeyPatch, folder: Path, *words: str) -> str:
    monkeypatch.chdir(folder)
    done = CliRunner().invoke(demo, list(words), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def test_the_demo_goes_the_whole_road(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    printed = run_demo(monkeypatch, tmp_path)
    session = tmp_path / "trackside-demo"
    assert (session / "report.html").stat().st_size > 50_000
    totals = {}
    for preset in ("thesis", "robust"):
        (score,) = json.loads((session / "scores" / f"{preset}.json").read_text())["scores"]
        assert score["counts"]["pairs"] == 14
        totals[preset] = score["total"]
    # The robust preset knows that one sighting makes no cone.
    assert totals["robust"] < 0.5 * totals["thesis"]
    for line in readme_block():
        assert any(alike(line, other) for other in printed.splitlines()), line


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


def test_a_second_demo_takes_another_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "trackside-demo").mkdir()
    run_demo(monkeypatch, tmp_path)
    assert (tmp_path / "trackside-demo-2" / "report.html").is_file()
    assert not any((tmp_path / "trackside-demo").iterdir())


def test_an_existing_folder_is_not_touched(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").mkdir()
    done = CliRunner().invoke(demo, ["-o", "mine"])
    assert isinstance(done.exception, TracksideError)
    assert "mine exists already" in str(done.exception)


def test_a_missing_example_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(module, "__file__", str(tmp_path / "trackside" / "demo.py"))
    with pytest.raises(TracksideError, match="missing from this installation; reinstall"):
        module._example("loop")


def test_the_example_is_made_again_to_the_byte(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from make_loop import main

    monkeypatch.setattr("sys.argv", ["make_loop.py", str(tmp_path / "loop")])
    main()
    for file in ("car.mcap", "ground_truth/car.tum", "ground_truth/cones.csv", "session.yaml"):
        ours = (REPOSITORY / "examples" / "loop" / file).read_bytes()
        assert (tmp_path / "loop" / file).read_bytes() == ours, file
