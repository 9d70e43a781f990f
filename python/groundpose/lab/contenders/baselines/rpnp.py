"""RPnP: Li, Xu, Xie, "A Robust O(n) Solution to the Perspective-n-Point Problem", PAMI 34(7), 2012.

All 3-point subsets that contain one chosen pair of points share one unknown, the ratio of the pair's
depths, and each gives a quartic in it. The sum of their squares is minimised over the real axis: the real
roots of its derivative, degree seven. The pair's direction then fixes two rotations, and the third and the
translation follow from a linear system.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from groundpose.lab.contenders.baselines.geometry import Array, Pose, align, best_pose, turn_between


def rpnp(X: Array, x: Array) -> Pose | None:
    """`X` (n, 3), `x` (n, 2) normalised image, n >= 4."""
    rays = np.column_stack([x, np.ones(len(x))])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    # the pair farthest apart in the image (the paper looks at n random pairs)
    i, j = np.unravel_index(int(np.argmin(rays @ rays.T)), (len(x), len(x)))
    return best_pose(X, x, list(_candidates(X, x, rays, int(i), int(j))))


def _candidates(X: Array, x: Array, rays: Array, i: int, j: int) -> Iterator[Pose]:
    """One pose a local minimum of the sum of squared quartics."""
    length = float(np.linalg.norm(X[j] - X[i]))
    if length < 1e-12:
        return
    c = float(rays[i] @ rays[j])
    for w in _local_minima(_quartics(X, rays, i, j)):
        ratio = w + c
        direction = ratio * rays[j] - rays[i]  # depth of point i is 1
        direction /= np.linalg.norm(direction)
        R_axis = turn_between((X[j] - X[i]) / length, direction)
        pose = _about_axis(X, x, R_axis, direction)
        if pose is not None:
            yield pose


def _quartics(X: Array, rays: Array, i: int, j: int) -> Array:
    """(n - 2, 5) coefficients, highest power first, of all subsets (i, j, k); w = depth_j / depth_i - c_ij.

    With depths 1, u, v and the law of cosines (Grunert 1841):  1 + v^2 - 2 v c_ik = a Q,
    u^2 + v^2 - 2 u v c_jk = b Q,  Q = 1 + u^2 - 2 u c_ij,  a = d_ik^2 / d_ij^2,  b = d_jk^2 / d_ij^2.
    Their difference is linear in v: v = N / M; inserted in the first, N^2 - 2 c_ik N M + M^2 (1 - a Q) = 0.
    """
    others = np.delete(np.arange(len(X)), [i, j])
    squared = np.sum((X[j] - X[i]) ** 2)
    a = np.sum((X[others] - X[i]) ** 2, axis=1) / squared
    b = np.sum((X[others] - X[j]) ** 2, axis=1) / squared
    c, c_i, c_j = float(rays[i] @ rays[j]), rays[others] @ rays[i], rays[others] @ rays[j]
    s2 = 1.0 - c * c  # Q = w^2 + s2
    N = np.stack([a - b + 1.0, np.full_like(a, 2.0 * c), (a - b) * s2 + c * c - 1.0])
    M = np.stack([2.0 * c_j, 2.0 * (c * c_j - c_i)])
    rest = np.stack([-a, np.zeros_like(a), 1.0 - a * s2])
    quartic = _multiply(N, N) + _multiply(_multiply(M, M), rest)
    quartic[1:] -= 2.0 * c_i * _multiply(N, M)
    return np.asarray(quartic.T)


def _multiply(p: Array, q: Array) -> Array:
    """Products of polynomials, coefficients along the first axis, highest power first."""
    product = np.zeros((len(p) + len(q) - 1, p.shape[1]))
    for k, factor in enumerate(p):
        product[k : k + len(q)] += factor * q
    return product


def _local_minima(quartics: Array) -> Array:
    """Real w where the sum of the squared quartics has a local minimum."""
    gram = quartics.T @ quartics
    octic = np.array([np.trace(gram[:, ::-1], offset=4 - k) for k in range(9)])  # sums of antidiagonals
    slope = np.polyder(octic)
    roots = np.roots(slope)
    real = roots.real[np.abs(roots.imag) <= 1e-3 * np.maximum(np.abs(roots.real), 1e-3)]
    return np.asarray(real[np.polyval(np.polyder(slope), real) > 0.0])


def _about_axis(X: Array, x: Array, R_axis: Array, axis: Array) -> Pose | None:
    """Angle about the axis and translation by a linear system, then depths and alignment.

    R = exp(angle [axis]) R_axis, so R X = cos P + sin Q + S, with P the part of R_axis X across the axis,
    Q = axis x P and S the part along it; unknowns cos, sin, t up to scale.
    """
    turned = X @ R_axis.T
    S = np.outer(turned @ axis, axis)
    P = turned - S
    Q = np.cross(axis, P)
    n = len(X)
    A = np.zeros((2, n, 6))  # columns cos, sin, t1, t2, t3, 1
    for k in range(2):
        for column, part in ((0, P), (1, Q), (5, S)):
            A[k, :, column] = part[:, k] - x[:, k] * part[:, 2]
        A[k, :, 2 + k], A[k, :, 4] = 1.0, -x[:, k]
    rows = A.reshape(-1, 6)
    v = np.linalg.eigh(rows.T @ rows)[1][:, 0]
    if abs(v[5]) < 1e-12:
        return None
    cosine, sine, *t = v[:5] / v[5]
    depth = cosine * P[:, 2] + sine * Q[:, 2] + S[:, 2] + t[2]
    rays = np.column_stack([x, np.ones(n)])
    if np.median(depth) <= 0.0:
        return None
    R, t_camera, scale = align(X, depth[:, None] * rays)
    return R, t_camera / scale if scale > 0 else t_camera
