"""The numbers of `Certainty` for a network, from its answers to crops whose truth is known."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np

from groundpose import region_radius2
from groundpose._checks import input_error
from groundpose.keypoints.certainty import Certainty
from groundpose.keypoints.decode import logistic_regression
from groundpose.lab.evaluate.honesty.answers import FLIP_DEG, Answers, Mask
from groundpose.lab.evaluate.honesty.coverage import WINDOWS
from groundpose.lab.evaluate.honesty.probability import coefficients, least, probability

FACTORS = np.geomspace(1.0, 64.0, 25)
SHIFTS = (0.0, 0.0025, 0.005, 0.0075, 0.01, 0.015)
TURNS_DEG = (0.0, 0.5, 0.75, 1.0, 1.25, 1.5)
DOFS = (3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 12.0, 20.0)
"""Values of error factor, shift, turn and degrees of freedom that are tried."""
GOOD_ENOUGH = 0.75
"""How far from the middle of its window, in half windows, a fraction may be: of the numbers that come as near
as this the smallest regions are taken."""
FITTED = ("pose", "R", "t", "yaw", "lateral")
"""Quantities whose regions are fitted. Errors of the distance are mostly the vehicle's size: that part of the
covariance is the shape prior's, which no error of keypoints should make good."""
FEWEST = 100
"""Right answers that a fit needs."""
LARGEST = max(WINDOWS)
"""Level of the regions whose size counts."""
AMBIGUITY_LIMITS = (0.0001, 0.9999)
"""The core's, of what viewing angles say."""
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
    found = replace(
        covariance_numbers(answers.only(good)),
        probability_coefficients=tuple(_rounded(value) for value in coefficients(answers)),
    )
    kept = np.where(is_vehicle, probability(found, answers), 0.0)
    return replace(found, min_probability=_rounded(least(kept, answers)))


def covariance_numbers(right: Answers) -> Certainty:
    """Error factor, shift, turn and degrees of freedom whose regions hold the truth as often as wanted.

    Of all that bring each fraction inside, by `FITTED` and `WINDOWS`, as near to its window's middle as
    `GOOD_ENOUGH`, those with the smallest regions; where none do, those whose worst fraction is the nearest.

    The likelihood of Student's t decides by the many small errors and leaves the 95 % regions of the yaw 5 %
    short (factor 9, 8 degrees of freedom); what is promised is the regions.
    """
    best, found = (math.inf, math.inf), Certainty()
    for factor, shift, turn in itertools.product(FACTORS, SHIFTS, np.radians(TURNS_DEG)):
        stated = right.stated(float(factor), shift, float(turn))
        distances, sizes = stated.squared_distances(), stated.sizes()
        for dof in DOFS:
            worst = max(
                _off(d2 <= region_radius2(level, dimensions, dof), window)
                for dimensions, d2 in (distances[name] for name in FITTED)
                for level, window in WINDOWS.items()
            )
            size = sum(
                math.log(sizes[name]) + 0.5 * math.log(region_radius2(LARGEST, distances[name][0], dof))
                for name in FITTED
            )
            if (max(worst, GOOD_ENOUGH), size) < best:
                best = (max(worst, GOOD_ENOUGH), size)
                found = Certainty(_rounded(factor), dof, error_shift=shift, error_turn=_rounded(turn))
    return found


def ambiguity_coefficients(answers: Answers) -> tuple[float, float]:
    """Bias and slope of the logit of "turned by more than 90 degrees" against that of the ambiguity, of all
    vehicles with an answer."""
    found = answers.only(answers.ok & answers.vehicles)
    said = np.clip(found.ambiguity, *AMBIGUITY_LIMITS)
    line = np.stack([np.ones(len(said)), np.log(said / (1.0 - said))], axis=1)
    bias, slope = logistic_regression(line, found.yaw_error > FLIP_DEG)
    return _rounded(bias), _rounded(slope)


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
