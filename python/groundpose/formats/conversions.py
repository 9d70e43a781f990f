"""Poses in the terms of other libraries: 4 x 4 matrices, rotation vectors, KITTI's numbers, the axes of ROS.

All arrays lead with the N objects; an object without an answer is NaN throughout.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from groundpose._checks import FloatArray, shaped
from groundpose.formats.kitti.results import R_from_rotation_y, results
from groundpose.poses import PoseBatch

_SMALL = 1e-6
BODY_FROM_OBJECT: FloatArray = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""From x right, y down, z forward (object and ground frame) to x forward, y left, z up, the axes of bodies in
ROS (REP 103), nuScenes and Foxglove."""


def to_matrices(R: ArrayLike, t: ArrayLike) -> FloatArray:
    """camera_from_object (N, 4, 4) of `R` (N, 3, 3) and `t` (N, 3)."""
    rotations = shaped("R", R, ("N", 3, 3))
    places = shaped("t", t, (len(rotations), 3))
    out = np.zeros((len(rotations), 4, 4))
    out[:, :3, :3], out[:, :3, 3], out[:, 3, 3] = rotations, places, 1.0
    out[np.isnan(places).any(axis=1)] = np.nan
    return out


def from_matrices(matrices: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """`(R, t)` of (N, 4, 4); the inverse of `to_matrices`."""
    given = shaped("matrices", matrices, ("N", 4, 4))
    return given[:, :3, :3].copy(), given[:, :3, 3].copy()


def to_quaternions(R: ArrayLike) -> FloatArray:
    """Unit quaternions w, x, y, z (N, 4) with w >= 0 of rotations (N, 3, 3).

    The eigenvector of the largest eigenvalue of a symmetric matrix (Bar-Itzhack, 2000): as exact for half
    turns as for none.
    """
    given = shaped("R", R, ("N", 3, 3))
    good = np.asarray(np.isfinite(given).all(axis=(1, 2)))
    m = np.where(good[:, None, None], given, np.eye(3))
    K = np.zeros((len(m), 4, 4))
    K[:, :3, :3] = m + np.swapaxes(m, 1, 2) - np.trace(m, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    K[:, 3, 3] = np.trace(m, axis1=1, axis2=2)
    axes = np.stack([m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], axis=1)
    K[:, :3, 3] = K[:, 3, :3] = axes
    best = np.linalg.eigh(K)[1][:, :, -1][:, [3, 0, 1, 2]]
    best *= np.where(best[:, :1] < 0.0, -1.0, 1.0)
    return np.where(good[:, None], best, np.nan)


def to_rvec_tvec(R: ArrayLike, t: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """OpenCV's rotation vectors (N, 3), of angle 0 to pi, and translations (N, 3)."""
    q = to_quaternions(R)
    sine = np.linalg.norm(q[:, 1:], axis=1)
    angle = 2.0 * np.arctan2(sine, q[:, 0])
    factor = np.divide(angle, sine, out=np.full(len(q), 2.0), where=sine > 0.0)
    return q[:, 1:] * factor[:, None], shaped("t", t, (len(q), 3)).copy()


def from_rvec_tvec(rvec: ArrayLike, tvec: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """`(R, t)` of OpenCV's vectors (N, 3) and (N, 3), or (N, 3, 1) as OpenCV gives them."""
    vectors = shaped("rvec", rvec, ("N", 3), ("N", 3, 1)).reshape(-1, 3)
    places = shaped("tvec", tvec, (len(vectors), 3), (len(vectors), 3, 1)).reshape(-1, 3)
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    safe = np.where(angle > _SMALL, angle, 1.0)
    first = np.where(angle > _SMALL, np.sin(safe) / safe, 1.0)
    second = np.where(angle > _SMALL, (1.0 - np.cos(safe)) / safe**2, 0.5)
    return np.eye(3) + first * cross + second * (cross @ cross), places.copy()


def to_kitti(poses: PoseBatch, offset: ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
    """(N, 8): height, width, length, x, y, z of the bottom centre, rotation_y, alpha of each answer.

    `offset`: see `groundpose.formats.kitti.results.results`.
    """
    out = np.full((len(poses), 8), np.nan)
    for row, result, ok in zip(out, results(poses, offset=offset), poses.ok, strict=True):
        if ok:
            size = (result.height, result.width, result.length)
            row[:] = (*size, *result.location, result.rotation_y, result.alpha)
    return out


def from_kitti(rows: ArrayLike, offset: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[FloatArray, FloatArray]:
    """`(R, t)` of upright objects whose origin is the bottom centre, from the rows of `to_kitti` (N, 8)."""

    given = shaped("rows", rows, ("N", 8))
    R = np.array([R_from_rotation_y(angle) for angle in given[:, 6]]).reshape(-1, 3, 3)
    return R, given[:, 3:6] + shaped("offset", offset, (3,))


def to_body_axes(R: ArrayLike) -> FloatArray:
    """Rotations (N, 3, 3) from an object's axes x forward, y left, z up to the camera frame, of `R`
    (N, 3, 3)."""
    return np.asarray(shaped("R", R, ("N", 3, 3)) @ BODY_FROM_OBJECT.T)


def covariance_at(covariance: ArrayLike, arm: ArrayLike) -> FloatArray:
    """(N, 6, 6) of `[rotation vector, place]`, of another point of the objects than their origin.

    Args:
        covariance: (N, 6, 6) of a `PoseBatch`.
        arm: (N, 3) metres from the object's origin to the point, in the camera frame: a turn about the
            origin moves it too.
    """
    given = shaped("covariance", covariance, ("N", 6, 6))
    x, y, z = shaped("arm", arm, (len(given), 3)).T
    slope = np.broadcast_to(np.eye(6), given.shape).copy()
    slope[:, 3, 1], slope[:, 3, 2] = z, -y
    slope[:, 4, 0], slope[:, 4, 2] = -z, x
    slope[:, 5, 0], slope[:, 5, 1] = y, -x
    return np.asarray(slope @ given @ np.swapaxes(slope, 1, 2))


def to_ros_covariance(covariance: ArrayLike) -> FloatArray:
    """(N, 6, 6) in the order of ROS, `[place, rotation about the axes of the frame]`."""
    order = [3, 4, 5, 0, 1, 2]
    return shaped("covariance", covariance, ("N", 6, 6))[:, order][:, :, order]


def turns_to_the_right(angles: FloatArray) -> FloatArray:
    """(N, 3, 3) rotations by (N,) radians about the axis that points down, from forward to the right."""
    s, c, zero, one = np.sin(angles), np.cos(angles), np.zeros_like(angles), np.ones_like(angles)
    return np.stack([c, zero, s, zero, one, zero, -s, zero, c], axis=1).reshape(-1, 3, 3)
