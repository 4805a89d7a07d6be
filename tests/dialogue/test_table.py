"""One table in five formats."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dialogue import TABLE_FORMATS, Cell, Table, UsageError

SCORES = Table(
    columns=("name", "pose [m]", "poses"),
    rows=(("ekf_1", 0.123456789, 1200), ("graph", None, 7), ("odometry", math.nan, -3)),
    title="Scores",
    note="aligned on the path",
)

texts = st.text(st.characters(codec="utf-8", exclude_characters="\r\0"), max_size=9)
cells: st.SearchStrategy[Cell] = st.none() | st.integers() | st.floats() | texts


@st.composite
def tables(draw: st.DrawFn) -> Table:
    columns = draw(st.lists(texts, min_size=1, max_size=4, unique=True))
    row = st.tuples(*[cells] * len(columns))
    return Table(tuple(columns), tuple(draw(st.lists(row, max_size=4))))


def lines(*texts: str) -> str:
    return "\n".join(texts)


def test_plain() -> None:
    assert SCORES.render("table") == lines(
        "Scores",
        "name      pose [m]  poses",
        "--------  --------  -----",
        "ekf_1        0.123   1200",
        "graph            -      7",
        "odometry         -     -3",
        "aligned on the path",
    )


def test_markdown() -> None:
    assert SCORES.render("md") == lines(
        "**Scores**",
        "",
        "| name | pose [m] | poses |",
        "| --- | ---: | ---: |",
        "| ekf_1 | 0.123 | 1200 |",
        "| graph | - | 7 |",
        "| odometry | - | -3 |",
        "",
        "aligned on the path",
    )


def test_latex() -> None:
    assert SCORES.render("latex") == lines(
        r"\begin{tabular}{lrr}",
        r"\hline",
        r"name & pose [m] & poses \\",
        r"\hline",
        r"ekf\_1 & 0.123 & 1200 \\",
        r"graph & - & 7 \\",
        r"odometry & - & -3 \\",
        r"\hline",
        r"\end{tabular}",
    )


def test_csv_keeps_every_digit_and_leaves_undefined_cells_empty() -> None:
    assert SCORES.render("csv") == lines(
        "name,pose [m],poses", "ekf_1,0.123456789,1200", "graph,,7", "odometry,nan,-3"
    )


def test_json_keeps_every_digit_and_has_null_for_what_it_cannot_say() -> None:
    assert json.loads(SCORES.render("json")) == {
        "title": "Scores",
        "note": "aligned on the path",
        "rows": [
            {"name": "ekf_1", "pose [m]": 0.123456789, "poses": 1200},
            {"name": "graph", "pose [m]": None, "poses": 7},
            {"name": "odometry", "pose [m]": None, "poses": -3},
        ],
    }


def test_infinity_is_seen_by_the_eye_and_null_in_json() -> None:
    endless = Table(("x",), ((math.inf,),))
    assert endless.render("table").endswith("inf")
    assert json.loads(endless.render("json"))["rows"] == [{"x": None}]


def test_numbers_of_numpy_are_numbers() -> None:
    table = Table(("x",), ((np.float64(0.1),),), digits=1)
    assert table.render("csv") == "x\n0.1"
    assert json.loads(table.render("json"))["rows"] == [{"x": 0.1}]


def test_digits_are_for_the_eye_only() -> None:
    coarse = Table(("x",), ((2.0 / 3.0,),), digits=1)
    assert coarse.render("table") == "  x\n---\n0.7"
    assert coarse.render("csv") == "x\n0.6666666666666666"


def test_a_column_with_one_word_is_set_left() -> None:
    assert Table(("x",), ((1,), ("many",))).render("table") == "x\n----\n1\nmany"


@pytest.mark.parametrize("table_format", TABLE_FORMATS)
def test_a_table_without_rows_is_its_head(table_format: str) -> None:
    text = Table(("a", "b"), ()).render(table_format)
    if table_format == "json":
        assert json.loads(text)["rows"] == []
    else:
        assert "a" in text
        assert "b" in text


def test_a_bar_does_not_split_a_markdown_cell() -> None:
    assert Table(("|x|",), (("a|b",),)).render("md") == "| \\|x\\| |\n| --- |\n| a\\|b |"


def test_latex_marks_are_escaped_once() -> None:
    marks = Table(("100%",), ((r"a_b & {c} #1 $2 x^2 ~ \d",),)).render("latex")
    assert r"100\% \\" in marks
    assert (
        r"a\_b \& \{c\} \#1 \$2 x\textasciicircum{}2 \textasciitilde{} \textbackslash{}d \\"
        in marks
    )


@given(tables())
def test_csv_is_read_back(table: Table) -> None:
    records = list(csv.reader(io.StringIO(table.render("csv"), newline="")))
    expected = [["" if cell is None else str(cell) for cell in row] for row in table.rows]
    assert records == [list(table.columns), *expected]


@given(tables())
def test_json_is_read_back(table: Table) -> None:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    records = json.loads(table.render("json"), parse_constant=refuse)["rows"]
    for record, row in zip(records, table.rows, strict=True):
        finite = [None if isinstance(c, float) and not math.isfinite(c) else c for c in row]
        assert record == dict(zip(table.columns, finite, strict=True))


def test_another_format_is_refused_with_those_there_are() -> None:
    with pytest.raises(UsageError, match=r"no table format 'jsn'; did you mean 'json'\?"):
        SCORES.render("jsn")
    with pytest.raises(UsageError, match="valid names: csv, json, latex, md, table"):
        SCORES.render("yaml?")


def test_a_row_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"row \(1,\) does not fit the columns \('a', 'b'\)"):
        Table(("a", "b"), ((1, 2), (1,)))


def test_two_columns_of_one_name_would_be_one_in_json() -> None:
    with pytest.raises(ValueError, match="two columns of one name"):
        Table(("a", "a"), ())


def test_a_table_does_not_change() -> None:
    with pytest.raises(FrozenInstanceError):
        SCORES.title = "Other"  # type: ignore[misc]  # that it cannot be is what is tested
