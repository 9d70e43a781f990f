"""The linear system of EPnP and the pose from its kernel by Procrustes: what EPPnP and REPPnP share.

Every point is a fixed affine combination of control points (Lepetit, Moreno-Noguer, Fua, IJCV 2009, sec. 3.1
and 3.2; three control points when the object is planar), so the camera coordinates of the control points are
in the kernel of a linear system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundpose.lab.contenders.baselines.geometry import Array, Pose, align, best_pose

PLANAR = 1e-6
"""Thickness over extent below which an object counts as planar."""
KERNEL = 4
"""Kernel vectors that are considered (Ferraz et al. 2014, for a general object). A planar object
gets as many, our choice: with one its rotation error is three times larger."""
ALTERNATIONS = 10


@dataclass(frozen=True)
class System:
    """Two equations a point, linear in the control points' camera coordinates."""

    X: Array
    x: Array
    controls: Array
    """(C, 3), object frame; C = 4, or 3 for a planar object."""
    weights: Array
    """(n, C): X = weights @ controls."""

    @classmethod
    def of(cls, X: Array, x: Array) -> System:
        """Control points: centroid, and one step of a standard deviation along each principal direction."""
        mean = X.mean(axis=0)
        values, vectors = np.linalg.eigh((X - mean).T @ (X - mean) / len(X))
        sizes = np.sqrt(np.maximum(values, 0.0))
        axes = np.flatnonzero(sizes > PLANAR * sizes[-1])
        along = (X - mean) @ vectors[:, axes] / sizes[axes]
        controls = np.vstack([mean, mean + (vectors[:, axes] * sizes[axes]).T])
        return cls(X, x, controls, np.column_stack([1.0 - along.sum(axis=1), along]))

    def kernel(self, used: Array) -> Array:
        """Eigenvectors (3C, k) of M'M over the rows `used` (n,) of weight 1 or 0, smallest eigenvalue last.

        Unknowns: all x, all y, all z of the control points.
        """
        W, u = self.weights, self.x
        C = W.shape[1]
        M = np.zeros((2, len(W), 3, C))
        for k in range(2):
            M[k, :, k], M[k, :, 2] = W, -u[:, k, None] * W
        rows = (M * used[None, :, None, None]).reshape(-1, 3 * C)
        vectors = np.linalg.eigh(rows.T @ rows)[1]
        return np.asarray(vectors[:, :KERNEL][:, ::-1])

    def algebraic_errors(self, v: Array) -> Array:
        """(n,) norm of each point's two equations at the control points `v` (3C,)."""
        Y = self.weights @ v.reshape(3, -1).T
        return np.asarray(np.linalg.norm(Y[:, :2] - self.x * Y[:, 2:], axis=1))

    def pose(self, kernel: Array, used: Array) -> Pose | None:
        """Control points from the kernel and the pose that aligns them (Ferraz et al. 2014).

        First the last kernel vector alone; then alternately the nearest vector of the whole kernel to the
        aligned control points, and the alignment with it. The sign of the first vector is the one that
        puts the points in front.
        """
        rows = used > 0
        first = kernel[:, -1].reshape(3, -1).T
        if np.mean(self.weights[rows] @ first[:, 2]) < 0.0:
            first = -first
        pose = self._aligned(first)
        least = float("inf")
        for _ in range(ALTERNATIONS):
            R, t = pose
            target = (self.controls @ R.T + t).T.ravel()
            nearest = kernel @ (kernel.T @ target)
            error = float(np.linalg.norm(nearest - target) / np.linalg.norm(target))
            if error >= least * (1.0 - 1e-9):
                break
            least = error
            pose = self._aligned(nearest.reshape(3, -1).T)
        return best_pose(self.X[rows], self.x[rows], [pose])

    def _aligned(self, camera: Array) -> Pose:
        """Pose from control points in the camera up to scale."""
        R, t, scale = align(self.controls, camera)
        return R, t / scale
