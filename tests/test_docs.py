"""The pages say what is there: names of code, sources, links."""

from __future__ import annotations

import ast
import re
from functools import lru_cache
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parent.parent
ALGORITHMS = REPOSITORY / "docs" / "algorithms.md"
PAGES = sorted([*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").glob("*.md")])
ROOMS = sorted(folder.parent.name for folder in REPOSITORY.glob("*/py.typed"))

NAME = re.compile(rf"`((?:{'|'.join(ROOMS)})(?:\.\w+)+)`")
# Names and a year: "Neira and Tardos (IEEE T-RA 17, 2001)"; the thesis' title is no equation.
CITED = re.compile(
    r"[A-Z][a-z]+(?:(?!KTH)[\w., &()'\"-]){0,80}?,? \(?(?:19|20)\d\d\b|[Tt]hesis (?:Eq|appendix)"
)
# They cite whose files and bytes they read.
READERS = {"capture.import_mrclam", "capture.tum", "drivers.imu.mpu9250.protocol"}
# An entry point's group and no module.
NO_CODE = {"trackside.slam"}
WITHOUT_EQUATIONS = {"dialogue", "trackside"}


def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


@lru_cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def defined(node: ast.AST, name: str) -> ast.AST | None:
    """What a module or class calls `name`."""
    for child in getattr(node, "body", []):
        if isinstance(child, ast.ClassDef | ast.FunctionDef) and child.name == name:
            return child
        if isinstance(child, ast.ImportFrom) and name in [a.asname or a.name for a in child.names]:
            return ast.Pass()
        targets = child.targets if isinstance(child, ast.Assign) else [getattr(child, "target", 0)]
        if any(isinstance(target, ast.Name) and target.id == name for target in targets):
            return ast.Pass()
    return None


def exists(dotted: str) -> bool:
    """Whether a module has what the rest of the name says."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        path = REPOSITORY.joinpath(*parts[:count])
        file = (
            path.with_suffix(".py") if path.with_suffix(".py").is_file() else path / "__init__.py"
        )
        if not file.is_file():
            continue
        node: ast.AST | None = tree(file)
        for name in parts[count:]:
            node = node and defined(node, name)
        return node is not None
    return False


def module_of(file: Path) -> str:
    return ".".join(file.relative_to(REPOSITORY).with_suffix("").parts).removesuffix(".__init__")


def docstrings(file: Path) -> str:
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    nodes = [node for node in ast.walk(tree(file)) if isinstance(node, documented)]
    return " ".join((ast.get_docstring(node) or "").replace("\n", " ") for node in nodes)


def test_a_name_that_is_nowhere_is_noticed() -> None:
    assert exists("slam.motion.propagate")
    assert exists("geometry.camera.View.project")
    assert exists("slam.landmarks.RECORD")
    assert not exists("slam.motion.propagated")
    assert not exists("slam.nowhere.propagate")
    assert not exists("geometry.camera.View.projected")


def test_what_the_pages_name_of_the_code_exists() -> None:
    named = {page.name: set(NAME.findall(text(page))) - NO_CODE for page in PAGES}
    assert len(named["algorithms.md"]) > 150
    assert [name for names in named.values() for name in names if not exists(name)] == []


def test_every_module_that_cites_a_source_is_on_the_page_of_equations() -> None:
    named = NAME.findall(text(ALGORITHMS))
    citing = [
        module_of(file)
        for room in ROOMS
        for file in sorted((REPOSITORY / room).rglob("*.py"))
        if CITED.search(docstrings(file))
    ]
    assert {"slam.motion", "scoring.map_metrics", "tracking.bridging", *READERS} <= set(citing)
    # A package's own docstring stands for the modules in it.
    left_out = [
        module
        for module in citing
        if not any(name.startswith(f"{module}.") for name in named) and module not in READERS
    ]
    assert left_out == []


def test_every_room_that_computes_is_on_the_page_of_equations() -> None:
    named = {name.partition(".")[0] for name in NAME.findall(text(ALGORITHMS))}
    assert set(ROOMS) - named == WITHOUT_EQUATIONS


def test_every_source_that_is_cited_is_listed() -> None:
    body, _, listed = text(ALGORITHMS).partition("\n## Sources")
    cited = re.findall(r"\b([A-Z][\w-]+) (?:\()?((?:19|20)\d\d)\b", body)
    assert len(set(cited)) > 25
    rows = [line.split("|")[1] for line in listed.splitlines() if line.startswith("| ")]
    assert [
        f"{who} {year}"
        for who, year in sorted(set(cited))
        if not any(who in row and year in row for row in rows)
    ] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", text(page)):
        if target.startswith(("http://", "https://", "mailto:")):
            continue
        where, _, anchor = target.partition("#")
        linked = page.parent / where if where else page
        if not linked.exists() or (anchor and anchor not in anchors(linked)):
            broken.append(target)
    assert broken == []


def anchors(page: Path) -> set[str]:
    """What GitHub calls the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", text(page), re.MULTILINE)
    return {
        re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-") for heading in headings
    }
