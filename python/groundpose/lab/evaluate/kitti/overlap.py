"""Overlap of boxes: in the image, seen from above (exact, of rotated rectangles) and in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray

_SAME = 1e-9
"""Corners this near to a side, as a fraction of the rectangles' size, count as inside: equal rectangles share
all."""


@dataclass(frozen=True)
class Boxes:
    """N boxes in space as KITTI writes them, all arrays of floats; NaN for objects without a pose."""

    size: FloatArray
    """(N, 3) height, width, length in metres."""
    bottom: FloatArray
    """(N, 3) x, y, z of the bottom centre."""
    rotation_y: FloatArray
    """(N,)"""

    def __len__(self) -> int:
        """Number of boxes."""
        return len(self.rotation_y)

    def corners(self) -> FloatArray:
        """(N, 4, 2) x, z of the outline seen from above, in order."""
        _, width, length = (self.size[:, k, None] / 2 for k in range(3))
        along = length * [1.0, 1.0, -1.0, -1.0]
        across = width * [1.0, -1.0, -1.0, 1.0]
        c, s = np.cos(self.rotation_y)[:, None], np.sin(self.rotation_y)[:, None]
        flat = np.stack([c * along + s * across, -s * along + c * across], axis=-1)
        return np.asarray(flat + self.bottom[:, None, [0, 2]])


def image_overlap(a: FloatArray, b: FloatArray, over_a: bool = False) -> FloatArray:
    """Intersection over union of image boxes (N, 4) and (M, 4) -> (N, M); `over_a`: over the area of `a`."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=2)
    area_a, area_b = (np.prod(box[:, 2:] - box[:, :2], axis=1) for box in (a, b))
    whole = np.broadcast_to(area_a[:, None], shared.shape)
    return _ratio(shared, whole if over_a else whole + area_b - shared)


def space_overlaps(a: Boxes, b: Boxes) -> tuple[FloatArray, FloatArray]:
    """Intersection over union seen from above and in space, (N, M) each; 0 for NaN."""
    corners_a, corners_b = a.corners(), b.corners()
    reach_a, reach_b = (np.hypot(x.size[:, 1], x.size[:, 2]) / 2 for x in (a, b))
    middle = np.linalg.norm(a.bottom[:, None, [0, 2]] - b.bottom[None, :, [0, 2]], axis=2)
    near = middle < reach_a[:, None] + reach_b  # False for NaN
    shared = np.zeros(near.shape)
    rows, columns = np.nonzero(near)
    shared[rows, columns] = intersection_areas(corners_a[rows], corners_b[columns])
    area_a, area_b = (x.size[:, 1] * x.size[:, 2] for x in (a, b))
    above = _ratio(shared, area_a[:, None] + area_b - shared)
    # y is down: the bottom is the largest
    low = np.maximum(a.bottom[:, None, 1] - a.size[:, None, 0], b.bottom[:, 1] - b.size[:, 0])
    high = np.minimum(a.bottom[:, None, 1], b.bottom[:, 1])
    volume = shared * np.maximum(high - low, 0.0)
    volume_a, volume_b = area_a * a.size[:, 0], area_b * b.size[:, 0]
    return above, _ratio(volume, volume_a[:, None] + volume_b - volume)


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    good = np.isfinite(part) & (whole > 0.0)
    return np.divide(part, whole, out=np.zeros(part.shape), where=good)


def intersection_areas(a: FloatArray, b: FloatArray) -> FloatArray:
    """Area shared by rectangles (K, 4, 2) and (K, 4, 2), corners in order, -> (K,).

    The intersection of two convex outlines has its corners among the corners of one inside the other and the
    crossings of their sides: all are collected, put in order about their middle and summed up.
    """
    if not len(a):
        return np.zeros(0)
    origin = a.mean(axis=1, keepdims=True)  # near the origin areas keep all digits
    a, b = a - origin, b - origin
    points = np.concatenate([a, b, _crossings(a, b)], axis=1)
    good = np.concatenate([_inside(a, b), _inside(b, a), np.isfinite(points[:, 8:, 0])], axis=1)
    count = np.maximum(good.sum(axis=1), 1)[:, None]
    middle = np.sum(np.where(good[..., None], points, 0.0), axis=1) / count
    points = np.where(good[..., None], points - middle[:, None], 0.0)
    angle = np.where(good, np.arctan2(points[..., 1], points[..., 0]), np.inf)
    order = np.argsort(angle, axis=1)
    points = np.take_along_axis(points, order[..., None], axis=1)
    # those that do not count come last: they take the first one's place and add no area
    last = np.arange(points.shape[1]) >= good.sum(axis=1)[:, None]
    points = np.where(last[..., None], points[:, :1], points)
    after = np.roll(points, -1, axis=1)
    area: FloatArray = 0.5 * np.abs(
        np.sum(points[..., 0] * after[..., 1] - points[..., 1] * after[..., 0], axis=1)
    )
    return np.where(good.sum(axis=1) >= 3, area, 0.0)


def _inside(points: FloatArray, outline: FloatArray) -> NDArray[np.bool_]:
    """(K, 4) whether points (K, 4, 2) lie in rectangles (K, 4, 2)."""
    origin, first, second = outline[:, :1], outline[:, 1] - outline[:, 0], outline[:, 3] - outline[:, 0]
    inside = np.ones(points.shape[:2], dtype=bool)
    for side in (first, second):
        along = np.sum((points - origin) * side[:, None], axis=2)
        length = np.sum(side**2, axis=1)[:, None]
        inside &= (along >= -_SAME * length) & (along <= (1.0 + _SAME) * length)
    return inside


def _crossings(a: FloatArray, b: FloatArray) -> FloatArray:
    """(K, 16, 2) where sides cross, NaN where they do not."""
    step_a, step_b = np.roll(a, -1, axis=1) - a, np.roll(b, -1, axis=1) - b
    p, q = a[:, :, None], b[:, None]
    u, v = step_a[:, :, None], step_b[:, None]
    between = q - p
    turn = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (between[..., 0] * v[..., 1] - between[..., 1] * v[..., 0]) / turn
        r = (between[..., 0] * u[..., 1] - between[..., 1] * u[..., 0]) / turn
    hit = (np.abs(turn) > 1e-12) & (s >= 0.0) & (s <= 1.0) & (r >= 0.0) & (r <= 1.0)
    with np.errstate(invalid="ignore"):
        at = np.where(hit[..., None], p + s[..., None] * u, np.nan)
    return np.asarray(at.reshape(len(a), 16, 2))
