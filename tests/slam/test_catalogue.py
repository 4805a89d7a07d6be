"""Algorithms of other distributions, installed as pip would: a folder on the path with metadata."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner

from capture import Observations, Odometry, Session, SessionInfo
from dialogue import UsageError
from slam import Algorithm, SlamError
from slam.algorithms import Request
from slam.catalogue import ALGORITHMS
from slam.cli import slam

DOCUMENT = Path(__file__).parent.parent.parent / "docs" / "algorithm.md"
S = 1_000_000_000


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)


def install(folder: Path, name: str, entries: str, **modules: str) -> None:
    metadata = folder / f"{name.replace('-', '_')}-1.2.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
    (metadata / "entry_points.txt").write_text(f"[trackside.slam]\n{entries}\n")
    for module, text in modules.items():
        (folder / f"{module}.py").write_text(text)


def recorded(folder: Path, landmark_id: npt.NDArray[np.int64]) -> Path:
    """A drive of three poses with two sightings."""
    t_ns, session = S + np.arange(3) * S, folder / "run"
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, np.pi / 2], [1.0, 1.0, np.pi / 2]])
    seen = np.array([2.0, 1.0]), np.array([0.0, -np.pi / 2])
    with Session.create(session, SessionInfo()) as writer:
        writer.add_odometry(Odometry("wheel", t_ns, poses, np.ones(3), np.zeros(3)))
        writer.add_observations(Observations(t_ns[1:], landmark_id, *seen))
    return session


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder that packages are installed into."""
    folder = tmp_path / "site"
    folder.mkdir()
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    for name in set(sys.modules) - before:
        if getattr(sys.modules[name], "__file__", None) == str(folder / f"{name}.py"):
            del sys.modules[name]


@pytest.fixture
def documented(site: Path) -> Path:
    """The distribution that docs/algorithm.md shows."""
    entry = blocks("toml")[0].splitlines()[1].replace('"', "")
    install(site, "dead-reckoner", entry, dead_reckoning=blocks("python")[0])
    return site


@pytest.mark.usefixtures("documented")
def test_the_documented_algorithm_runs_through_the_command(tmp_path: Path) -> None:
    session = recorded(tmp_path, np.array([7, 9]))
    done = CliRunner().invoke(slam, [str(session), "--algorithm", "dead-reckoning"])
    assert done.exit_code == 0, done.exception
    estimate = Session.open(session).estimate("dead-reckoning")
    assert estimate.map is not None
    assert estimate.map.landmarks.ids.tolist() == [7, 9]
    np.testing.assert_allclose(estimate.map.landmarks.positions, [[1, 2], [2, 1]], atol=1e-6)
    np.testing.assert_allclose(estimate.path.poses[-1], [1.0, 1.0, np.pi / 2], atol=1e-6)
    assert estimate.provenance["distribution"] == "dead-reckoner 1.2"
    assert estimate.provenance["algorithm"] == "dead-reckoning"


@pytest.mark.usefixtures("documented")
def test_one_that_must_be_told_names_says_so_where_there_are_none(tmp_path: Path) -> None:
    session = recorded(tmp_path, np.array([-1, -1]))
    refused = CliRunner().invoke(slam, [str(session), "--algorithm", "dead-reckoning"])
    assert isinstance(refused.exception, UsageError)
    assert "do not name their landmarks" in str(refused.exception)
    assert "use another algorithm" in str(refused.exception)


@pytest.mark.usefixtures("documented")
def test_the_help_and_the_error_of_a_wrong_name_list_it() -> None:
    assert "dead-reckoning" in list(ALGORITHMS)
    assert isinstance(ALGORITHMS["dead-reckoning"], Algorithm)
    helped = "".join(CliRunner().invoke(slam, ["--help"]).output.split())  # lines break at hyphens
    assert "dead-reckoning" in helped
    assert "ekf-fej" in helped
    with pytest.raises(UsageError, match=r"dead-reckoning.*ekf.*fastslam"):
        Request(algorithm="qqq")
    with pytest.raises(UsageError, match=r"--preset thesis: .*robust"):
        Request(algorithm="dead-reckoning", preset="thesis")


def test_the_document_shows_it_in_forty_lines() -> None:
    lines = [line for line in blocks("python")[0].splitlines() if line.strip()]
    assert len(lines) <= 40


def test_one_that_is_broken_says_so_and_harms_no_other(documented: Path) -> None:
    install(documented, "broken", "brittle = brittle:ALGORITHM\nabsent = no_such_module:A",
            brittle="raise RuntimeError('no licence')")  # fmt: skip
    install(documented, "odd", "odd = dead_reckoning:Config")
    assert {"brittle", "absent", "odd"} <= set(ALGORITHMS)
    with pytest.raises(SlamError, match=r"'brittle' of broken 1.2 .*RuntimeError: no licence"):
        Request(algorithm="brittle")
    with pytest.raises(SlamError, match=r"'absent' of broken 1.2 \(no_such_module:A\).*ModuleNot"):
        Request(algorithm="absent")
    with pytest.raises(SlamError, match=r"'odd' of odd 1.2 .*is a type, expected a slam.Algorithm"):
        Request(algorithm="odd")
    assert Request(algorithm="dead-reckoning").config().accept_gate == 9.21
    assert Request(algorithm="ekf").algorithm == "ekf"


def test_our_names_stay_ours_and_no_other_is_given_twice(documented: Path) -> None:
    install(documented, "usurper", "ekf = dead_reckoning:ALGORITHM")
    install(documented, "twin", "dead-reckoning = dead_reckoning:Config")
    assert list(ALGORITHMS).count("ekf") == 1
    assert ALGORITHMS["ekf"].associations == ("known", "nearest", "jcbb")
    assert ALGORITHMS.distribution("ekf") is None
    with pytest.raises(SlamError, match=r"dead-reckoner 1.2.* and .*twin 1.2.*uninstall one"):
        Request(algorithm="dead-reckoning")


@pytest.mark.usefixtures("documented")
def test_metadata_that_is_found_twice_is_one_offer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path / "again", "dead-reckoner", "dead-reckoning = dead_reckoning:ALGORITHM")
    monkeypatch.syspath_prepend(str(tmp_path / "again"))
    assert isinstance(ALGORITHMS["dead-reckoning"], Algorithm)
    assert len(ALGORITHMS) == len(set(ALGORITHMS))
    with pytest.raises(KeyError):
        ALGORITHMS["nobody"]
