"""KITTI's object result format.

One line per object: type, truncated, occluded, alpha, bbox (4), height, width, length, x, y, z of the
bottom centre, rotation_y, score; metres, radians, camera frame. What is not known has the values
KITTI's development kit gives for it: -1, -10 for angles, -1000 for a position. So line i is object i,
and an object without an answer keeps its 2D box but has no pose.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from groundpose._checks import FloatArray, input_error, shaped, text
from groundpose.formats.kitti.labels import KittiLabel
from groundpose.poses import Pose, PoseBatch

_UNKNOWN_ANGLE = -10.0
_UNKNOWN_PLACE = (-1000.0, -1000.0, -1000.0)


def format_results(
    poses: PoseBatch,
    names: Sequence[str] | None = None,
    scores: ArrayLike | None = None,
    offset: ArrayLike = (0, 0, 0),
) -> str:
    """The result text of a batch; see `PoseBatch.to_kitti` and `results` for the arguments."""
    return "".join(format_result(result) for result in results(poses, names, scores, offset))


def results(
    poses: PoseBatch,
    names: Sequence[str] | None = None,
    scores: ArrayLike | None = None,
    offset: ArrayLike = (0, 0, 0),
) -> list[KittiLabel]:
    """The batch as KITTI's results, one per object.

    Args:
        poses: the poses.
        names, scores: see `PoseBatch.to_kitti`.
        offset: (3,) metres, position of KITTI's label frame (camera 0) in this camera's: KITTI's
            `KittiFrame.camera_from_labels`. Zero: positions stay in this camera's frame.
    """
    if names is None:
        names = [model.name or "Car" for model in poses.models]
    if len(names) != len(poses):
        raise input_error("names", f"{len(poses)} names, one per object", len(names))
    types = ["_".join(text("names", name).split()) or "Car" for name in names]
    if scores is None:
        seen = np.isfinite(poses.residuals).sum(axis=1)
        fractions = poses.inlier_count / np.maximum(seen, 1)
    else:
        fractions = shaped("scores", scores, (len(poses),))
    places, boxes = bottom_centres(poses) - shaped("offset", offset, (3,)), poses.bboxes
    return [
        _result(poses, i, name, float(fraction), places[i], boxes[i])
        for i, (name, fraction) in enumerate(zip(types, fractions, strict=True))
    ]


def _result(
    poses: PoseBatch, i: int, name: str, score: float, place: FloatArray, box: FloatArray
) -> KittiLabel:
    if poses.ok[i]:
        low, high = poses.models[i].stretched_bbox_3d(poses.shape_coefficients[i])
        width, height, length = (high - low).tolist()
        x, y, z = place.tolist()
        angle = rotation_y(poses.R[i])
        alpha = wrapped(angle - math.atan2(x, z))
        if np.isnan(box).any():
            box = np.where(np.isnan(box), _projected_box(poses, i), box)
    else:
        alpha = angle = _UNKNOWN_ANGLE
        height = width = length = -1.0
        x, y, z = _UNKNOWN_PLACE
    left, top, right, bottom = (side if math.isfinite(side) else -1.0 for side in box.tolist())
    sides = (left, top, right, bottom)
    return KittiLabel(name, -1.0, -1, alpha, sides, height, width, length, (x, y, z), angle, score)


def format_result(result: KittiLabel) -> str:
    """A line of a result file."""
    size = (result.height, result.width, result.length)
    values = (result.alpha, *result.bbox, *size, *result.location, result.rotation_y)
    numbers = " ".join(f"{value:.4f}" for value in values)
    return f"{result.type} -1 -1 {numbers} {result.score:.4f}\n"


def rotation_y(R: FloatArray) -> float:
    """KITTI's angle of a pose: that of the object's forward direction in the camera's x-z plane."""
    return math.atan2(-R[2, 2], R[0, 2])


def R_from_rotation_y(angle: float) -> FloatArray:
    """Our rotation (3, 3) of an upright object of KITTI: yaw = rotation_y + pi/2."""
    c, s = np.cos(angle + 0.5 * np.pi), np.sin(angle + 0.5 * np.pi)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def bottom_centre(pose: Pose) -> FloatArray:
    """Camera-frame position (3,), metres, of the middle of the 3D box's bottom face."""
    return np.asarray(pose.R @ pose.model.bottom_centre + pose.t)


def bottom_centres(poses: PoseBatch) -> FloatArray:
    """`bottom_centre` of all objects, (N, 3); NaN without an answer."""
    middles = np.array([model.bottom_centre for model in poses.models]).reshape(-1, 3)
    return np.asarray((poses.R @ middles[..., None])[..., 0] + poses.t)


def _projected_box(poses: PoseBatch, i: int) -> FloatArray:
    """Extent (4,) of the 3D box in the image, cut at the image border if its size is known."""
    corners = np.array(list(itertools.product(*poses.models[i].bbox_3d.T)))
    pixels = poses.view.camera.image_of(corners @ poses.R[i].T + poses.t[i])
    if np.isnan(pixels).any():
        return np.full(4, np.nan)
    size = poses.view.camera.image_size
    if size is not None:
        pixels = np.clip(pixels, 0.0, np.array(size) - 1.0)
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def wrapped(angle: float) -> float:
    """The angle in -pi to pi."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
