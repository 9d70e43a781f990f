"""What every contender is given: objects of one image, or many alike, in one view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

import groundpose as gp
from groundpose.lab.metrics import RELATIVE_THRESHOLD

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Thresholds = tuple[float, float, float]
# thresholds of the hierarchical refinement as multiples of the inlier threshold: 4, 6, 12 px in E1 to E4;
# 0.0375, 0.05, 0.15 of the longer box side for vehicles (paper, sec. 4.2.2)
HRE_CUBE: Thresholds = (1.0, 1.5, 3.0)
HRE_VEHICLE: Thresholds = (1.0, 4.0 / 3.0, 4.0)
_OF_ALL = (
    *("view", "hre_thresholds", "frame_tilt_sigma", "fewest_points"),
    *("frame", "keypoint_errors"),
)
"""Fields that are not one per object."""
Some = TypeVar("Some", bound="Objects")


@dataclass(frozen=True)
class Single:
    """One object as other libraries want it: what is seen of a rigid shape."""

    keypoints_2d: Array
    """(n, 2) pixels, all finite."""
    keypoints_3d: Array
    """(n, 3) metres, object frame."""
    camera: gp.Camera
    inlier_threshold: float
    """px"""


@dataclass(frozen=True, kw_only=True)
class Objects:
    """N objects seen in one view; row k of every array is object k."""

    view: gp.View
    """With the nominal tilt, which is not the true one in E3 and V1."""
    keypoints_2d: Array
    """(N, P, 2) px, NaN where a keypoint is not seen."""
    bboxes: Array
    """(N, 4) px"""
    models: Sequence[gp.ShapeModel]
    inlier_threshold: Array
    """(N,) px"""
    R: Array
    """(N, 3, 3) the truth, for oracles and errors; NaN where it is not known."""
    t: Array
    keypoint_scores: Array | None = None
    rigid: Array | None = None
    """(N, P, 3) metres: the shape for contenders that know no modes; None: the mean of each model."""
    inlier_truth: Mask | None = None
    """(N, P)"""
    hre_thresholds: Thresholds = HRE_VEHICLE
    """Of the paper for objects like these."""
    fewest_points: int = 3
    """A library is not asked with fewer keypoints; a fourth tells the solutions of three apart."""
    frame_tilt_sigma: float | None = None
    """Radians; the tilt of the view is estimated from all objects first when it is given."""
    frame: gp.FramePriors | gp.CameraState | None = None
    """What is known of the frame, for contenders that take its objects together."""
    keypoint_errors: Mapping[str, float | None] = field(default_factory=dict)
    """How the errors of keypoints are shared: options of `groundpose.Options` by name."""

    def __len__(self) -> int:
        """Number of objects."""
        return len(self.bboxes)

    def __getitem__(self: Some, rows: slice | list[int]) -> Some:
        """Some of the objects, in the same view."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in self.of_all}
        models = values.pop("models")
        some = models[rows] if isinstance(rows, slice) else [models[k] for k in rows]
        own: dict[str, Any] = {name: None if v is None else v[rows] for name, v in values.items()}
        return replace(self, models=some, **own)

    @property
    def of_all(self) -> tuple[str, ...]:
        """Names of fields that are not one per object."""
        return _OF_ALL

    @property
    def camera(self) -> gp.Camera:
        """Of the view."""
        return self.view.camera

    @cached_property
    def keypoints_3d(self) -> Array:
        """(N, P, 3) metres: `rigid`, or the mean of each model, NaN beyond its keypoints."""
        return self.shapes() if self.rigid is None else self.rigid

    def shapes(self, coefficients: Array | None = None) -> Array:
        """(N, P, 3) metres: the models with these coefficients (N, M), NaN without an answer."""
        shapes = np.full((*self.keypoints_2d.shape[:2], 3), np.nan)
        for k, model in enumerate(self.models):
            points = model.keypoints_3d
            if coefficients is not None and model.modes:
                points = model.keypoints(coefficients[k, : model.modes])
            shapes[k, : len(points)] = points
        return shapes

    @cached_property
    def singles(self) -> list[Single]:
        """The objects one by one, unseen keypoints left out."""
        seen = ~np.isnan(self.keypoints_2d[..., 0])
        return [
            Single(
                np.ascontiguousarray(self.keypoints_2d[k][seen[k]]),
                np.ascontiguousarray(self.keypoints_3d[k][seen[k]]),
                self.camera,
                float(self.inlier_threshold[k]),
            )
            for k in range(len(self))
        ]

    def without_scores(self: Some) -> Some:
        """The same for those that cannot use scores."""
        return replace(self, keypoint_scores=None)

    def cut(self: Some, lowest: float) -> Some:
        """Without scores, and without the keypoints that have a lower one."""
        if self.keypoint_scores is None:
            return self
        kept = (self.keypoint_scores >= lowest)[..., None]
        return replace(self, keypoint_scores=None, keypoints_2d=np.where(kept, self.keypoints_2d, np.nan))


def relative_thresholds(bboxes: Array) -> Array:
    """(N,) px: the paper's fraction of the longer side of boxes (N, 4)."""
    return np.asarray(RELATIVE_THRESHOLD * (bboxes[:, 2:] - bboxes[:, :2]).max(axis=1, initial=0.0))


def padded(rows: Sequence[npt.NDArray[Any]], fill: float, *shape: int) -> Array:
    """Rows (P_i, *shape) of several objects in one array (N, P, *shape), `fill` beyond the end of each."""
    found = np.full((len(rows), max(map(len, rows), default=0), *shape), fill)
    for row, values in zip(found, rows, strict=True):
        row[: len(values)] = values
    return found
