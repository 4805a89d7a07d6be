"""Estimate + truth -> score: the multi-error function of the thesis and its neighbours.

Knows nothing of algorithms: an estimate is a path, a map and their provenance, from wherever.
"""

from scoring.errors import ScoringError, TooFewPosesError, UndefinedScoreError
from scoring.options import PRESETS, ScoreOptions
from scoring.result import (
    ERROR_NAMES,
    ERROR_UNITS,
    Alignment,
    MapErrors,
    PathErrors,
    Score,
    to_json,
)
from scoring.score import METRIC_NAMES, score, score_space

__all__ = [
    "ERROR_NAMES",
    "ERROR_UNITS",
    "METRIC_NAMES",
    "PRESETS",
    "Alignment",
    "MapErrors",
    "PathErrors",
    "Score",
    "ScoreOptions",
    "ScoringError",
    "TooFewPosesError",
    "UndefinedScoreError",
    "score",
    "score_space",
    "to_json",
]
