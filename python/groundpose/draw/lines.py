"""Lines of an object in the image: its 3D box, its shape, as far as the lens shows them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lens import LENSES
from groundpose.poses import Pose, PoseBatch
from groundpose.shape import ShapeModel
from groundpose.types import View
from groundpose.vehicles.skeleton import skeleton_of

# Nearest depth, metres, that lines are drawn from.
_NEAR = 0.1

# Corners of a 3D box as (x, y, z) choices of min and max, and its edges; z = 1 is the front.
_CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))
_EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1]
_FRONT = (1, 3, 7, 5)

# Keypoints that a pipeline's network gives a lower chance than this count as not seen.
_LEAST_SCORE = 0.1


@dataclass(frozen=True, eq=False)
class BoxLines:
    """A projected 3D box: the lines of its front face and the others (each (S, 2) pixels), the front as an
    area (S, 2) when all of it is shown, and whether the front faces the camera."""

    front: list[FloatArray]
    others: list[FloatArray]
    area: FloatArray | None
    faces_camera: bool


def box_lines(view: View, pose: Pose) -> BoxLines:
    """The 3D box of a pose, of the shape estimated."""
    box = pose.model.stretched_bbox_3d(pose.shape_coefficients)
    corners = box[_CORNERS, [0, 1, 2]] @ pose.R.T + pose.t
    front: list[FloatArray] = []
    others: list[FloatArray] = []
    for edge in _EDGES:
        line = segment(view, corners[list(edge)])
        if line is not None:
            (front if set(edge) <= set(_FRONT) else others).append(line)
    ahead = corners[list(_FRONT)]
    return BoxLines(front, others, _area(view, ahead), bool(pose.R[:, 2] @ ahead.mean(axis=0) < 0.0))


def _area(view: View, corners: FloatArray) -> FloatArray | None:
    """The outline of a face, (S, 2) pixels; None: not all of it is shown."""
    if not _is_wide(view) and (corners[:, 2] <= _NEAR).any():
        return None
    steps = _steps(view)[:-1]
    sides = [a + steps * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    outline = view.camera.image_of(np.concatenate(sides))
    return None if np.isnan(outline).any() else outline


def shape_lines(view: View, pose: Pose) -> tuple[list[FloatArray], list[FloatArray]]:
    """Lines between the keypoints of a bundled class that lie on a side that faces the camera, and the rest.

    Each is (S, 2) pixels; none for a model whose keypoints have other names.
    """
    points = pose.keypoints_3d
    camera = points @ pose.R.T + pose.t
    middle, half = points.mean(axis=0), np.maximum(0.5 * np.ptp(points, axis=0), 1e-9)
    # Seen when the camera is before the surface; an ellipsoid stands for the body.
    outward = ((points - middle) / half**2) @ pose.R.T
    seen = np.einsum("ij,ij->i", outward, camera) < 0.0
    near: list[FloatArray] = []
    far: list[FloatArray] = []
    for a, b in skeleton_of(pose.model.name, pose.model.keypoint_names):
        line = segment(view, camera[[a, b]])
        if line is not None:
            (near if seen[a] and seen[b] else far).append(line)
    return near, far


def segment(view: View, ends: FloatArray) -> FloatArray | None:
    """A line of the camera frame in the image, (S, 2) pixels, as far as it is shown; None: nowhere.

    It is cut at the near plane and, where a wide lens shows nothing, broken by NaN; curved by a lens, so in
    steps.
    """
    if _is_wide(view):
        line = view.camera.image_of(ends[0] + _steps(view) * (ends[1] - ends[0]))
        return None if np.isnan(line).all() else line
    depths = ends[:, 2]
    if (depths <= _NEAR).all():
        return None
    if (depths <= _NEAR).any():
        behind = int(np.argmin(depths))
        fraction = (_NEAR - depths[1 - behind]) / (depths[behind] - depths[1 - behind])
        ends = ends.copy()
        ends[behind] = ends[1 - behind] + fraction * (ends[behind] - ends[1 - behind])
        ends[behind, 2] = _NEAR
    line = view.camera.image_of(ends[0] + _steps(view) * (ends[1] - ends[0]))
    return None if np.isnan(line).all() else line


def _is_wide(view: View) -> bool:
    return view.camera.distortion is not None and LENSES[view.camera.lens].is_wide


def _steps(view: View) -> FloatArray:
    """(S, 1), 0 to 1: the ends of a line suffice where it stays straight."""
    if view.camera.distortion is None:
        return np.array([[0.0], [1.0]])
    return np.linspace(0.0, 1.0, 33 if _is_wide(view) else 12)[:, None]


def claimed(poses: PoseBatch) -> NDArray[np.bool_]:
    """(N, P): which keypoints the detector means to see: not those that its network gives hardly a chance."""
    given = np.isfinite(poses.keypoints_2d).all(axis=2)
    scores = getattr(poses, "keypoint_scores", None)
    return np.asarray(given if scores is None else given & (scores >= _LEAST_SCORE))


def footprint(model: ShapeModel, shape_coefficients: FloatArray | None) -> FloatArray:
    """Corners (C, 3), metres in the object frame, of the outline on the ground; None: of the mean shape."""
    own = model.bbox_3d
    low, high = own if shape_coefficients is None else model.stretched_bbox_3d(shape_coefficients)
    if model.footprint is None:
        corners = np.array([[low[0], low[2]], [low[0], high[2]], [high[0], high[2]], [high[0], low[2]]])
    else:
        fraction = (model.footprint - own[0, [0, 2]]) / (own[1] - own[0])[[0, 2]]
        corners = low[[0, 2]] + fraction * (high - low)[[0, 2]]
    return np.insert(corners, 1, high[1], axis=1)
