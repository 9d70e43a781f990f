"""Fitting a linear shape model to keypoints in space: rigid alignment and coefficients, in turns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundpose.lab.contenders.objects import Array

_TURNS = 60


class Fit(NamedTuple):
    """S shapes fitted: model = R shape + t."""

    R: Array
    """(S, 3, 3)."""
    t: Array
    """(S, 3)."""
    coefficients: Array
    """(S, M)."""
    residuals: Array
    """(S, P, 3) aligned shape minus model, metres."""


def fitted(
    shapes: Array, mean: Array, basis: Array, eigenvalues: Array | None = None, sigma: float = 0.0
) -> Fit:
    """Least squares over rotation, translation and coefficients.

    Args:
        shapes: (S, P, 3).
        mean: (P, 3); basis: (M, P, 3), possibly no modes.
        eigenvalues: (M,) variances of the coefficients; None: no prior.
        sigma: standard deviation of a coordinate, used with the prior.
    """
    modes = basis.reshape(len(basis), mean.size)
    normal = modes @ modes.T + (0.0 if eigenvalues is None else np.diag(sigma**2 / eigenvalues))
    coefficients = np.zeros((len(shapes), len(basis)))
    for _ in range(_TURNS):
        model = mean + np.tensordot(coefficients, basis, axes=1)
        R, t = rigid(shapes, model)
        aligned = shapes @ R.swapaxes(1, 2) + t[:, None]
        target = (aligned - mean).reshape(len(shapes), -1)
        if len(basis):
            coefficients = np.linalg.solve(normal, modes @ target.T).T
    model = mean + np.tensordot(coefficients, basis, axes=1)
    return Fit(R, t, coefficients, aligned - model)


def rigid(shapes: Array, targets: Array) -> tuple[Array, Array]:
    """Rotations (S, 3, 3) and translations (S, 3) that bring shapes (S, P, 3) closest to targets (Kabsch)."""
    targets = np.broadcast_to(targets, shapes.shape)
    a, b = shapes.mean(axis=1, keepdims=True), targets.mean(axis=1, keepdims=True)
    u, _, vt = np.linalg.svd((targets - b).swapaxes(1, 2) @ (shapes - a))
    sign = np.ones((len(shapes), 3))
    sign[:, 2] = np.linalg.det(u @ vt)
    R = (u * sign[:, None]) @ vt
    return R, b[:, 0] - np.einsum("sij,sj->si", R, a[:, 0])


def rigidly_aligned(shapes: Array) -> Array:
    """Shapes (S, P, 3) aligned to their own mean, without scaling."""
    aligned = shapes - shapes.mean(axis=1, keepdims=True)
    for _ in range(10):
        R, t = rigid(aligned, aligned.mean(axis=0))
        aligned = aligned @ R.swapaxes(1, 2) + t[:, None]
    return np.asarray(aligned)


def mirrored(shapes: Array, flip: Array) -> Array:
    """Mirror images (S, P, 3) in x, left and right exchanged, aligned to the shapes."""
    other = shapes[:, flip] * np.array([-1.0, 1.0, 1.0])
    R, t = rigid(other, shapes)
    return np.asarray(other @ R.swapaxes(1, 2) + t[:, None])


def reached(aligned: Array, basis: Array | None, own_modes: int = 0) -> float:
    """Fraction of the variance of aligned shapes (S, P, 3) about their mean that modes can follow.

    Args:
        aligned: as from `rigidly_aligned`.
        basis: (M, P, 3), with small rotations and translations added; None: the shapes' own first
            `own_modes` principal components.
    """
    mean = aligned.mean(axis=0)
    spread = (aligned - mean).reshape(len(aligned), -1)
    if basis is None:
        variance = np.linalg.svd(spread, compute_uv=False) ** 2
        return float(variance[:own_modes].sum() / variance.sum())
    turns = [np.cross(axis, mean).ravel() for axis in np.eye(3)]
    shifts = [np.tile(axis, len(mean)) for axis in np.eye(3)]
    q, _ = np.linalg.qr(np.stack([*basis.reshape(len(basis), -1), *turns, *shifts]).T)
    return float(np.sum((spread @ q) ** 2) / np.sum(spread**2))
