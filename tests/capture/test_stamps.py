from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from capture import ns_to_stamp, stamp_to_ns


@given(st.integers(-(2**63) + 1, 2**63 - 1))
def test_every_nanosecond_survives_the_way_through_text(t_ns: int) -> None:
    assert stamp_to_ns(ns_to_stamp(t_ns)) == t_ns


@pytest.mark.parametrize(
    ("text", "t_ns"),
    [
        ("1305031098.6659", 1_305_031_098_665_900_000),
        ("1700000000.123456789", 1_700_000_000_123_456_789),
        ("0.1234567894", 123_456_789),
        ("0.1234567896", 123_456_790),
        ("1.5e3", 1_500_000_000_000),
        ("1.305031098665900000e+09", 1_305_031_098_665_900_000),
        ("-0.5", -500_000_000),
        ("+2", 2_000_000_000),
        (".25", 250_000_000),
        ("3.", 3_000_000_000),
    ],
)
def test_stamps_are_exact(text: str, t_ns: int) -> None:
    assert stamp_to_ns(text) == t_ns


@pytest.mark.parametrize(
    "text", ["", ".", "nan", "inf", "1_000", "0x10", "1403636579763555584", "²"]
)
def test_what_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"no (time|number)|beyond"):
        stamp_to_ns(text)
