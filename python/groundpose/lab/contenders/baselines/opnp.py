"""OPnP: Zheng, Kuang, Sugimoto, Astrom, Okutomi, "Revisiting the PnP Problem: A Fast, General and Optimal
Solution", ICCV 2013.

A quaternion of free length carries the reciprocal of the mean depth as a scale, so the cost is a quartic
without constraint. The paper finds its stationary points, four cubic equations, with a Groebner basis and
polishes them with Newton's method ("OPnP+N"); here Newton's method starts from a cover of all rotations, see
`quaternion`, so its answer is polished already."""

from __future__ import annotations

import numpy as np

from groundpose.lab.contenders.baselines.geometry import Array, Pose, best_pose
from groundpose.lab.contenders.baselines.quaternion import minima, rotation_entries


def opnp(X: Array, x: Array) -> Pose | None:
    """`X` (n, 3), `x` (n, 2) normalised image, n >= 4."""
    n, mean = len(X), X.mean(axis=0)
    X0 = X - mean
    # with the mean depth 1: (1 + r3 . X0_i) x_i = r1 . X0_i + t1, and the same with y, r2, t2 (t of the
    # centroid)
    A = np.zeros((2, n, 9))
    for k in range(2):
        A[k, :, 6:], A[k, :, 3 * k : 3 * k + 3] = x[:, k, None] * X0, -X0
    offset = A.mean(axis=1)  # t1 = mean(x) + offset . r : the least-squares t, eliminated by centring
    x_mean = x.mean(axis=0)
    D = (A - offset[:, None, :]).reshape(-1, 9)
    c = (x - x_mean).T.ravel()
    q = minima(D.T @ D, D.T @ c)
    scaled = rotation_entries(q)
    poses = []
    for r, s in zip(scaled, np.sum(q**2, axis=1), strict=True):  # r = s R, s = 1 / mean depth
        R = r.reshape(3, 3) / s
        centroid = np.array([*(x_mean + offset @ r), 1.0]) / s
        poses.append((R, centroid - R @ mean))
    return best_pose(X, x, poses)
