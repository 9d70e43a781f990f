"""Errors of KITTI's own labels, allowed for where answers are compared with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.evaluate.honesty.answers import Answers
from groundpose.lab.evaluate.honesty.sources import MIRRORED

YAW_DEG, LEAN_DEG, PLACE_M = 1.0, 0.8, 0.05
"""Standard deviations: yaw and lean (labels are upright in the camera), degrees; place, metres."""


def allowed(answers: Answers) -> Answers:
    """Answers to the development frames with the labels' errors in their covariances.

    A shift of all labels to one side goes the other way in mirror images, a shift of the network does not:
    half of their difference is taken out of the truth.
    """
    turn, place = (np.radians([LEAN_DEG, YAW_DEG, LEAN_DEG]), [PLACE_M] * 3)
    labels = np.diag(np.concatenate([turn, place]) ** 2)
    seen = answers.seen.copy()
    seen["t"][:, 0] -= _shift(answers) * _side(answers)
    return replace(answers, seen=seen, covariance=answers.covariance + labels)


def _side(answers: Answers) -> FloatArray:
    """(N,): 1 in frames, -1 in their mirror images."""
    return np.where(answers.seen["kind"] == MIRRORED, -1.0, 1.0)


def _shift(answers: Answers) -> float:
    """Metres to the right; 0 without mirror images."""
    side, right = _side(answers), answers.right
    off = answers.seen["t"][:, 0] - answers.t[:, 0]
    sides = [off[right & (side == s)] for s in (1.0, -1.0)]
    return float(0.5 * (np.median(sides[0]) - np.median(sides[1]))) if min(map(len, sides)) else 0.0
