"""Poses that a network gives for renders with a true view, their errors and the network's viewing angle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose import Options, ShapeModel, estimate_poses
from groundpose._checks import FloatArray
from groundpose.keypoints.decode import VIEWING_ANGLES
from groundpose.keypoints.network import VEHICLE_THRESHOLD, Network
from groundpose.lab.evaluate.networks.renders import Renders
from groundpose.lab.metrics import NO_ANSWER_E_R_DEG, rotation_error_deg, yaw_between_deg
from groundpose.lab.training.evaluate import Answers, answers
from groundpose.vehicles import CLASSES, keypoint_indices, shape_model

EVERY_ANSWER = Options(min_probability=0.0)
"""Networks are compared by all their answers; which of them are given is measured elsewhere."""
TURNED_DEG = 90.0
SAYS_TURNED = 0.2
"""Probability of the other half of the viewing angles from which the network disagrees with a pose."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Of N vehicles, each (N,): errors in degrees (180 without an answer), whether the class is right, the
    probability that the viewing angle lies in the half turned away from the pose's (NaN from a network
    without it), the probability of a vehicle."""

    rotation_error: FloatArray
    yaw_error: FloatArray
    class_right: NDArray[np.bool_]
    other_half: FloatArray
    vehicle: FloatArray

    def numbers(self) -> dict[str, Any]:
        """Their summary: angles in degrees, fractions from 0 to 1."""
        return {
            "vehicles": len(self.rotation_error),
            "median_e_r_deg": float(np.median(self.rotation_error)),
            "mean_e_r_deg": float(np.mean(self.rotation_error)),
            "yaw_above_30_deg": float(np.mean(self.yaw_error > 30.0)),
            "class_accuracy": float(np.mean(self.class_right)),
            "called_none": float(np.mean(self.vehicle < VEHICLE_THRESHOLD)),
        }

    def turned(self) -> dict[str, Any]:
        """How many poses are turned round, and what the viewing angle says of them and of the others; None
        where there is nothing to say it of."""
        turned = self.yaw_error > TURNED_DEG
        says = np.where(np.isnan(self.other_half), np.nan, self.other_half > SAYS_TURNED)
        return {
            "vehicles": len(turned),
            "turned": float(turned.mean()),
            "turned_count": int(turned.sum()),
            "turned_told": _mean(says[turned]),
            "right_told_turned": _mean(says[~turned]),
        }


def judge(network: Network, seen: Renders) -> Judged:
    """Every vehicle is given its true box and view; no box is taken for empty, so that poses are compared of
    the same vehicles whatever the network says."""
    found = answers(network.detect, seen.crops, network.codec)
    R = _poses(network, seen, found)
    missing = np.isnan(R).any(axis=(1, 2))
    error = np.where(missing, NO_ANSWER_E_R_DEG, rotation_error_deg(seen.R, R))
    yaw = yaw_between_deg(seen.R, R)  # the true vehicle's y axis is the ground's
    alpha = np.arctan2(R[:, 0, 2], R[:, 2, 2]) - 0.5 * np.pi - seen.direction
    detections = found.detections
    return Judged(
        error,
        np.where(missing, NO_ANSWER_E_R_DEG, yaw),
        detections.class_probabilities.argmax(axis=1) == found.labels["kind"],
        other_half(detections.viewing_angle, alpha),
        detections.vehicle,
    )


def other_half(probabilities: FloatArray, alpha: FloatArray) -> FloatArray:
    """(N,) probability that the viewing angle is more than 90 degrees from `alpha` (N,), radians."""
    centres = np.arange(VIEWING_ANGLES) * (2.0 * np.pi / VIEWING_ANGLES)
    away = np.cos(centres - alpha[:, None]) < 0.0
    return np.asarray(np.where(away, probabilities, 0.0).sum(axis=1) + 0.0 * probabilities.sum(axis=1))


def _poses(network: Network, seen: Renders, found: Answers) -> FloatArray:
    """R (N, 3, 3), NaN without an answer, with the class found."""
    given = _given(network, found)
    R = np.full((len(seen.R), 3, 3), np.nan)
    for view, rows in zip(seen.views, seen.rows, strict=True):
        poses = estimate_poses(view, *given(rows), EVERY_ANSWER, threads=1)
        R[rows[poses.ok]] = poses.R[poses.ok]
    return R


Given = Callable[[NDArray[np.intp]], tuple[list[FloatArray], FloatArray, list[ShapeModel], list[FloatArray]]]
"""Of rows of renders: keypoints, boxes, models and scores for `estimate_poses`."""


def found_by(network: Network, seen: Renders) -> Given:
    """What a network says of renders, every vehicle with its true box."""
    return _given(network, answers(network.detect, seen.crops, network.codec))


def _given(network: Network, found: Answers) -> Given:
    points = network.codec.image_from_crop(found.detections.keypoints, found.windows)
    scores = network.calibration.scores(found.detections, found.sides_in_crop)
    classes = [CLASSES[i] for i in found.detections.class_probabilities.argmax(axis=1)]
    own = [keypoint_indices(class_name) for class_name in classes]
    boxes = found.labels["box"].astype(np.float64)
    return lambda rows: (
        [points[i, own[i]] for i in rows],
        boxes[rows],
        [shape_model(classes[i]) for i in rows],
        [scores[i, own[i]] for i in rows],
    )


def _mean(values: FloatArray) -> float | None:
    return float(values.mean()) if len(values) and not np.isnan(values).any() else None
