"""How often stated regions hold the truth, and how much larger than the errors they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose import PoseBatch, region_radius2
from groundpose._checks import FloatArray

WINDOWS = {0.5: (0.45, 0.65), 0.9: (0.87, 0.95), 0.95: (0.93, 0.98)}
"""Levels, and between which fractions of the truth their regions are to hold: they lean to the safe side."""
LEVELS = (0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)
QUANTITIES = ("pose", "R", "t", "yaw", "distance", "lateral")
"""All six degrees of freedom; rotation; translation; about the ground's normal; along the ray; across it."""
_MAD = 1.4826
"""From the median absolute deviation of a Gaussian to its standard deviation."""


@dataclass(frozen=True, eq=False)
class Stated:
    """Errors of N poses and what was stated of them.

    Attributes:
        errors: (N, 6) rotation vector from the estimated to the true rotation, then true minus estimated t.
        covariance: (N, 6, 6) stated.
        t: (N, 3) estimated. up: (N, 3) or (3,) the ground's normal (downwards) in the camera.
    """

    errors: FloatArray
    covariance: FloatArray
    t: FloatArray
    up: FloatArray

    @classmethod
    def of(cls, poses: PoseBatch, R: FloatArray, t: FloatArray) -> Stated:
        """Of poses with an answer whose truth is `R` and `t`."""
        ok = poses.ok
        up = np.asarray(poses.view.R_camera_from_ground[:, 1])
        return cls(errors(R[ok], t[ok], poses.R[ok], poses.t[ok]), poses.covariance[ok], poses.t[ok], up)

    def only(self, rows: NDArray[np.bool_]) -> Stated:
        """Those in a mask (N,)."""
        up = np.broadcast_to(self.up, self.t.shape)
        return Stated(self.errors[rows], self.covariance[rows], self.t[rows], up[rows])

    @property
    def directions(self) -> dict[str, FloatArray]:
        """(N, d, 6): what of an error each of `QUANTITIES` looks at."""
        count = len(self.t)
        ray = self.t / np.linalg.norm(self.t, axis=1, keepdims=True)
        up = np.broadcast_to(self.up, ray.shape)
        across = np.cross(up, ray)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        whole = np.broadcast_to(np.eye(6), (count, 6, 6))
        none = np.zeros((count, 3))

        def row(turn: FloatArray, move: FloatArray) -> FloatArray:
            return np.concatenate([turn, move], axis=1)[:, None]

        parts = (whole, whole[:, :3], whole[:, 3:], row(up, none), row(none, ray), row(none, across))
        return dict(zip(QUANTITIES, parts, strict=True))

    def sizes(self) -> dict[str, float]:
        """Median radius of the one-sigma ellipsoid of each of `QUANTITIES`: of the ball as large as it."""
        found = {}
        for name, looked_at in self.directions.items():
            own = looked_at @ self.covariance @ np.swapaxes(looked_at, 1, 2)
            half_logs = 0.5 * np.linalg.slogdet(own)[1] / looked_at.shape[1]
            found[name] = float(np.exp(np.median(half_logs)))
        return found

    def squared_distances(self) -> dict[str, tuple[int, FloatArray]]:
        """Dimensions and (N,) squared Mahalanobis distances of each of `QUANTITIES`."""
        found = {}
        for name, looked_at in self.directions.items():
            error = np.einsum("ndj,nj->nd", looked_at, self.errors)
            own = looked_at @ self.covariance @ np.swapaxes(looked_at, 1, 2)
            d2 = np.einsum("nd,nd->n", error, np.linalg.solve(own, error[..., None])[..., 0])
            found[name] = (looked_at.shape[1], d2)
        return found


def errors(R_true: FloatArray, t_true: FloatArray, R: FloatArray, t: FloatArray) -> FloatArray:
    """(N, 6) as in `Stated`."""
    return np.concatenate([rotation_vectors(R_true @ np.swapaxes(R, 1, 2)), t_true - t], axis=1)


def rotation_vectors(R: FloatArray) -> FloatArray:
    """(N, 3) of rotations (N, 3, 3) by less than 180 degrees."""
    axis = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    sine = 0.5 * np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0))
    scale = np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)
    return np.asarray(0.5 * axis * scale[:, None])


def inside(stated: Stated, dof: float) -> dict[str, dict[str, float]]:
    """`{quantity: {level in %: percentage of the true values inside}}` for errors of Student's t."""
    return {
        name: {
            f"{100 * level:g}": float(100 * np.mean(d2 <= region_radius2(level, dimensions, dof)))
            for level in LEVELS
        }
        for name, (dimensions, d2) in stated.squared_distances().items()
    }


def sharpness(stated: Stated) -> dict[str, float]:
    """Median stated standard deviation over the errors' robust one, by quantity of one dimension."""
    found = {}
    for name, looked_at in stated.directions.items():
        if looked_at.shape[1] == 1:
            error = np.einsum("ndj,nj->n", looked_at, stated.errors)
            sigma = np.sqrt((looked_at @ stated.covariance @ np.swapaxes(looked_at, 1, 2))[:, 0, 0])
            actual = _MAD * np.median(np.abs(error - np.median(error)))
            found[name] = float(np.median(sigma) / actual)
    return found


def covered(stated: Stated, dof: float) -> dict[str, Any]:
    """Percentages inside the regions, least and most of each level of `WINDOWS`, and the sharpness."""
    found = inside(stated, dof)
    levels = [f"{100 * level:g}" for level in WINDOWS]
    return {
        "answers": len(stated.t),
        "inside": found,
        "least": {level: min(by[level] for by in found.values()) for level in levels},
        # the distance may hold more: its error is mostly the size of the vehicle
        "most": {level: max(by[level] for q, by in found.items() if q != "distance") for level in levels},
        "sharpness": sharpness(stated),
    }
