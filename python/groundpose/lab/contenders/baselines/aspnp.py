"""ASPnP: Zheng, Sugimoto, Okutomi, "ASPnP: An Accurate and Scalable Solution to the Perspective-n-Point
Problem", IEICE Transactions on Information and Systems E96-D(7), 2013.

The algebraic error of lambda_i (x_i, 1) = R X_i + t is linear in the entries of R and in t; t is eliminated,
and what remains is a quartic in a unit quaternion whose stationary points are all candidates. The paper finds
them with a Groebner basis in four cases; here see `quaternion`."""

from __future__ import annotations

import numpy as np

from groundpose.lab.contenders.baselines.geometry import Array, Pose, best_pose
from groundpose.lab.contenders.baselines.quaternion import minima, rotation_entries


def aspnp(X: Array, x: Array) -> Pose | None:
    """`X` (n, 3), `x` (n, 2) normalised image, n >= 4."""
    n, mean = len(X), X.mean(axis=0)
    X0 = X - mean
    A = np.zeros((2, n, 9))  # x_i (r3 . X_i) - r1 . X_i and the same with y and r2: rows of A r + B t = 0
    B = np.zeros((2, n, 3))
    for k in range(2):
        A[k, :, 6:], A[k, :, 3 * k : 3 * k + 3] = x[:, k, None] * X0, -X0
        B[k, :, 2], B[k, :, k] = x[:, k], -1.0
    A_rows, B_rows = A.reshape(-1, 9), B.reshape(-1, 3)
    t_from_r = np.linalg.solve(B_rows.T @ B_rows, -(B_rows.T @ A_rows))
    D = A_rows + B_rows @ t_from_r
    r = rotation_entries(minima(D.T @ D, None))
    return best_pose(X, x, ((R, t_from_r @ R.ravel() - R @ mean) for R in r.reshape(-1, 3, 3)))
