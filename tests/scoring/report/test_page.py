"""The report of a session as one file."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from browser import Browser, faults
from report_scores import (
    make_path,
    make_score,
    without_anything,
    without_map,
    without_path,
)

from dialogue.pages import UNDEFINED
from geometry import LandmarkMap
from scoring import MapErrors, Score
from scoring.report import write_report

VOID = {"meta", "br", "hr", "img", "input", "link"}


class Balance(HTMLParser):
    """Every element that is opened is closed, in order; SVG shapes may close themselves."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:  # noqa: ARG002  the parser's signature
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag


def written(folder: Path, *scores: Score, title: str = "lap") -> str:
    file = folder / "report.html"
    write_report(file, scores, title, "a subtitle")
    text = file.read_text(encoding="utf-8")
    balance = Balance()
    balance.feed(text)
    assert balance.open == []
    return text


def text_of(page: str) -> str:
    return " ".join(re.sub(r"<[^>]*>", " ", page).split())


def test_numbers_that_matter_stand_in_it(tmp_path: Path) -> None:
    text = text_of(written(tmp_path, make_score()))
    assert "1.234 m, Total (Eq. 3.1)" in text
    assert "2 of 4 landmarks found, 1 false, pairing saturated" in text
    assert "2 0.3 0.600" in text  # missed: raw, weight, weighted
    assert "a remark" in text
    assert "weights [1.0, 1.0, 1.0, 0.3, 0.3, 1.0]" in text
    assert "strange 7.000" in text
    assert "2 missed" in text
    assert "11 21 0.100 paired" in text
    assert f"{UNDEFINED} 23 {UNDEFINED} false" in text


@pytest.mark.parametrize(
    "scores",
    [
        [make_score()],
        [make_score(f"a_search_with_a_name_that_does_not_want_to_end_{i}") for i in range(5)],
        [without_map(make_score()), without_path(make_score())],
        [without_anything(make_score())],
    ],
    ids=["one", "five with long names", "without map, without path", "without anything"],
)
def test_a_browser_shows_it_without_a_fault(
    browser: Browser, tmp_path: Path, scores: list[Score]
) -> None:
    written(tmp_path, *scores)
    assert faults(browser, tmp_path / "report.html") == []


def test_it_needs_nothing_else(tmp_path: Path) -> None:
    page = written(tmp_path, make_score(), make_score("fastslam"))
    assert not re.search(r"https?:|//[a-z]|<script|<link|<img|@import", page)
    assert 'name="viewport"' in page
    assert "prefers-color-scheme: dark" in page
    assert list(tmp_path.iterdir()) == [tmp_path / "report.html"]


def test_every_colour_that_is_used_is_defined(tmp_path: Path) -> None:
    page = written(tmp_path, make_score())
    used = set(re.findall(r"var\(--([a-z0-9]+)\)", page))
    defined = set(re.findall(r"--([a-z0-9]+):", page))
    assert used <= defined


def test_the_same_scores_give_the_same_bytes(tmp_path: Path) -> None:
    scores = (make_score(), make_score("fastslam", make_path(seed=2)))
    assert written(tmp_path, *scores) == written(tmp_path, *scores)


def test_two_long_estimates_stay_small(tmp_path: Path) -> None:
    scores = [make_score(f"run {k}", make_path(60_000, seed=k)) for k in (1, 2)]
    assert len(written(tmp_path, *scores)) < 500_000


@pytest.mark.parametrize("part", [without_path, without_map, without_anything])
def test_less_than_everything_is_shown_too(tmp_path: Path, part: object) -> None:
    assert callable(part)
    whole, less = make_score(), part(make_score("partial"))
    assert isinstance(less, Score)
    assert "partial" in written(tmp_path, less)
    both = text_of(written(tmp_path, whole, less))
    assert "Side by side" in both


def test_undefined_is_a_dash_and_never_zero(tmp_path: Path) -> None:
    text = text_of(written(tmp_path, without_anything(make_score())))
    assert f"{UNDEFINED} m, Total" in text
    assert "0.000" not in text.split("aligned by")[0]


def test_a_path_in_space_is_seen_from_above(tmp_path: Path) -> None:
    score = without_map(make_score("flight", make_path(space=True)))
    page = written(tmp_path, score)
    assert "Path and landmarks of flight from above" in page
    assert "Track error" not in page
    assert "Heading error" not in page


def test_one_pose_and_an_empty_map_are_drawn(tmp_path: Path) -> None:
    path = make_path(n=1)
    nobody = LandmarkMap(np.empty(0, dtype=np.int64), np.empty((0, 2)))
    empty = MapErrors(nobody, nobody, np.empty((0, 2), dtype=np.int64), np.empty(0), 0.3)
    assert "<svg" in written(tmp_path, replace(make_score(path=path), map=empty))


def test_names_are_escaped(tmp_path: Path) -> None:
    score = make_score("<script>alert(1)</script> & co")
    page = written(tmp_path, score, make_score(), title="<b>bold</b>")
    assert "<script" not in page
    assert "&lt;b&gt;bold" in page


def test_side_by_side_marks_the_best(tmp_path: Path) -> None:
    better = replace(make_score("better"), total=0.5)
    page = written(tmp_path, make_score(), better)
    assert re.search(r'class="right best">0\.500<', page)
    assert not re.search(r'class="right best">1\.234<', page)


def test_a_total_without_a_part_is_not_called_better(tmp_path: Path) -> None:
    less = replace(without_map(make_score("path only")), total=0.321)
    page = written(tmp_path, make_score(), less)
    assert not re.search(r'best">0\.321<', page)
    assert "do not compare" in page


def test_equal_names_are_told_apart(tmp_path: Path) -> None:
    page = written(tmp_path, make_score(), make_score())
    assert "ekf (1)" in page
    assert "ekf (2)" in page


def test_a_report_replaces_the_old_one_whole(tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("old")
    assert "old</" not in written(tmp_path, make_score())


def test_no_score_is_an_error_and_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least one score"):
        write_report(tmp_path / "report.html", [], "none")
    assert list(tmp_path.iterdir()) == []
