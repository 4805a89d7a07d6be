"""Whoever types what our pages say gets what they say.

`RUN` are pages of which every command is run; `tests/doc_commands.py` tells how a page excuses one
and asks for a stage. Of all pages every command and option must exist.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from doc_commands import (
    Command,
    PageError,
    Stage,
    calls_in_prose,
    commands_of,
    fault_of,
    run_page,
)

from simulation.stereo import write_factory_file, zed_pair
from trackside.virtual.day import RunPlan, simulate_run

REPOSITORY = Path(__file__).parent.parent
SAMPLE = Path(__file__).with_name("sample_page.md")
ALL = sorted([*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").glob("*.md"), SAMPLE])
RUN = [
    SAMPLE,
    *(
        pytest.param(
            REPOSITORY / "docs" / name, marks=[pytest.mark.slow, pytest.mark.timeout(1200)]
        )
        for name in ("quickstart.md", "trackday.md")
    ),
]
"""Pages that are run whole, in the order of a day."""


def recorded_loop(folder: Path) -> None:
    """A recording with truth and without an estimate, called `loop`."""
    shutil.copytree(REPOSITORY / "examples" / "loop", folder / "loop")


def nothing(_folder: Path) -> None:
    """A folder as it is."""


def factory_file(folder: Path) -> None:
    """The settings file of a ZED."""
    write_factory_file(folder, zed_pair())


def driven_figures(folder: Path) -> None:
    """A joined session of the calibration drive, called `figures`."""
    made = folder / "simulated_figures"
    simulate_run(made, RunPlan(map="figures", power="low", seed=1, filmed=False, stereo=False), shy)
    shutil.move(made / "car", folder / "figures")


def driven_turn(folder: Path) -> None:
    """What car and laptop recorded of one run, in `sessions/`, and the scene."""
    made = folder / "simulated_turn"
    simulate_run(made, RunPlan(map="turn", power="low", seed=1, jobs=2), shy)
    (folder / "sessions").mkdir()
    shutil.move(made / "car", folder / "sessions" / "2019-05-14_turn_low_1")
    shutil.move(made / "film", folder / "sessions" / "2019-05-14_turn_low_1_film")
    shutil.move(made / "scene.yaml", folder / "scene.yaml")


@contextmanager
def shy(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """Progress that nobody sees."""
    del label, total
    yield lambda _done: None


STAGES: dict[str, Stage] = {
    "loop": recorded_loop,
    "empty": nothing,
    "factory": factory_file,
    "figures": driven_figures,
    "turn": driven_turn,
}
"""What `<!-- run: NAME -->` sets into the folder before a block."""


def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


@pytest.mark.parametrize("page", ALL, ids=lambda page: page.name)
def test_every_command_and_option_of_a_page_exists(page: Path) -> None:
    commands = [one for one in commands_of(page.name, text(page)) if not one.changes_folder]
    prose = calls_in_prose(page.name, text(page))
    faults = [fault_of(command) for command in commands]
    faults += [fault_of(call, whole=False) for call in prose]
    assert [fault for fault in faults if fault] == []


def test_the_readme_and_the_car_have_commands_to_look_at() -> None:
    counts = {page.name: len(commands_of(page.name, text(page))) for page in ALL}
    assert counts["README.md"] >= 20
    assert counts["car.md"] >= 4
    assert counts["algorithm.md"] == 0


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.name)
def test_every_command_of_a_page_runs(
    page: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    excused = run_page(page.name, text(page), tmp_path, STAGES, monkeypatch.chdir)
    with capsys.disabled():
        for line in excused:
            sys.stdout.write(f"\n{line}")
    commands = [one for one in commands_of(page.name, text(page)) if not one.changes_folder]
    assert len(excused) == sum(bool(one.excuse) for one in commands)
    assert len(excused) < len(commands)


def test_the_sample_shows_all_that_a_page_can_say(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    found = commands_of("sample_page.md", text(SAMPLE))
    assert [one.words[0] for one in found] == [
        *("info", "slam", "score", "export", "loop", "info", "record", "film", "score"),
    ]
    assert found[0] == Command("sample_page.md", 7, ("info", "loop"), stages=("loop",))
    assert found[1].words[-4:] == ("--preset", "robust", "--name", "robust")
    assert found[2].output == "score.json"
    assert found[4].changes_folder
    excused = [one.words[0] for one in found if one.excuse == "they need the car"]
    assert excused == ["record", "film"]
    run_page("sample_page.md", text(SAMPLE), tmp_path, STAGES, monkeypatch.chdir)
    assert (tmp_path / "score.json").read_text().startswith("{")
    assert (tmp_path / "loop" / "report.html").is_file()


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ("trackside slam loop --algoritm ekf", "No such option '--algoritm'"),
        ("trackside score loop --format xml", "'xml'"),
        ("trackside scor loop", "there is no command scor"),
        ("trackside score one two", "two"),
        ("trackside compare", "it needs inputs"),
        ("trackside export tum loop", "it needs --output"),
        ("trackside calibrate wall pictures/", "there is no wall"),
        ("trackside slam tune runs/ --parameters accept_gate=6 --seeds many", "'many'"),
        ("cd x && trackside info y --all | head -3", "No such option '--all'"),
        (".uv/bin/uv run trackside demo --fast  # quickly", "No such option '--fast'"),
    ],
)
def test_what_does_not_exist_is_told(said: str, told: str) -> None:
    (found,) = [one for one in commands_of("p.md", f"```sh\n{said}\n```") if not one.changes_folder]
    assert told in fault_of(found)
    assert fault_of(found).startswith("p.md:2: trackside ")
    assert [fault_of(one) for one in commands_of("p.md", f"    {said}\n") if fault_of(one)]


@pytest.mark.parametrize(
    "said",
    ["trackside COMMAND --help", "trackside --help", "trackside slam SESSION --preset best.yaml",
     "trackside import mrclam DATA --robot 1 -o out", "trackside slam tune --help",
     "trackside calibrate camera|world|verify|show", "trackside import mrclam|bag|tum"],
)  # fmt: skip
def test_what_stands_for_something_is_let_pass(said: str) -> None:
    (call,) = calls_in_prose("p.md", f"Type `{said}`, then look.")
    assert fault_of(call, whole=False) == ""


@pytest.mark.parametrize(
    ("page", "told"),
    [
        ("    trackside info nowhere", "p.md:1: trackside info nowhere: exit code"),
        ("<!-- run: moon -->\n    trackside info x", "no stage 'moon'; there are: empty, factory"),
        ("<!-- not run: -->\n    trackside info x", "p.md:1: expected"),
        ("<!-- not run -->\n    trackside info x", "p.md:1: expected"),
        ("<!-- not run record: no car -->\n    trackside info x", "the block has no record"),
        ("<!-- not run: no car -->\nand so on", "no command follows this comment"),
    ],
)
def test_a_page_that_is_wrong_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, page: str, told: str
) -> None:
    with pytest.raises(PageError, match=told):
        run_page("p.md", page, tmp_path, STAGES, monkeypatch.chdir)
