"""Minima of a cost that is quadratic in a rotation matrix given by a quaternion: what ASPnP and OPnP share.

Both papers write the cost as f(q) = r(q)' M r(q) + 2 b' r(q) with r(q) the nine entries of q's (scaled)
rotation matrix, quadratic in q, and find all its stationary points with a Groebner basis. Only minima matter
for the pose, so here they are found by a damped Newton method from 24 rotations that cover all rotations (the
symmetries of the cube, at most 63 degrees from any), all at once, with the exact gradient and Hessian."""

from __future__ import annotations

import itertools

import numpy as np

from groundpose.lab.contenders.baselines.geometry import Array

KEEP = 8
"""Starts that are followed to the end after the first steps."""
FIRST_STEPS, LAST_STEPS = 6, 60


def _forms() -> Array:
    """(9, 4, 4) symmetric T_k: entry k (row by row) of |q|^2 R(q) is q' T_k q, q = (w, x, y, z)."""
    T = np.zeros((3, 3, 4, 4))
    for i in range(3):
        T[i, i] = np.diag([1.0, *(1.0 if k == i else -1.0 for k in range(3))])
        j, k = (i + 1) % 3, (i + 2) % 3
        for row, column, sign in ((i, j, -1.0), (j, i, 1.0)):  # R_ij = 2 (q_i q_j -+ w q_k)
            for a, b, value in ((1 + i, 1 + j, 1.0), (0, 1 + k, sign)):
                T[row, column, a, b] = T[row, column, b, a] = value
    return T.reshape(9, 4, 4)


def _cube_rotations() -> Array:
    """(24, 4) unit quaternions of the rotations that map a cube to itself, one of each pair q, -q."""
    pairs = [
        [s if k in pair else 0.0 for k, s in zip(range(4), signs, strict=True)]
        for pair in itertools.combinations(range(4), 2)
        for signs in itertools.product([1.0, -1.0], repeat=4)
    ]
    signs = [list(s) for s in itertools.product([0.5, -0.5], repeat=4)]
    q = np.array([*np.eye(4), *signs, *(np.array(pairs) * np.sqrt(0.5))])
    first = np.array([row[np.flatnonzero(row)[0]] for row in q])
    return np.unique(np.round(q * np.sign(first)[:, None], 12), axis=0)


T = _forms()
STARTS = _cube_rotations()
_T2 = 2.0 * T.transpose(2, 0, 1).reshape(4, 36)


def rotation_entries(q: Array) -> Array:
    """(S, 4) -> (S, 9): the entries of |q|^2 R(q), row by row."""
    return np.asarray(0.5 * np.einsum("skj,sj->sk", _jacobian(q), q))


def _jacobian(q: Array) -> Array:
    return np.asarray((q @ _T2).reshape(-1, 9, 4))


def minima(M: Array, b: Array | None) -> Array:
    """Local minima (S, 4) of f(q), equal ones left out, lowest first.

    `M` (9, 9) symmetric, non-negative. `b` None: f = r' M r on the unit sphere (ASPnP, |q| = 1);
    `b` (9,): f = r' M r + 2 b' r over all quaternions, whose length is a scale (OPnP).
    """
    size = float(np.trace(M))
    M, sphere = M / size, b is None
    b = np.zeros(9) if b is None else b / size
    q = STARTS if sphere else _scaled(STARTS, M, b)
    q, f = _descend(q, M, b, sphere, FIRST_STEPS)
    q, f = _descend(q[np.argsort(f)[:KEEP]], M, b, sphere, LAST_STEPS)
    q = q[np.argsort(f)]
    unit = q / np.linalg.norm(q, axis=1, keepdims=True)
    same = np.triu(np.abs(unit @ unit.T) > 1.0 - 1e-10, 1).any(axis=0)
    return np.asarray(q[~same])


def _scaled(q: Array, M: Array, b: Array) -> Array:
    """Starts with the length that is best for their direction: f is a parabola in |q|^2."""
    r = rotation_entries(q)
    squared = -(r @ b) / np.maximum(np.einsum("si,ij,sj->s", r, M, r), 1e-300)
    typical = np.median(np.abs(squared))
    return np.asarray(q * np.sqrt(np.where(squared > 0.0, squared, typical))[:, None])


def _cost(q: Array, M: Array, b: Array) -> Array:
    r = rotation_entries(q)
    return np.asarray(np.sum(r * (r @ M + 2.0 * b), axis=1))


def _descend(q: Array, M: Array, b: Array, sphere: bool, steps: int) -> tuple[Array, Array]:
    """Levenberg's method with the exact Hessian on every row of q."""
    eye = np.eye(4)
    damping = np.full(len(q), 1e-3)
    f = _cost(q, M, b)
    for _ in range(steps):
        J = _jacobian(q)
        r = 0.5 * (J @ q[:, :, None])[:, :, 0]
        w = r @ M + b
        g = 2.0 * (w[:, None, :] @ J)[:, 0, :]
        JtMJ = np.swapaxes(J, 1, 2) @ (M @ J)
        H = 2.0 * JtMJ + 4.0 * (w @ T.reshape(9, 16)).reshape(-1, 4, 4)
        if sphere:  # gradient and Hessian along the sphere; qq' makes the system regular
            qq = q[:, :, None] * q[:, None, :]
            P = eye - qq
            H = P @ (H - np.sum(q * g, axis=1)[:, None, None] * eye) @ P + qq
            g = (P @ g[:, :, None])[:, :, 0]
        scale = np.einsum("sii->s", JtMJ) + 1e-300
        values, vectors = np.linalg.eigh(H)
        # downhill also where the Hessian is not positive
        values = np.maximum(np.abs(values), 1e-12 * scale[:, None]) + (damping * scale)[:, None]
        along = (np.swapaxes(vectors, 1, 2) @ g[:, :, None])[:, :, 0] / values
        q_new = q - (vectors @ along[:, :, None])[:, :, 0]
        if sphere:
            q_new /= np.linalg.norm(q_new, axis=1, keepdims=True)
        f_new = _cost(q_new, M, b)
        better = f_new <= f
        moved = np.abs(q_new - q).max(axis=1) / np.linalg.norm(q, axis=1)
        q, f = np.where(better[:, None], q_new, q), np.where(better, f_new, f)
        damping = np.where(better, 0.05 * damping, 20.0 * damping)
        if np.all((moved < 1e-10) | (damping > 1e8)):
            break
    return q, f
