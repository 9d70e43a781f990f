r"""The focal length from how keypoints fit.

With a wrong focal length or tilt no pose of a vehicle that stands upright explains its keypoints. The cost C
of all keypoints is minimised over the logarithm of the focal length, pitch and roll; poses and shapes are
estimated anew for each. The covariance of the minimum comes from how the costs of vehicles differ (the
sandwich of Huber, 1967), so it needs no model of a network's errors:

$$ S = H^{-1} \Big( \sum_v g_v g_v^T \Big) H^{-1}, \qquad g_v = \nabla C_v, \quad H = \sum_v \nabla^2 C_v . $$

The contacts tell pitch and roll too, which change with the focal length; both are put together by their
covariances.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from groundpose._checks import FloatArray, input_error
from groundpose.poses import PoseBatch
from groundpose.self_calibration.plane import PITCH, ROLL
from groundpose.self_calibration.sightings import Sightings
from groundpose.self_calibration.solve import Road, Solver

FEWEST = 30
"""Vehicles from which on a focal length is estimated."""
SHAPES_SIGMA = 0.02
"""Standard deviation of its logarithm by what vehicles share: proportions of classes, habits of a network."""

_UPRIGHT = 0.015  # radians, lean of vehicles against the road
_NOISE = 0.015  # of a keypoint, over the longer side of the box
_STEPS = np.array([0.06, math.radians(1.0), math.radians(1.0)])  # of the derivatives
_TILT = slice(PITCH, ROLL + 1)
_MOST_STEPS = 2.5  # of a Newton step
_ROUNDS, _CLOSE = 12, 0.15
_LARGEST = 1.2

Probe = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Focal:
    """The logarithm of the focal length over the given one, its standard deviation, how pitch, roll and log
    height of the plane change with it (3,), and the road at it."""

    log_factor: float
    sigma: float
    change: FloatArray
    road: Road


def estimate_focal(solver: Solver, sightings: Sightings, road: Road) -> Focal:
    """The focal length, from a road found with the one given.

    Raises:
        InputError: fewer than FEWEST vehicles; keypoints that do not tell it.
    """
    if road.contacts.vehicle_count < FEWEST:
        raise input_error("vehicles", f"at least {FEWEST} for the focal length", road.contacts.vehicle_count)
    upright = replace(solver, options=replace(solver.options, tilt_sigma=_UPRIGHT))
    _, vehicle = np.unique(sightings.vehicles, return_inverse=True)

    def probe(at: FloatArray) -> FloatArray:
        seen = with_focal(sightings, float(at[0]))
        each = costs(upright.poses(seen, float(at[1]), float(at[2])), seen)
        return np.asarray(np.bincount(vehicle, each), dtype=np.float64)

    at, covariance = _minimum(probe, np.array([0.0, *road.plane.mean[_TILT]]))
    step = float(_STEPS[0])
    low, middle, high = (
        solver.road(with_focal(sightings, float(at[0]) + k * step), (float(at[1]), float(at[2])))
        for k in (-1.0, 0.0, 1.0)
    )
    change = (high.plane.mean[:3] - low.plane.mean[:3]) / (2.0 * step)
    # what the contacts say: tilt = that of the plane, which changes with the focal length
    design = np.column_stack([-change[_TILT], np.eye(2)])
    said = design.T @ np.linalg.inv(middle.plane.covariance[_TILT, _TILT])
    together = np.linalg.inv(np.linalg.inv(covariance) + said @ design)
    moved = together @ said @ (middle.plane.mean[_TILT] - at[1:])
    best = float(at[0] + moved[0])
    tilt = middle.plane.mean[_TILT] + change[_TILT] * moved[0]
    final = solver.road(with_focal(sightings, best), (float(tilt[0]), float(tilt[1])))
    return Focal(best, math.hypot(math.sqrt(together[0, 0]), SHAPES_SIGMA), change, final)


def _minimum(probe: Probe, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where the costs of vehicles are least, and its covariance.

    Raises:
        InputError: costs that tell nothing.
    """
    at = start
    for _ in range(_ROUNDS):
        gradients, hessian = _derivatives(probe, at)
        values, axes = np.linalg.eigh(hessian)
        # away from the minimum the costs bend down: go against the slope there
        bend = axes @ np.diag(np.maximum(np.abs(values), 1e-3 * np.abs(values).max())) @ axes.T
        step = -np.linalg.solve(bend, gradients.sum(axis=0))
        step = step / max(1.0, float(np.abs(step).max()) / _MOST_STEPS)
        at = at + step * _STEPS
        if abs(float(at[0] - start[0])) > _LARGEST:
            expected = f"a guess within a factor {math.exp(_LARGEST):.1f}"
            raise input_error("focal length", expected, "a fit that runs away from it")
        if float(np.abs(step).max()) < _CLOSE:
            break
    if values.min() <= 0.0:
        raise input_error("focal length", "vehicles that tell it: near ones, seen from several sides", "none")
    centred = gradients - gradients.mean(axis=0)  # they add up to nothing at the minimum
    bread = np.linalg.inv(hessian)
    return at, np.outer(_STEPS, _STEPS) * (bread @ centred.T @ centred @ bread)


def _derivatives(probe: Probe, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gradients (V, 3) of the costs of vehicles and the Hessian (3, 3) of their sum, by steps."""
    here, axes = probe(at), np.diag(_STEPS)
    ends = [[probe(at + sign * axis) for sign in (-1.0, 1.0)] for axis in axes]
    gradients = np.stack([0.5 * (high - low) for low, high in ends], axis=1)
    hessian = np.diag([float((low - 2.0 * here + high).sum()) for low, high in ends])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        both = [float(probe(at + sign * (axes[i] + axes[j])).sum()) for sign in (-1.0, 1.0)]
        cross = 0.5 * (sum(both) - 2.0 * float(here.sum()) - hessian[i, i] - hessian[j, j])
        hessian[i, j] = hessian[j, i] = cross
    return gradients, hessian


def with_focal(sightings: Sightings, log_factor: float) -> Sightings:
    """The same seen by a camera with another focal length."""
    camera, factor = sightings.camera, math.exp(log_factor)
    return sightings.seen_by(replace(camera, fx=camera.fx * factor, fy=camera.fy * factor))


def costs(poses: PoseBatch, sightings: Sightings) -> FloatArray:
    """(N,) robust costs of the keypoints; those of a sighting without a pose are as large as can be."""
    longer = (sightings.bboxes[:, 2:] - sightings.bboxes[:, :2]).max(axis=1)
    found = np.zeros(len(sightings))
    for i, scores in enumerate(sightings.keypoint_scores):
        residuals = poses.residuals[i, : len(scores)] / (_NOISE * longer[i])
        seen = ~np.isnan(sightings.keypoints_2d[i]).any(axis=1)
        squares = np.where(np.isnan(residuals), np.inf, residuals**2)
        found[i] = float((scores * _robust(squares))[seen].sum())
    return found


def _robust(squares: FloatArray) -> FloatArray:
    """Geman and McClure's, 9 at most."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(np.isinf(squares), 9.0, squares / (1.0 + squares / 9.0)))
