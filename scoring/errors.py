"""Why a score cannot be given."""

from __future__ import annotations

from dialogue import TracksideError


class ScoringError(TracksideError):
    """Root of this room's errors."""


class TooFewPosesError(ScoringError):
    """Path and truth share too few poses; the text holds both ranges and rates."""


class UndefinedScoreError(ScoringError):
    """A choice that these data cannot answer, such as aligning on a map without pairs."""
