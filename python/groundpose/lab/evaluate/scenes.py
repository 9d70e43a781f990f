"""Scenes with known truth: the one generator of the core, and one object of it as other libraries want it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

import groundpose as gp
from groundpose import _core

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """One object: what a solver is given, and the truth."""

    keypoints_2d: Array
    """(n, 2) pixels, all finite."""
    keypoints_3d: Array
    """(n, 3) metres, object frame."""
    camera: gp.Camera
    inlier_threshold: float
    """px"""
    R: Array
    t: Array


@dataclass(frozen=True)
class Scenes:
    """Many objects seen by one view; row k of every array is trial k. NaN rows of keypoints are not seen."""

    keypoints_2d: Array
    keypoints_3d: Array
    bboxes: Array
    bbox_3d: Array
    R: Array
    t: Array
    inlier_truth: npt.NDArray[np.bool_]
    inlier_threshold: Array
    camera: gp.Camera
    view: gp.View
    """The tilt a solver is told, which is not the true one in E3 and V1."""

    def __len__(self) -> int:
        """Number of objects."""
        return len(self.R)

    def __getitem__(self, rows: slice) -> Scenes:
        """The objects of a slice, in the same view."""
        per_object = {
            f.name: getattr(self, f.name)[rows]
            for f in fields(self)
            if f.name not in ("bbox_3d", "camera", "view")
        }
        return replace(self, **per_object)

    @cached_property
    def models(self) -> list[gp.ShapeModel]:
        """One model an object, built once: a caller has its models before it has an image."""
        seen = ~np.isnan(self.keypoints_2d[..., 0])
        # padding points get a place inside the box: they are never seen, but a model must be finite
        points = np.where(seen[..., None], self.keypoints_3d, self.bbox_3d.mean(axis=0))
        return [gp.ShapeModel(p, bbox_3d=self.bbox_3d) for p in points]

    @cached_property
    def singles(self) -> list[Scene]:
        """The same objects one by one, unseen keypoints left out."""
        seen = ~np.isnan(self.keypoints_2d[..., 0])
        return [
            Scene(
                np.ascontiguousarray(self.keypoints_2d[k][seen[k]]),
                np.ascontiguousarray(self.keypoints_3d[k][seen[k]]),
                self.camera,
                float(self.inlier_threshold[k]),
                self.R[k],
                self.t[k],
            )
            for k in range(len(self))
        ]


def generate(kind: str, trials: int, **settings: Any) -> Scenes:
    """Scenes of `_core.synthetic_scenes`: "cube" (E1 to E4 of the paper) or "vehicle" (V1).

    `settings` are its arguments: seed, first_trial, outlier_ratio, outliers, pitch_error_deg, ...
    Trial k depends on (seed, k) only.
    """
    raw = _core.synthetic_scenes(kind, trials, **settings)
    width, height = raw["image_size"]
    camera = gp.Camera(raw["fx"], raw["fy"], raw["cx"], raw["cy"], image_size=(int(width), int(height)))
    told = np.unique(np.asarray(raw["pitch_told"]))
    if told.size != 1:
        raise ValueError(f"pitch_told: expected one value for all trials, got {told.size}")
    return Scenes(
        keypoints_2d=raw["keypoints_2d"],
        keypoints_3d=raw["keypoints_3d"],
        bboxes=raw["bboxes"],
        bbox_3d=np.asarray(raw["bbox_3d"], float),
        R=raw["R"],
        t=raw["t"],
        inlier_truth=raw["inlier_truth"],
        inlier_threshold=raw["inlier_threshold"],
        camera=camera,
        view=gp.View(camera, pitch=float(told[0])),
    )
