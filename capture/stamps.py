"""Times as integer nanoseconds and as the decimal seconds that text files hold, without rounding.

A float64 of seconds since 1970 is good to 0.2 microseconds only; so stamps never pass through one.
"""

from __future__ import annotations

from decimal import Decimal, InvalidOperation

NS_PER_S = 1_000_000_000
_MAX_NS = 2**63 - 1


def stamp_to_ns(text: str) -> int:
    """Nanoseconds from decimal seconds; digits beyond the ninth are rounded to the nearest.

    Raises `ValueError` when the text is no time that int64 nanoseconds can hold.
    """
    whole, _, fraction = text.partition(".")
    if len(fraction) <= 9 and len(whole) <= 9 + 1 and (whole + fraction).isdecimal():
        t_ns = int(whole + fraction.ljust(9, "0"))
    else:
        t_ns = _stamp_to_ns_slowly(text)
    if abs(t_ns) > _MAX_NS:
        raise ValueError(f"{text} s is beyond the years 1678 to 2262")
    return t_ns


def ns_to_stamp(t_ns: int) -> str:
    """Decimal seconds with nine decimals: the inverse of `stamp_to_ns`."""
    seconds, nanoseconds = divmod(abs(t_ns), NS_PER_S)
    return f"{'-' if t_ns < 0 else ''}{seconds}.{nanoseconds:09d}"


def _stamp_to_ns_slowly(text: str) -> int:
    """Signs, exponents and long fractions."""
    if "_" in text:
        raise ValueError(f"{text!r} is no number")
    try:
        return int((Decimal(text) * NS_PER_S).to_integral_value())
    except (InvalidOperation, ValueError, OverflowError):
        raise ValueError(f"{text!r} is no time in seconds") from None
