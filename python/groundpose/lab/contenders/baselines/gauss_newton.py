"""Least squares of the reprojection error over all given points from a start: the polishing step "GN"."""

from __future__ import annotations

import numpy as np

from groundpose.lab.contenders.baselines.geometry import Array, Pose


def gauss_newton(X: Array, x: Array, start: Pose, iterations: int = 10) -> Pose:
    """Gauss-Newton with step halving; rotation by a left perturbation, R <- exp(w) R.

    `X` (n, 3), `x` (n, 2) normalised image. Returns the start when it has a point at or behind the camera
    or the normal equations are singular.
    """
    R, t = start
    e, J = _residuals(X, x, R, t)
    if J is None:
        return start
    cost = float(e @ e)
    for _ in range(iterations):
        try:
            step = np.linalg.solve(J.T @ J, -(J.T @ e))
        except np.linalg.LinAlgError:
            break
        for shrink in (1.0, 0.5, 0.25, 0.125):
            R_new, t_new = _exp(shrink * step[:3]) @ R, t + shrink * step[3:]
            e_new, J_new = _residuals(X, x, R_new, t_new)
            if J_new is not None and float(e_new @ e_new) < cost:
                break
        else:
            break
        gain, cost = cost - float(e_new @ e_new), float(e_new @ e_new)
        R, t, e, J = R_new, t_new, e_new, J_new
        if gain < 1e-10 * cost:
            break
    return R, t


def _residuals(X: Array, x: Array, R: Array, t: Array) -> tuple[Array, Array | None]:
    """Residuals (2n,) and Jacobian (2n, 6); no Jacobian when a point is not in front of the camera."""
    rotated = X @ R.T
    Y = rotated + t
    z = Y[:, 2]
    if np.any(z <= 1e-9):
        return np.zeros(2 * len(X)), None
    p = Y[:, :2] / z[:, None]
    # d p / d Y = [I | -p] / z ; d Y / d w = -[rotated]_x ; d Y / d t = I
    J = np.zeros((2, len(X), 6))
    for k in range(2):
        g = np.zeros((len(X), 3))
        g[:, k], g[:, 2] = 1.0 / z, -p[:, k] / z
        J[k, :, :3], J[k, :, 3:] = _cross(rotated, g), g
    return (p - x).T.ravel(), J.reshape(-1, 6)


def _cross(a: Array, b: Array) -> Array:
    """np.cross for (n, 3), without its overhead."""
    return np.stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ],
        axis=1,
    )


def _exp(w: Array) -> Array:
    """Rodrigues' formula."""
    angle = float(np.linalg.norm(w))
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    if angle < 1e-8:
        return np.asarray(np.eye(3) + W + 0.5 * W @ W)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * W + (1.0 - np.cos(angle)) / angle**2 * W @ W)
