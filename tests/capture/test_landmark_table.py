from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_session import START_NS, estimate, landmarks

from capture import (
    NO_STAMP,
    EstimatedMap,
    TextFileError,
    read_estimated_map,
    read_landmarks,
    read_path_covariance,
    write_estimated_map,
    write_landmarks,
    write_path_covariance,
)
from geometry import LandmarkMap


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "map.csv"
    file.write_text(text)
    return file


def test_landmarks_survive_to_the_last_bit(tmp_path: Path) -> None:
    before = landmarks()
    write_landmarks(tmp_path / "a.csv", before)
    after = read_landmarks(tmp_path / "a.csv")
    write_landmarks(tmp_path / "b.csv", after)
    np.testing.assert_array_equal(after.ids, before.ids)
    np.testing.assert_array_equal(after.positions, before.positions)
    assert after.covariances is not None
    np.testing.assert_array_equal(after.covariances, before.covariances)
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_an_estimated_map_survives_with_its_unknowns(tmp_path: Path) -> None:
    before = EstimatedMap(
        landmarks(),
        t_added_ns=np.array([START_NS, NO_STAMP]),
        added_from=np.array([[np.nan, np.nan], [0.1, 0.2]]),
        range_added_m=np.array([np.nan, 1 / 3]),
        n_seen=np.array([NO_STAMP, 3]),
        t_first_ns=np.array([NO_STAMP, START_NS]),
    )
    write_estimated_map(tmp_path / "map.csv", before)
    after = read_estimated_map(tmp_path / "map.csv")
    for name in ("t_added_ns", "added_from", "range_added_m", "n_seen", "t_first_ns"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name), err_msg=name)
    header = (tmp_path / "map.csv").read_text().splitlines()[0]
    assert header == "id,x,y,sxx,sxy,syy,t_added,x_added,y_added,n_seen,range_added,t_first"


def test_only_the_place_is_required(tmp_path: Path) -> None:
    found = read_estimated_map(written(tmp_path, "# by hand\ncolour, y ,x,id\nred,2,1,4\n\n"))
    assert (found.landmarks.ids.tolist(), found.landmarks.positions.tolist()) == ([4], [[1, 2]])
    assert found.landmarks.covariances is None
    optional = ("t_added_ns", "added_from", "range_added_m", "n_seen", "t_first_ns")
    assert [getattr(found, name) for name in optional] == [None] * 5


def test_a_map_without_landmarks_is_a_map(tmp_path: Path) -> None:
    write_estimated_map(
        tmp_path / "map.csv", EstimatedMap(LandmarkMap(np.array([]), np.zeros((0, 2))))
    )
    assert len(read_estimated_map(tmp_path / "map.csv")) == 0


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["map.csv: is empty", "expected a header with the columns id,x,y"]),
        ("1,2,3\n", ["map.csv:1: no column id, x, y in '1,2,3'", "expected a header"]),
        ("id,x,y\n1,2\n", ["map.csv:2: 2 cells; expected 3 (id,x,y)"]),
        ("id,x,y\n1,2,3\n2,0,0\n1,4,4\n", ["map.csv:4: id 1 stands in line 2 already", "delete"]),
        ("id,x,y\n1,a,3\n", ["map.csv:2: x: expected a number, found 'a'"]),
        ("id,x,y\n1,,3\n", ["map.csv:2: x: expected a number, found ''"]),
        ("id,x,y\n1.5,2,3\n", ["map.csv:2: id: expected an integer, found '1.5'"]),
        ("id,x,y\n1,2,3\n2,nan,3\n", ["map.csv:3: the position of landmark 2 is not finite"]),
        ("id,x,y,t_added\n1,2,3,soon\n", ["map.csv:2: t_added: expected a time in seconds"]),
        (
            "id,x,y,sxx,sxy,syy\n1,2,3,1,0,1\n2,2,3,,,\n",
            ["map.csv:3: no covariance, while other landmarks have one"],
        ),
        (
            "id,x,y,sxx,sxy,syy\n9,2,3,1,5,1\n",
            ["map.csv: the covariance of landmark 9 is not a covariance matrix", "correct"],
        ),
    ],
)
def test_a_malformed_table_is_refused_with_place_and_remedy(
    tmp_path: Path, text: str, parts: list[str]
) -> None:
    with pytest.raises(TextFileError) as caught:
        read_estimated_map(written(tmp_path, text))
    assert [part for part in parts if part not in str(caught.value)] == []


def test_path_covariances_survive_to_the_last_bit(tmp_path: Path) -> None:
    made = estimate()
    assert made.path_covariances is not None
    write_path_covariance(tmp_path / "c.csv", made.path.t_ns, made.path_covariances)
    t_ns, covariances = read_path_covariance(tmp_path / "c.csv")
    np.testing.assert_array_equal(t_ns, made.path.t_ns)
    np.testing.assert_array_equal(covariances, made.path_covariances)
