"""The best a solver could do: least squares on the TRUE inliers, started at the TRUE pose.

A floor for errors, not a method. Vectorised over trials (damped Gauss-Newton, analytic Jacobian), so that a
thousand scenes of 300 keypoints take a second or two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from groundpose.lab.contenders.contender import Answers
from groundpose.lab.contenders.objects import Array, Objects
from groundpose.lab.timing import Clock

ITERATIONS = 30
CHUNK = 100
"""Objects that are solved at once."""


@dataclass(frozen=True)
class Problem:
    """T trials. Angles are radians, pixels are undistorted."""

    keypoints_2d: Array
    """(T, P, 2)"""
    keypoints_3d: Array
    """(T, P, 3)"""
    inlier_truth: npt.NDArray[np.bool_]
    """(T, P); the rest is not looked at and may be NaN."""
    intrinsics: tuple[float, float, float, float]
    """fx, fy, cx, cy"""


def solve_6dof(problem: Problem, R: Array, t: Array) -> tuple[Array, Array]:
    """Least squares over rotation and translation from the start R (T, 3, 3), t (T, 3)."""
    return _solve(problem, R, t, None)


def solve_4dof(problem: Problem, R: Array, t: Array, R_camera_from_ground: Array) -> tuple[Array, Array]:
    """Least squares over yaw and translation, upright in the ground frame of the NOMINAL tilt (3, 3).

    The start keeps the yaw of R as seen in that frame and drops the rest.
    """
    forward = np.einsum("ji,tj->ti", R_camera_from_ground, R[:, :, 2])  # object's z in the ground frame
    yaw = np.arctan2(forward[:, 0], forward[:, 2])
    up = np.asarray(R_camera_from_ground[:, 1])
    start = rotation_from_vector(yaw[:, None] * up) @ R_camera_from_ground
    return _solve(problem, start, t, up)


def rotation_from_vector(w: Array) -> Array:
    """Rodrigues' formula, (T, 3) radians -> (T, 3, 3)."""
    angle = np.linalg.norm(w, axis=-1)[:, None, None]
    W = _skew(w)
    small = angle < 1e-8
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0, np.sin(safe) / safe)
    b = np.where(small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) + a * W + b * (W @ W))


def _skew(w: Array) -> Array:
    W = np.zeros((*w.shape[:-1], 3, 3))
    W[..., 0, 1], W[..., 0, 2], W[..., 1, 2] = -w[..., 2], w[..., 1], -w[..., 0]
    W[..., 1, 0], W[..., 2, 0], W[..., 2, 1] = w[..., 2], -w[..., 1], w[..., 0]
    return W


def residuals_and_jacobian(problem: Problem, R: Array, t: Array) -> tuple[Array, Array]:
    """Reprojection residuals (T, P, 2) and derivatives (T, P, 2, 6), zero where a keypoint is not an inlier.

    Columns: rotation vector that turns the object about its own origin in the camera frame (R <- exp(w) R),
    then translation.
    """
    fx, fy, cx, cy = problem.intrinsics
    inlier = problem.inlier_truth[..., None]
    rotated = np.where(inlier, problem.keypoints_3d, 0.0) @ np.swapaxes(R, 1, 2)
    X = rotated + t[:, None, :]
    z = X[..., 2]
    predicted = np.stack([fx * X[..., 0] / z + cx, fy * X[..., 1] / z + cy], axis=-1)
    residuals = np.where(inlier, predicted - np.where(inlier, problem.keypoints_2d, 0.0), 0.0)
    J_point = np.zeros((*z.shape, 2, 3))
    J_point[..., 0, 0], J_point[..., 0, 2] = fx / z, -fx * X[..., 0] / z**2
    J_point[..., 1, 1], J_point[..., 1, 2] = fy / z, -fy * X[..., 1] / z**2
    jacobian = np.concatenate([J_point @ -_skew(rotated), J_point], axis=-1)
    return residuals, np.where(inlier[..., None], jacobian, 0.0)


def _solve(problem: Problem, R: Array, t: Array, axis: Array | None) -> tuple[Array, Array]:
    """Damped Gauss-Newton for all trials at once; `axis` restricts the rotation to turns about it."""
    basis = np.eye(6)
    if axis is not None:
        basis = np.concatenate([np.concatenate([axis, np.zeros(3)])[:, None], np.eye(6)[:, 3:]], axis=1)
    damping = np.full(len(R), 1e-4)
    residuals, jacobian = residuals_and_jacobian(problem, R, t)
    cost = np.sum(residuals**2, axis=(1, 2))
    for _ in range(ITERATIONS):
        J = (jacobian @ basis).reshape(len(R), -1, basis.shape[1])
        normal = np.swapaxes(J, 1, 2) @ J
        gradient = np.swapaxes(J, 1, 2) @ residuals.reshape(len(R), -1, 1)
        diagonal = np.einsum("tii->ti", normal)
        damped = normal + (damping[:, None] * diagonal + 1e-12)[:, :, None] * np.eye(basis.shape[1])
        step = -(basis @ np.linalg.solve(damped, gradient))[..., 0]
        R_new, t_new = rotation_from_vector(step[:, :3]) @ R, t + step[:, 3:]
        residuals_new, jacobian_new = residuals_and_jacobian(problem, R_new, t_new)
        cost_new = np.sum(residuals_new**2, axis=(1, 2))
        better = cost_new < cost
        R, t = np.where(better[:, None, None], R_new, R), np.where(better[:, None], t_new, t)
        residuals = np.where(better[:, None, None], residuals_new, residuals)
        jacobian = np.where(better[:, None, None, None], jacobian_new, jacobian)
        converged = np.all(cost - cost_new <= 1e-12 * cost + 1e-20) and np.all(damping < 1e3)
        cost = np.where(better, cost_new, cost)
        damping = np.where(better, damping * 0.1, damping * 10.0)
        if converged:
            break
    return R, t


@dataclass(frozen=True)
class Oracle:
    """Least squares on the true inliers of objects with known truth: a floor beside the contenders."""

    degrees_of_freedom: int
    """6, or 4: upright in the nominal ground frame."""
    weighs_scores: bool = False
    slow_with_outliers: bool = False

    @property
    def name(self) -> str:
        """By its degrees of freedom."""
        return f"oracle {self.degrees_of_freedom}-DoF"

    @property
    def note(self) -> str:
        """What it knows."""
        if self.degrees_of_freedom == 6:
            return "least squares on the true inliers"
        return "the same, upright in the nominal ground frame"

    def missing(self) -> str | None:
        """It is always there."""
        return None

    def solve(self, objects: Objects, clock: Clock) -> Answers:
        """See `Contender`. Not timed: it starts at the truth."""
        assert objects.inlier_truth is not None
        parts = []
        for first in range(0, len(objects), CHUNK):  # memory: a Jacobian of 1000 scenes is half a gigabyte
            part = objects[first : first + CHUNK]
            assert part.inlier_truth is not None
            c = part.camera
            problem = Problem(
                part.keypoints_2d, part.keypoints_3d, part.inlier_truth, (c.fx, c.fy, c.cx, c.cy)
            )
            if self.degrees_of_freedom == 6:
                parts.append(solve_6dof(problem, part.R, part.t))
            else:
                parts.append(solve_4dof(problem, part.R, part.t, part.view.R_camera_from_ground))
        R, t = (np.concatenate(column) for column in zip(*parts, strict=True))
        return Answers(R, t, np.full(len(objects), np.nan))
