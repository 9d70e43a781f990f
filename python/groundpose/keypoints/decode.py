"""What the network says of crops, and how far each keypoint can be trusted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from groundpose._checks import FloatArray

VIEWING_ANGLES = 16
"""Bins of the viewing angle alpha; bin b is centred on b * 2 pi / 16 (22.5 degrees apart)."""


@dataclass(frozen=True, eq=False)
class Detections:
    """The network's answer for N crops; K keypoints (`KEYPOINTS`), C classes (`CLASSES`).

    Attributes:
        keypoints: (N, K, 2) crop pixels; those of other classes are meaningless.
        spread: (N, K) crop pixels, standard deviation of the heat map read as a distribution.
        peak: (N, K) its largest cell, 0 to 1.
        class_probabilities: (N, C), sum 1: of the classes, given that the crop shows a vehicle.
        vehicle: (N,) probability that it does.
        viewing_angle: (N, `VIEWING_ANGLES`), sum 1: of the bins of alpha as KITTI has it.
    """

    keypoints: FloatArray
    spread: FloatArray
    peak: FloatArray
    class_probabilities: FloatArray
    vehicle: FloatArray
    viewing_angle: FloatArray

    @classmethod
    def of(
        cls,
        keypoints: ArrayLike,
        spread: ArrayLike,
        peak: ArrayLike,
        class_probabilities: ArrayLike,
        vehicle: ArrayLike | None = None,
        viewing_angle: ArrayLike | None = None,
    ) -> Detections:
        """From what a network gives. One without the last two outputs takes every crop for a vehicle (1) and
        says nothing of the viewing angle (NaN)."""
        count = len(np.asarray(keypoints))
        arrays = (
            *(keypoints, spread, peak, class_probabilities),
            np.ones(count) if vehicle is None else vehicle,
            np.full((count, VIEWING_ANGLES), np.nan) if viewing_angle is None else viewing_angle,
        )
        with np.errstate(invalid="ignore"):  # what is no number in a damaged network's answer stays none
            return cls(*(np.asarray(array, dtype=np.float64) for array in arrays))


@dataclass(frozen=True)
class Calibration:
    """From spread and peak of a heat map to a score: the probability of an error below 0.0375 of the box's
    longer side, `1 / (1 + exp(-(bias + spread * log(spread / side) + peak * log(peak))))`.

    A keypoint that the network states outside the crop has no heat map (peak 1): for it the exponent is
    `outside_bias + outside_spread * log(spread / side)`.
    """

    bias: float = -6.0
    spread: float = -2.0
    peak: float = 0.0
    outside_bias: float = -8.0
    outside_spread: float = -2.0

    def scores(self, detections: Detections, sides: FloatArray) -> FloatArray:
        """Scores (N, K), 0 to 1, for boxes whose longer sides (N,) are given in crop pixels."""
        features = _features(detections, sides)
        inside = features @ np.array([self.bias, self.spread, self.peak])
        outside = self.outside_bias + self.outside_spread * features[..., 1]
        logit = np.where(detections.peak >= 1.0, outside, inside)
        return np.asarray(0.5 * (1.0 + np.tanh(0.5 * logit)))

    @classmethod
    def fit(
        cls, detections: Detections, sides: FloatArray, good: NDArray[np.bool_], own: NDArray[np.bool_]
    ) -> Calibration:
        """Logistic regressions of `good` (N, K) on the keypoints `own` (N, K), in the crop and outside."""
        features, outside = _features(detections, sides), own & (detections.peak >= 1.0)
        within = own & ~outside
        beyond = logistic_regression(features[outside][:, :2], good[outside]) if outside.any() else []
        return cls(*logistic_regression(features[within], good[within]), *beyond)

    @classmethod
    def of(cls, numbers: Sequence[float]) -> Calibration:
        """From its five numbers, or from the first three, of files that state nothing outside the crop."""
        bias, spread, peak, *outside = (float(number) for number in numbers)
        return cls(bias, spread, peak, *(outside or (bias, spread)))

    @property
    def numbers(self) -> tuple[float, ...]:
        """The five, for `of`."""
        return self.bias, self.spread, self.peak, self.outside_bias, self.outside_spread


def logistic_regression(x: FloatArray, good: NDArray[np.bool_]) -> list[float]:
    """Logistic regression of `good` (M,) on features (M, F), by Newton's method."""
    y = good.astype(np.float64)
    theta, ridge = np.zeros(x.shape[1]), 1e-3 * np.eye(x.shape[1])
    for _ in range(50):
        p = 0.5 * (1.0 + np.tanh(0.5 * (x @ theta)))
        hessian = (x * (p * (1.0 - p))[:, None]).T @ x + ridge
        step = np.linalg.solve(hessian, x.T @ (y - p) - ridge @ theta)
        theta = theta + step * min(1.0, 2.0 / np.abs(step).max(initial=1e-12))
        if np.abs(step).max() < 1e-9:
            break
    found: list[float] = theta.tolist()
    return found


def _features(detections: Detections, sides: FloatArray) -> FloatArray:
    """(N, K, 3): 1, log of the spread as a fraction of the box, log of the peak."""
    spread = np.log(np.maximum(detections.spread / sides[:, None], 1e-6))
    peak = np.log(np.maximum(detections.peak, 1e-9))
    return np.stack([np.ones_like(spread), spread, peak], axis=-1)
