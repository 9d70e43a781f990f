"""KITTI's object result format.

One line an object: type, truncated, occluded, alpha, bbox (4), height, width, length, x, y, z of the
bottom centre, rotation_y, score; metres, radians, camera frame. What is not known has the values
KITTI's development kit gives for it: -1, -10 for angles, -1000 for a position. So line i is object i,
and an object without an answer keeps its 2D box but has no pose.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from groundpose._checks import FloatArray, input_error, shaped, text

if TYPE_CHECKING:
    from groundpose.poses import Pose, PoseBatch

_UNKNOWN_ANGLE = -10.0
_UNKNOWN_POSE = (-1.0, -1.0, -1.0, -1000.0, -1000.0, -1000.0, _UNKNOWN_ANGLE)


def format_results(poses: PoseBatch, names: Sequence[str] | None = None, scores: object = None) -> str:
    """The result text of a batch; see `PoseBatch.to_kitti` for the arguments."""
    if names is None:
        names = [model.name or "Car" for model in poses.models]
    if len(names) != len(poses):
        raise input_error("names", f"{len(poses)} names, one per object", len(names))
    types = ["_".join(text("names", name).split()) or "Car" for name in names]
    if scores is None:
        seen = np.isfinite(poses.residuals).sum(axis=1)
        shares = poses.inlier_count / np.maximum(seen, 1)
    else:
        shares = shaped("scores", scores, (len(poses),))
    return "".join(
        _line(pose, name, poses, share) for pose, name, share in zip(poses, types, shares, strict=True)
    )


def _line(pose: Pose, name: str, poses: PoseBatch, score: float) -> str:
    box = pose.bbox
    if pose.ok:
        length, height, width = pose.model.size
        x, y, z = bottom_centre(pose)
        rotation_y = _wrapped(pose.yaw - 0.5 * np.pi)
        alpha = _wrapped(rotation_y - np.arctan2(x, z))
        known = (height, width, length, x, y, z, rotation_y)
        box = np.where(np.isnan(box), _projected_box(pose, poses), box)
    else:
        alpha, known = _UNKNOWN_ANGLE, _UNKNOWN_POSE
    box = np.where(np.isfinite(box), box, -1.0)
    numbers = " ".join(f"{value:.4f}" for value in (alpha, *box, *known))
    return f"{name} -1 -1 {numbers} {score:.4f}\n"


def bottom_centre(pose: Pose) -> FloatArray:
    """Camera-frame position (3,), metres, of the middle of the 3D box's bottom face."""
    low, high = pose.model.bbox_3d
    middle = np.array([0.5 * (low[0] + high[0]), high[1], 0.5 * (low[2] + high[2])])
    return np.asarray(pose.R @ middle + pose.t)


def _projected_box(pose: Pose, poses: PoseBatch) -> FloatArray:
    """Extent (4,) of the 3D box in the image, cut at the image border if its size is known."""
    corners = np.array(list(itertools.product(*pose.model.bbox_3d.T)))
    pixels = poses.view.project(corners @ pose.R.T + pose.t)
    if np.isnan(pixels).any():
        return np.full(4, np.nan)
    size = poses.view.camera.image_size
    if size is not None:
        pixels = np.clip(pixels, 0.0, np.array(size) - 1.0)
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
