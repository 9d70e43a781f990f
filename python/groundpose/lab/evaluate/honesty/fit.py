"""The numbers of `Certainty` for a network, from its answers to crops whose truth is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from groundpose import region_radius2
from groundpose._checks import input_error
from groundpose.keypoints.certainty import Certainty
from groundpose.lab.evaluate.honesty.answers import Answers, Mask
from groundpose.lab.evaluate.honesty.coverage import WINDOWS
from groundpose.lab.evaluate.honesty.probability import coefficients, least, probability

FACTORS = np.geomspace(1.0, 100.0, 95)
DOFS = (3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 12.0, 20.0)
"""Values of error factor and degrees of freedom that are tried."""
FITTED = ("pose", "R", "t", "yaw", "lateral")
"""Quantities whose regions are fitted. Errors of the distance are mostly the vehicle's size: that part of the
covariance is the shape prior's, which no error of keypoints should make good."""
FEWEST = 100
"""Right answers that a fit needs."""
_DIGITS = 4


def fit(answers: Answers, is_vehicle: Mask) -> Certainty:
    """Fit all numbers.

    Args:
        answers: of vehicles and places without one. is_vehicle: (N,) what the network takes for a vehicle.

    Raises:
        InputError: too few right answers, or no place without a vehicle.
    """
    good = answers.well_visible & answers.right
    if good.sum() < FEWEST or answers.vehicles.all():
        expected = f"{FEWEST} right answers or more, and places without a vehicle"
        got = f"{int(good.sum())} and {int((~answers.vehicles).sum())}"
        raise input_error("crops", expected, got)
    factor, dof = covariance_numbers(answers.only(good))
    found = Certainty(_rounded(factor), dof, tuple(_rounded(value) for value in coefficients(answers)))
    kept = np.where(is_vehicle, probability(found, answers), 0.0)
    return replace(found, min_probability=_rounded(least(kept, answers)))


def covariance_numbers(right: Answers) -> tuple[float, float]:
    """Error factor and degrees of freedom whose regions of right answers hold the truth as often as wanted.

    Of the fractions inside, by `FITTED` and `WINDOWS`, the one furthest from its window's middle is as near
    as can be.

    The likelihood of Student's t decides by the many small errors and leaves the 95 % regions of the yaw 5 %
    short (factor 9, 8 degrees of freedom); what is promised is the regions.
    """
    best = (math.inf, 1.0, DOFS[0])
    for factor in FACTORS:
        distances = right.stated(float(factor)).squared_distances()
        for dof in DOFS:
            worst = max(
                _off(d2 <= region_radius2(level, dimensions, dof), window)
                for dimensions, d2 in (distances[name] for name in FITTED)
                for level, window in WINDOWS.items()
            )
            best = min(best, (worst, float(factor), dof))
    return best[1], best[2]


def _off(inside: Mask, window: tuple[float, float]) -> float:
    """Distance of a fraction inside from the middle of a window, in half windows, by logits."""
    count = len(inside)
    fraction = np.clip(inside.mean(), 0.5 / count, 1.0 - 0.5 / count)
    low, high = (_logit(limit) for limit in window)
    return abs(2.0 * _logit(fraction) - low - high) / (high - low)


def _logit(p: float) -> float:
    return math.log(p / (1.0 - p))


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
