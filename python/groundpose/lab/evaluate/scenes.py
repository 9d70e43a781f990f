"""Scenes with known truth, from the one generator of the core."""

from __future__ import annotations

from typing import Any

import numpy as np

import groundpose as gp
from groundpose import _core
from groundpose.lab.contenders.objects import HRE_CUBE, HRE_VEHICLE, Array, Objects


def generate(kind: str, trials: int, **settings: Any) -> Objects:
    """Synthetic scenes of `_core.synthetic_scenes`: "cube" (E1 to E4 of the paper) or "vehicle" (V1).

    `settings` are its arguments: seed, first_trial, outlier_ratio, outliers, pitch_error_deg, ...
    Trial k depends on (seed, k) only.
    """
    raw = _core.synthetic_scenes(kind, trials, **settings)
    width, height = raw["image_size"]
    camera = gp.Camera(raw["fx"], raw["fy"], raw["cx"], raw["cy"], image_size=(int(width), int(height)))
    nominal = np.unique(np.asarray(raw["pitch_told"]))
    if nominal.size != 1:
        raise ValueError(f"pitch_told: expected one value for all trials, got {nominal.size}")
    keypoints_2d, points = raw["keypoints_2d"], raw["keypoints_3d"]
    return Objects(
        view=gp.View(camera, pitch=float(nominal[0])),
        keypoints_2d=keypoints_2d,
        bboxes=raw["bboxes"],
        models=_models(keypoints_2d, points, np.asarray(raw["bbox_3d"], float)),
        inlier_threshold=raw["inlier_threshold"],
        R=raw["R"],
        t=raw["t"],
        rigid=points,
        inlier_truth=raw["inlier_truth"],
        hre_thresholds=HRE_CUBE if kind == "cube" else HRE_VEHICLE,
    )


def _models(keypoints_2d: Array, points: Array, bbox_3d: Array) -> list[gp.ShapeModel]:
    """One model per object: a caller has its models before it has an image."""
    seen = ~np.isnan(keypoints_2d[..., 0])
    # padding points get a place inside the box: they are never seen, but a model must be finite
    finite = np.where(seen[..., None], points, bbox_3d.mean(axis=0))
    return [gp.ShapeModel(p, bbox_3d=bbox_3d) for p in finite]
