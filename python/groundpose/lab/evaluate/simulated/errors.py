"""Errors of pose and shape, summed up over all vehicles and over groups of them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from groundpose.lab.contenders.contender import Answers
from groundpose.lab.contenders.objects import Array
from groundpose.lab.evaluate.simulated.objects import Vehicles
from groundpose.lab.metrics import (
    NO_ANSWER_E_R_DEG,
    NO_ANSWER_E_T_PERCENT,
    rotation_error_deg,
    summarise,
    translation_error_percent,
)

Mask = npt.NDArray[np.bool_]
DISTANCES_M = (0.0, 15.0, 30.0, 50.0, np.inf)
TILT_ERRORS_DEG = (0.0, 0.5, 1.0, 2.0, np.inf)
OCCLUSIONS = ("fully visible", "partly occluded", "largely occluded")
FEWEST = 20
"""Smaller groups are left out."""


def vertex_error_cm(X_true: Array, X: Array, t_true: Array, t: Array) -> Array:
    """e_v of the paper (sec. 4.2.3), in the OBJECT frame: (N, P, 3) twice, (N, 3) twice -> (N,) cm.

    Mean distance between keypoints after the reconstructed shape is scaled by |t_true| / |t|, as one image
    does not tell size from distance. No answer (NaN) counts as a shape without extent: the mean distance of
    the true keypoints from the object's origin.
    """
    scale = np.linalg.norm(t_true, axis=1) / np.linalg.norm(t, axis=1)
    scaled = np.where(np.isfinite(scale)[:, None, None], scale[:, None, None] * X, 0.0)
    return np.asarray(100.0 * np.nanmean(np.linalg.norm(X_true - scaled, axis=2), axis=1))


def posed_vertex_error_cm(objects: Vehicles, answers: Answers, shapes: Array) -> Array:
    """The same between the shapes where they stand, in the camera frame: (N,) cm, NaN without an answer.

    It has the errors of rotation and direction in it, not that of distance.
    """
    scale = np.linalg.norm(objects.t, axis=1) / np.linalg.norm(answers.t, axis=1)
    true = objects.seen.keypoints_3d @ np.swapaxes(objects.R, 1, 2) + objects.t[:, None]
    found = shapes @ np.swapaxes(answers.R, 1, 2) + answers.t[:, None]
    apart = np.linalg.norm(true - scale[:, None, None] * found, axis=2)
    counted = np.isfinite(objects.seen.keypoints_3d[..., 0])
    return np.asarray(100.0 * np.where(counted, apart, 0.0).sum(axis=1) / counted.sum(axis=1))


@dataclass(frozen=True)
class Errors:
    """Errors of one method, (N,) each."""

    e_r_deg: Array
    e_t_percent: Array
    e_v_cm: Array
    posed_e_v_cm: Array

    @classmethod
    def of(cls, objects: Vehicles, answers: Answers, shapes: Array) -> Errors:
        """Against the truth of the vehicles; `shapes` (N, P, 3) metres: those found, or those given."""
        return cls(
            rotation_error_deg(objects.R, answers.R),
            translation_error_percent(objects.t, answers.t),
            vertex_error_cm(objects.seen.keypoints_3d, shapes, objects.t, answers.t),
            posed_vertex_error_cm(objects, answers, shapes),
        )

    def numbers(self, kept: Mask, shapes: bool) -> dict[str, Any]:
        """What is stored of some of the vehicles; `shapes`: also the errors of shape."""
        e_r, e_t, e_v = self.e_r_deg[kept], self.e_t_percent[kept], self.e_v_cm[kept]
        s, root = summarise(e_r, e_t), float(np.sqrt(kept.sum()))
        found: dict[str, Any] = {
            "trials": s.trials,
            "answered": s.answered,
            "mean_e_r_deg": s.mean_e_r_deg,
            "median_e_r_deg": s.median_e_r_deg,
            "error_of_mean_e_r_deg": float(np.nan_to_num(e_r, nan=NO_ANSWER_E_R_DEG).std()) / root,
            "mean_e_t_percent": s.mean_e_t_percent,
            "median_e_t_percent": s.median_e_t_percent,
            "error_of_mean_e_t_percent": float(np.nan_to_num(e_t, nan=NO_ANSWER_E_T_PERCENT).std()) / root,
            "failures": s.failures,
            "mean_e_r_ok_deg": s.mean_e_r_ok_deg,
            "mean_e_t_ok_percent": s.mean_e_t_ok_percent,
        }
        if shapes:
            found |= {
                "mean_e_v_cm": float(e_v.mean()),
                "median_e_v_cm": float(np.median(e_v)),
                "error_of_mean_e_v_cm": float(e_v.std()) / root,
                "median_posed_e_v_cm": float(np.nanmedian(self.posed_e_v_cm[kept])) if s.answered else None,
            }
        return found


SHORT = ("trials", "mean_e_r_deg", "median_e_r_deg", "mean_e_t_percent", "failures", "mean_e_v_cm")
"""What is stored of groups."""


def summary(objects: Vehicles, errors: Errors, shapes: bool) -> dict[str, Any]:
    """All vehicles, and under "groups" by distance, class, truncation, occlusion and tilt error."""
    whole = errors.numbers(np.ones(len(objects), bool), shapes)
    found: dict[str, dict[str, Any]] = {}
    for by, name, kept in groups(objects):
        numbers = errors.numbers(kept, shapes)
        found.setdefault(by, {})[name] = {key: numbers[key] for key in SHORT if key in numbers}
    return whole | {"groups": found}


def groups(objects: Vehicles) -> Iterator[tuple[str, str, Mask]]:
    """(by what, name, members) of every group of FEWEST vehicles and more."""
    classes = np.array(objects.classes)
    parts = [
        *_ranges("distance", objects.distance, DISTANCES_M, "m"),
        *(
            ("class", class_name, classes == class_name)
            for class_name in dict.fromkeys(sorted(objects.classes))
        ),
        ("truncation", "whole", objects.truncation <= 0.0),
        ("truncation", "cut by the image border", objects.truncation > 0.0),
        *(("occlusion", name, objects.occlusion == level) for level, name in enumerate(OCCLUSIONS)),
        *_ranges("tilt error", objects.tilt_error_deg, TILT_ERRORS_DEG, "deg"),
    ]
    return (part for part in parts if part[2].sum() >= FEWEST)


def _ranges(by: str, values: Array, edges: tuple[float, ...], unit: str) -> Iterator[tuple[str, str, Mask]]:
    for low, high in itertools.pairwise(edges):
        name = f"{low:g} to {high:g} {unit}" if np.isfinite(high) else f"{low:g} {unit} and more"
        yield by, name, (values >= low) & (values < high)
