"""How often stated regions hold the truth, and how much larger than the errors they are."""

from __future__ import annotations

from typing import Any

import numpy as np

from groundpose import region_radius2
from groundpose._checks import FloatArray
from groundpose.lab.evaluate.honesty.answers import Answers

WINDOWS = {0.5: (0.45, 0.65), 0.9: (0.87, 0.95), 0.95: (0.93, 0.98)}
"""Levels, and between which fractions of the truth their regions are to hold: they lean to the safe side."""
LEVELS = (0.1, 0.25, *WINDOWS, 0.75, 0.99)
QUANTITIES = ("pose", "R", "t", "yaw", "distance", "lateral")
"""All six degrees of freedom; rotation; translation; about the ground's normal; along the ray; across it."""
_MAD = 1.4826
"""From the median absolute deviation of a Gaussian to its standard deviation."""


def directions(answers: Answers) -> dict[str, FloatArray]:
    """(N, d, 6): what of an error each of `QUANTITIES` looks at."""
    count = len(answers)
    ray = answers.t / np.linalg.norm(answers.t, axis=1, keepdims=True)
    across = np.cross(answers.up, ray)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    whole = np.broadcast_to(np.eye(6), (count, 6, 6))
    none = np.zeros((count, 3))

    def row(turn: FloatArray, move: FloatArray) -> FloatArray:
        return np.concatenate([turn, move], axis=1)[:, None]

    parts = (whole, whole[:, :3], whole[:, 3:], row(answers.up, none), row(none, ray), row(none, across))
    return dict(zip(QUANTITIES, parts, strict=True))


def covariances(answers: Answers, factor: float) -> FloatArray:
    """(N, 6, 6) for keypoint errors with this factor (`Options.keypoint_error_factor`)."""
    return np.asarray(answers.covariance + (factor - 1.0) * answers.growth)


def squared_distances(errors: FloatArray, covariance: FloatArray, looked_at: FloatArray) -> FloatArray:
    """(N,) squared Mahalanobis distances of errors (N, 6) in the directions (N, d, 6)."""
    error = np.einsum("ndj,nj->nd", looked_at, errors)
    own = looked_at @ covariance @ np.swapaxes(looked_at, 1, 2)
    return np.asarray(np.einsum("nd,nd->n", error, np.linalg.solve(own, error[..., None])[..., 0]))


def inside(
    answers: Answers, factor: float, dof: float | None, errors: FloatArray | None = None
) -> dict[str, dict[str, float]]:
    """`{quantity: {level in %: percentage of the true values inside}}` of answers that have a truth.

    `factor`, `dof`: of the keypoint errors, see `Options`; `errors`: (N, 6) instead of the answers' own.
    """
    covariance = covariances(answers, factor)
    given = answers.errors if errors is None else errors
    found: dict[str, dict[str, float]] = {}
    for name, looked_at in directions(answers).items():
        d2 = squared_distances(given, covariance, looked_at)
        found[name] = {
            f"{100 * level:g}": float(100 * np.mean(d2 <= region_radius2(level, looked_at.shape[1], dof)))
            for level in LEVELS
        }
    return found


def sharpness(answers: Answers, factor: float) -> dict[str, Any]:
    """Median stated standard deviation over the errors' robust one, by quantity of one dimension."""
    covariance = covariances(answers, factor)
    found = {}
    for name, looked_at in directions(answers).items():
        if looked_at.shape[1] == 1:
            error = np.einsum("ndj,nj->n", looked_at, answers.errors)
            stated = np.sqrt((looked_at @ covariance @ np.swapaxes(looked_at, 1, 2))[:, 0, 0])
            actual = _MAD * np.median(np.abs(error - np.median(error)))
            found[name] = float(np.median(stated) / actual)
    return found
