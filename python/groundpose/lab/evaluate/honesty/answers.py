"""The solver's answers for what a network saw, and their errors in the solver's own units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose import Options, estimate_poses
from groundpose._checks import FloatArray
from groundpose.lab.evaluate.honesty.coverage import Stated, errors
from groundpose.lab.evaluate.honesty.seen import Records, by_view, view_of
from groundpose.lab.metrics import yaw_between_deg
from groundpose.lab.training.crops import NOTHING
from groundpose.vehicles import CLASSES, keypoint_indices, shape_model

FLIP_DEG = 90.0
"""From here on a yaw is that of the other reading."""
RIGHT_YAW_DEG, RIGHT_DISTANCE = 15.0, 0.15
"""Limits of a right answer: degrees of yaw, and a fraction of the true distance."""
MOST_HIDDEN, MOST_CUT, LEAST_HEIGHT = 0.5, 0.15, 25.0
"""Limits of a well visible vehicle: fractions hidden by others and outside the image; pixels of the box."""
_UNITS: dict[str, dict[str, Any]] = {
    "of_factor": {"keypoint_error_factor": 2.0},
    "of_shift": {"keypoint_error_shift": 1.0},
    "of_turn": {"keypoint_error_turn": 1.0},
}
"""Options by the part of the covariance of which they add one unit."""
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Answers:
    """Answers for N boxes, NaN without one.

    Attributes:
        seen: what network and truth say of the boxes.
        ok: (N,) whether there is a pose, at whatever probability.
        R, t: the poses, (N, 3, 3) and (N, 3). up: (N, 3) the ground's normal (downwards) in the camera.
        covariance: (N, 6, 6) for independent keypoint errors (error factor 1).
        of_factor, of_shift, of_turn: (N, 6, 6) what each unit of the error factor, and of the squares of
            shift and turn, adds to it.
        evidence: (N, 6). ambiguity: (N,).
        other_R: (N, 3, 3) of the other reading, NaN without one.
    """

    seen: Records
    ok: Mask
    R: FloatArray
    t: FloatArray
    up: FloatArray
    covariance: FloatArray
    of_factor: FloatArray
    of_shift: FloatArray
    of_turn: FloatArray
    evidence: FloatArray
    ambiguity: FloatArray
    other_R: FloatArray

    def __len__(self) -> int:
        """Number of boxes."""
        return len(self.seen)

    def only(self, rows: Mask) -> Answers:
        """Those in a mask (N,)."""
        return Answers(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @classmethod
    def joined(cls, parts: list[Answers]) -> Answers:
        """All of several sources."""
        names = cls.__dataclass_fields__
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    @property
    def vehicles(self) -> Mask:
        """(N,): whether there is a vehicle."""
        return np.asarray(self.seen["class"] != NOTHING)

    @property
    def well_visible(self) -> Mask:
        """(N,): vehicles that are large and visible enough to be judged by the regions."""
        box = self.seen["box"]
        seen = (self.seen["hidden"] <= MOST_HIDDEN) & (self.seen["cut"] <= MOST_CUT)
        return np.asarray(self.vehicles & seen & (box[:, 3] - box[:, 1] >= LEAST_HEIGHT))

    @cached_property
    def yaw_error(self) -> FloatArray:
        """(N,) degrees, 0 to 180, about the ground's normal; NaN without a truth or an answer."""
        return yaw_error(self.seen["R"], self.R)

    @cached_property
    def other_yaw_error(self) -> FloatArray:
        """(N,) the same of the other reading; NaN without one."""
        return yaw_error(self.seen["R"], self.other_R)

    @cached_property
    def right(self) -> Mask:
        """(N,): vehicles whose yaw and distance are right."""
        return right(self.seen["R"], self.seen["t"], self.R, self.t)

    def stated(self, factor: float, shift: float = 0.0, turn: float = 0.0) -> Stated:
        """Errors and covariances for keypoint errors shared like this (`Options.keypoint_error_*`)."""
        covariance = self.covariance + (factor - 1.0) * self.of_factor
        covariance += shift**2 * self.of_shift + turn**2 * self.of_turn
        return Stated(self.errors, covariance, self.t, self.up)

    @cached_property
    def errors(self) -> FloatArray:
        """(N, 6) as in `Stated`."""
        return errors(self.seen["R"], self.seen["t"], self.R, self.t)


def yaw_error(R_true: FloatArray, R: FloatArray) -> FloatArray:
    """(N,) degrees, 0 to 180, about the ground's normal; NaN where a rotation is."""
    return yaw_between_deg(R, R_true)


def right(R_true: FloatArray, t_true: FloatArray, R: FloatArray, t: FloatArray) -> Mask:
    """(N,): whether yaw and distance of poses are right; not where anything is NaN."""
    found, true = np.linalg.norm(t, axis=1), np.linalg.norm(t_true, axis=1)
    with np.errstate(invalid="ignore"):
        near = np.abs(found - true) <= RIGHT_DISTANCE * true
        return np.asarray(near & (yaw_error(R_true, R) <= RIGHT_YAW_DEG))


def solve(seen: Records, ambiguity: tuple[float, float] | None = None) -> Answers:
    """Poses with the class that the network finds; none is refused for its probability.

    Covariances are linear in the error factor and in the squares of shift and turn, so one of each gives
    those of all.

    Args:
        ambiguity: `Options.ambiguity_coefficients`.
    """
    open_ = Options(min_probability=0.0, ambiguity_coefficients=ambiguity)
    first = _solved(seen, open_)
    grown = {
        part: _solved(seen, replace(open_, **more))["covariance"] - first["covariance"]
        for part, more in _UNITS.items()
    }
    return Answers(seen, **first, **grown)


_FIELDS = {name: name for name in ("ok", "R", "t", "covariance", "evidence", "ambiguity")}
_FIELDS["other_R"] = "alternative_R"
"""Fields of `Answers` and of the poses."""


def _solved(seen: Records, options: Options) -> dict[str, Any]:
    classes = seen["classes"].argmax(axis=1)
    own = [keypoint_indices(class_name) for class_name in CLASSES]
    models = [shape_model(class_name) for class_name in CLASSES]
    parts: dict[str, list[FloatArray]] = {name: [] for name in (*_FIELDS, "up")}
    for rows in by_view(seen):
        view = view_of(seen["view"][rows[0]])
        poses = estimate_poses(
            view,
            [seen["keypoints"][i, own[classes[i]]] for i in rows],
            seen["box"][rows],
            [models[classes[i]] for i in rows],
            [seen["scores"][i, own[classes[i]]] for i in rows],
            options,
            threads=1,
            vehicle_probability=seen["vehicle"][rows],
            viewing_angle_probabilities=seen["viewing_angle"][rows],
        )
        for name, field in _FIELDS.items():
            parts[name].append(getattr(poses, field))
        parts["up"].append(np.tile(view.R_camera_from_ground[:, 1], (len(rows), 1)))
    return {name: np.concatenate(values) for name, values in parts.items()}
