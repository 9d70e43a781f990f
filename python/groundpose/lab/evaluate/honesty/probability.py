"""The probability that an answer is right: its model, the least one that is kept, and how true it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.keypoints.certainty import Certainty
from groundpose.keypoints.decode import logistic_regression
from groundpose.lab.evaluate.honesty.answers import Answers, Mask

MOST_BACKGROUND = 0.005
"""Fraction of the places without a vehicle that may be called right, of those of a fit."""
LEAST_KEPT = 0.97
"""Fraction of the right answers to well visible vehicles that must be kept, of those of a fit."""
EDGES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
"""Of the bins of probabilities."""
FEWEST_OF_BIN = 50
AMBIGUITY_EDGES = (0.0, 0.02, 0.1, 0.2, 0.4, 1.0)


def probability(certainty: Certainty, answers: Answers) -> FloatArray:
    """(N,) that the answers are right, as the solver says with a fitted certainty; 0 without an answer."""
    assert certainty.probability_coefficients is not None
    logit = _features(answers) @ np.array(certainty.probability_coefficients)
    return np.where(answers.ok, 0.5 * (1.0 + np.tanh(0.5 * logit)), 0.0)


def coefficients(answers: Answers) -> tuple[float, ...]:
    """Of the logistic regression of `right` on the evidence, over vehicles and places without one."""
    found = answers.only(answers.ok)
    return tuple(logistic_regression(_features(found), found.right))


def least(probabilities: FloatArray, answers: Answers) -> float:
    """The least probability that is kept.

    The lowest one that lets no more of the background pass than `MOST_BACKGROUND`, so that hidden and cut
    vehicles keep their answers, but never one that keeps less than `LEAST_KEPT`.
    `probabilities` are 0 for what the network calls no vehicle.
    """
    background = probabilities[~answers.vehicles]
    right = probabilities[answers.well_visible & answers.right]
    rejects = (
        float(np.quantile(background, 1.0 - MOST_BACKGROUND, method="higher")) if len(background) else 0.0
    )
    keeps = float(np.quantile(right, 1.0 - LEAST_KEPT, method="lower"))
    return min(math.nextafter(rejects, 1.0), keeps)


def auc(scores: FloatArray, good: Mask) -> float | None:
    """Probability that a good one has the higher score of a good and a bad one; None without both."""
    hits = int(good.sum())
    pairs = hits * (len(good) - hits)
    if pairs == 0:
        return None
    _, where, counts = np.unique(scores, return_inverse=True, return_counts=True)
    ranks = (np.cumsum(counts) - 0.5 * (counts - 1))[where]
    return float((ranks[good].sum() - 0.5 * hits * (hits + 1)) / pairs)


def reliability(stated: FloatArray, true: Mask, edges: Sequence[float] = EDGES) -> dict[str, Any]:
    """Stated probabilities (N,) against what is true of them.

    Returns:
        `bins`: mean stated, fraction true and number of each bin that has any; `calibration_error`: mean
        distance of the first two over all; `worst_factor`: the largest ratio of the two, of bins of
        `FEWEST_OF_BIN` or more, half a true one added to each; `auc`.
    """
    at = np.clip(np.digitize(stated, edges) - 1, 0, len(edges) - 2)
    bins = [
        [float(stated[at == b].mean()), float(true[at == b].mean()), int((at == b).sum())]
        for b in np.unique(at)
    ]
    error = sum(abs(said - fraction) * count for said, fraction, count in bins) / max(len(stated), 1)
    factors = [
        math.exp(abs(math.log(said * count / (fraction * count + 0.5))))
        for said, fraction, count in bins
        if count >= FEWEST_OF_BIN
    ]
    return {
        "answers": len(stated),
        "calibration_error": error,
        "worst_factor": max(factors, default=None),
        "auc": auc(stated, true),
        "bins": bins,
    }


def _features(answers: Answers) -> NDArray[np.float64]:
    return np.concatenate([np.ones((len(answers), 1)), answers.evidence], axis=1)
