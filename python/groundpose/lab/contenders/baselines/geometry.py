"""What the PnP methods share: alignment of two point sets, choice among candidate poses."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from groundpose.types import Camera

Array = npt.NDArray[np.float64]
Pose = tuple[Array, Array]
"""R (3, 3) and t (3,)."""


def normalised(pixels: Array, camera: Camera) -> Array:
    """Undistorted pixels (n, 2) to K^-1 u (n, 2)."""
    return np.ascontiguousarray(camera.rays(pixels)[..., :2])


def align(X: Array, Y: Array) -> tuple[Array, Array, float]:
    """Rotation, translation and scale s that minimise sum |s R X + t - Y|^2 (Umeyama, PAMI 1991, eq.
    40-42)."""
    X_mean, Y_mean = X.mean(axis=0), Y.mean(axis=0)
    X0, Y0 = X - X_mean, Y - Y_mean
    U, D, Vt = np.linalg.svd(Y0.T @ X0)
    S = np.array([1.0, 1.0, np.sign(np.linalg.det(U @ Vt)) or 1.0])  # a rotation, not a reflection
    R = (U * S) @ Vt
    variance = float(np.sum(X0**2))
    scale = float(D @ S) / variance if variance > 0.0 else 1.0
    return R, Y_mean - scale * R @ X_mean, scale


def reprojection_cost(X: Array, x: Array, R: Array, t: Array) -> float:
    """Sum of squared distances in the normalised image; infinite when most points are behind the camera."""
    Y = X @ R.T + t
    front = Y[:, 2] > 0.0
    if 2 * int(front.sum()) <= len(X):
        return float("inf")
    e = Y[front, :2] / Y[front, 2:] - x[front]
    return float(np.sum(e**2)) * len(X) / int(front.sum())


def best_pose(X: Array, x: Array, candidates: Iterable[Pose]) -> Pose | None:
    """The candidate with the smallest reprojection cost; None when none is in front of the camera."""
    best, least = None, float("inf")
    for R, t in candidates:
        cost = reprojection_cost(X, x, R, t)
        if cost < least:
            best, least = (R, t), cost
    return best


def turn_between(a: Array, b: Array) -> Array:
    """A rotation (3, 3) that takes the unit vector a to the unit vector b; which one is left open."""

    def frame(axis: Array) -> Array:
        other = np.eye(3)[int(np.argmin(np.abs(axis)))]
        y = np.cross(axis, other)
        y /= np.linalg.norm(y)
        return np.stack([np.cross(y, axis), y, axis], axis=1)

    return np.asarray(frame(b) @ frame(a).T)
