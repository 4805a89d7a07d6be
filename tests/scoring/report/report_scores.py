"""Scores made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from geometry import Floats, LandmarkMap
from scoring import ERROR_NAMES, Alignment, MapErrors, PathErrors, Score

START_NS = 1_700_000_000_000_000_000
CUTOFF_M = 0.3


def make_path(
    n: int = 400, noise_m: float = 0.02, seed: int = 1, space: bool = False
) -> PathErrors:
    rng = np.random.default_rng(seed)
    phase = np.linspace(0.0, 2.0 * np.pi, n)
    columns = [3.0 * np.sin(phase), np.sin(2.0 * phase)] + [0.2 * np.cos(phase)] * space
    truth = np.column_stack(columns)
    estimate = truth + rng.normal(0.0, noise_m, truth.shape)
    error = estimate - truth
    nothing = np.full(n, np.nan)
    return PathErrors(
        t_ns=START_NS + 20_000_000 * np.arange(n),
        truth=truth,
        estimate=estimate,
        position_m=np.linalg.norm(error, axis=1),
        along_m=nothing if space else error[:, 0],
        cross_m=nothing if space else error[:, 1],
        heading_rad=nothing if space else rng.normal(0.0, 0.02, n),
    )


def make_map() -> MapErrors:
    """Four true landmarks, three estimated: two pairs, two missed, one false."""
    truth = LandmarkMap(np.arange(11, 15), np.array([[3.0, 0], [-3.0, 0], [0.0, 1.5], [0, -1.5]]))
    estimate = LandmarkMap(np.arange(21, 24), np.array([[3.1, 0.0], [-2.9, 0.1], [1.0, 0.9]]))
    pairs = np.array([[0, 0], [1, 1]])
    return MapErrors(truth, estimate, pairs, np.array([0.1, 0.1414]), CUTOFF_M)


def make_score(name: str = "ekf", path: PathErrors | None = None) -> Score:
    """A complete score; the Total is 1.234."""
    path = path or make_path()
    errors: dict[str, float | None] = dict(
        zip(ERROR_NAMES, (0.1, 0.2, 0.12, 2.0, 1.0, 0.034), strict=True)
    )
    weighted = {**errors, "false_negatives": 0.6, "false_positives": 0.3}
    return Score(
        name=name,
        total=1.234,
        errors=errors,
        weighted=weighted,
        counts={"poses": 400, "coverage": 0.975, "pairs": 2}
        | {"landmarks_true": 4, "landmarks_estimated": 3},
        metrics={"ate_rmse": 0.11, "ate_mean": 0.1, "ospa": None, "recall": 0.5, "strange": 7.0},
        alignment=Alignment("origin", 0.5, -0.25, 0.01),
        choices={"weights": [1.0, 1.0, 1.0, 0.3, 0.3, 1.0], "total_formula": "eq-3.1"}
        | {"pairing": "saturated"},
        remarks=("a remark",),
        path=path,
        map=make_map(),
        true_path=path.truth,
    )


def without_path(score: Score) -> Score:
    return replace(score, path=None, true_path=None)


def without_map(score: Score) -> Score:
    counts = {"poses": score.counts["poses"], "coverage": score.counts["coverage"]}
    landmark_errors = dict.fromkeys(ERROR_NAMES[2:])
    return replace(
        score,
        map=None,
        counts=counts,
        errors={**score.errors, **landmark_errors},
        weighted={**score.weighted, **landmark_errors},
    )


def without_anything(score: Score) -> Score:
    nothing = dict.fromkeys(ERROR_NAMES)
    return replace(
        without_path(without_map(score)),
        total=None,
        errors=nothing,
        weighted=nothing,
        counts={},
        metrics={},
        choices={},
        remarks=(),
    )


def circle(n: int) -> Floats:
    angle = np.linspace(0.0, 2.0 * np.pi, n)
    return np.column_stack([np.cos(angle), np.sin(angle)])
