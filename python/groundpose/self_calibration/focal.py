r"""The focal length from how keypoints fit.

With a wrong focal length no pose of a vehicle that stands upright on the road explains its keypoints: a
profile likelihood over the logarithm x of the focal length, in which tilt, height, poses and shapes are
estimated anew. Its standard deviation comes from how the costs C of vehicles differ (the sandwich of Huber,
1967), so it needs no model of a network's errors:

$$ \sigma^2 = \sum_v g_v^2 \, / \, H^2, \qquad g_v = C_v'(x), \quad H = \sum_v C_v''(x) . $$
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
_COARSE = 0.15  # steps of the logarithm
_FINE = 0.05
_LARGEST = 1.2


@dataclass(frozen=True, eq=False)
class Focal:
    """The logarithm of the focal length over the given one, its standard deviation, how pitch, roll and log
    height change with it (3,), and the road at it. `profile` (K, 2): logarithms and costs."""

    log_factor: float
    sigma: float
    change: FloatArray
    road: Road
    profile: FloatArray


def estimate_focal(solver: Solver, sightings: Sightings, road: Road) -> Focal:
    """The focal length, from a road found with the one given.

    Raises:
        InputError: fewer than FEWEST vehicles; a profile without a minimum.
    """
    if road.contacts.vehicle_count < FEWEST:
        raise input_error("vehicles", f"at least {FEWEST} for the focal length", road.contacts.vehicle_count)
    upright = replace(solver, options=replace(solver.options, tilt_sigma=_UPRIGHT))
    probes: dict[float, tuple[Road, FloatArray]] = {}

    def probe(x: float) -> float:
        if x not in probes:
            near = min(probes, key=lambda known: abs(known - x), default=None)
            mean = (road if near is None else probes[near][0]).plane.mean
            found = upright.road(with_focal(sightings, x), (float(mean[PITCH]), float(mean[ROLL])))
            probes[x] = found, costs(found.poses, found.sightings)
        return float(probes[x][1].sum())

    lowest = _descend(probe, 0.0, _COARSE)
    low, middle, high = (probe(lowest + k * _COARSE) for k in (-1, 0, 1))
    centre = lowest + _vertex(low, middle, high, _COARSE)
    low, middle, high = (probe(centre + k * _FINE) for k in (-1, 0, 1))
    curvature = (low - 2.0 * middle + high) / _FINE**2
    if not curvature > 0.0:
        raise input_error("focal length", "vehicles that tell it: near ones, seen from several sides", "none")
    best = centre + _vertex(low, middle, high, _FINE)
    best_road = upright.road(with_focal(sightings, best), _tilt(probes[centre][0]))
    slopes = (probes[centre + _FINE][1] - probes[centre - _FINE][1]) / (2.0 * _FINE)
    _, vehicle = np.unique(sightings.vehicles, return_inverse=True)
    of_vehicle = np.bincount(vehicle, slopes)
    of_vehicle = of_vehicle - of_vehicle.mean()  # they add up to nothing at the minimum
    sigma = math.hypot(math.sqrt(float((of_vehicle**2).sum())) / curvature, SHAPES_SIGMA)
    ends = [probes[centre + k * _FINE][0].plane.mean[:3] for k in (-1, 1)]
    profile = np.array(sorted((x, float(c.sum())) for x, (_, c) in probes.items()))
    return Focal(best, sigma, (ends[1] - ends[0]) / (2.0 * _FINE), best_road, profile)


def _tilt(road: Road) -> tuple[float, float]:
    return float(road.plane.mean[PITCH]), float(road.plane.mean[ROLL])


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


def _descend(probe: Callable[[float], float], start: float, step: float) -> float:
    """A local minimum on a grid. Raises InputError when it runs away."""
    at = start
    while True:
        here, below, above = probe(at), probe(at - step), probe(at + step)
        if here <= min(below, above):
            return at
        at += step if above < below else -step
        if abs(at) > _LARGEST:
            expected = f"within a factor {math.exp(_LARGEST):.1f} of the true one"
            raise input_error("focal length", expected, "a fit that runs away from it")


def _vertex(low: float, middle: float, high: float, step: float) -> float:
    """Of the parabola through three points a step apart, from the middle one."""
    bend = low - 2.0 * middle + high
    return 0.0 if bend <= 0.0 else float(np.clip(0.5 * step * (low - high) / bend, -step, step))
