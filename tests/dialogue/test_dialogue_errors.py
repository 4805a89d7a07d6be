"""The root of the error tree and the hints in its texts."""

from __future__ import annotations

import pytest

from dialogue import TracksideError, UsageError, nearest_names

ALGORITHMS = ("fastslam", "ekf", "graph")


def test_a_misspelt_name_is_put_right() -> None:
    assert nearest_names("fastslm", ALGORITHMS) == "did you mean 'fastslam'?"


def test_the_nearest_of_several_is_named() -> None:
    assert (
        nearest_names("max_gap", ["max_lag_s", "max_gap_s", "map"]) == "did you mean 'max_gap_s'?"
    )


def test_a_name_far_from_all_gets_them_all_in_order() -> None:
    assert nearest_names("zzz", iter(ALGORITHMS)) == "valid names: ekf, fastslam, graph"


def test_a_wrong_call_is_caught_with_all_known_errors() -> None:
    with pytest.raises(TracksideError, match="--cutoff must be positive"):
        raise UsageError("--cutoff must be positive")
