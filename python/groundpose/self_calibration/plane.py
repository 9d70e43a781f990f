r"""The road under a camera from where vehicles touch it.

A vehicle that is $e^s$ times as large as supposed is as many times farther away. Its contact, estimated at
$c$, then satisfies

$$ \log(n(\theta) \cdot c) = \log h - s_{class} - s_{own} + \varepsilon $$

with the road's normal $n$ by pitch and roll, and the camera's height $h$. Unknown are pitch, roll, $\log h$
and the log mean size of each class, which has a prior; the own size is the same in all sightings of a
vehicle. Sizes alone leave the product of height and size open: its uncertainty is that of the classes' means,
and is stated.

Errors of poses are partly the same in all sightings of a vehicle (SHARED), and Student's t: sightings and
vehicles that disagree weigh less.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.self_calibration.contacts import Contacts
from groundpose.types import Camera, View

PITCH, ROLL, HEIGHT, CLASSES = 0, 1, 2, 3

SHARED = 0.5
"""Fraction of the variance of a pose's error that all sightings of a vehicle share."""
CONTACT_SIGMA = 0.04
"""Metres by which all contacts are too high or too low: shapes of a class, a network's habit."""
ROUGHNESS, SLOPE = 0.041, math.radians(0.4)
"""Of the road under a vehicle about the plane: metres, and radians in proportion to the distance; roads bend
by half a metre within 75 m."""
_DOF = 4.0
_ITERATIONS = 40
_WIDE = (1.0, 0.3, 3.0)  # priors of pitch, roll and log height where nothing is known
_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Plane:
    """What the contacts say: `mean` and `covariance` of pitch, roll, log height, log mean size of each class.

    Attributes:
        weights: (N,) of the contacts, 1 for those that agree.
        misfit: root of the mean squared residual in standard deviations; 1 where the stated errors are true.
    """

    mean: FloatArray
    covariance: FloatArray
    weights: FloatArray
    misfit: float

    @property
    def sigmas(self) -> FloatArray:
        """Standard deviations."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


@dataclass(frozen=True)
class Known:
    """What is known before: pitch and roll, radians, height, metres, with standard deviations (of the height
    as a fraction); None: nothing."""

    pitch: tuple[float, float] | None = None
    roll: tuple[float, float] | None = None
    height: tuple[float, float] | None = None


def normal(pitch: float, roll: float) -> FloatArray:
    """(3,) downwards, camera frame."""
    return View(_ANY, pitch, roll).R_camera_from_ground[:, 1]


_ANY = Camera(1.0, 1.0, 0.0, 0.0)


def fit_plane(contacts: Contacts, start: tuple[float, float], known: Known) -> Plane:
    """The plane through contacts, from a first guess of pitch and roll (radians)."""
    prior_mean, prior_sigma = _priors(contacts, known)
    at = prior_mean.copy()
    at[[PITCH, ROLL]] = start
    depths = contacts.points @ normal(*start)
    at[HEIGHT] = math.log(max(float(np.median(depths)), 0.1)) if known.height is None else prior_mean[HEIGHT]
    weights = np.ones(len(contacts))
    own_weights = np.ones(contacts.vehicle_count)
    for _ in range(_ITERATIONS):
        residual, J, poses, road = _linearised(contacts, at)
        shared, own, blocks = _blocks(contacts, poses, road, weights, own_weights)
        H, g = np.diag(1.0 / prior_sigma**2), (prior_mean - at) / prior_sigma**2
        for rows, inverse in blocks:
            A = J[rows].T @ inverse
            H, g = H + A @ J[rows], g + A @ residual[rows]
        step = np.linalg.solve(H, g)
        step[[PITCH, ROLL]] = np.clip(step[[PITCH, ROLL]], -0.15, 0.15)
        at = at + step
        left = residual - J @ step
        weights, own_weights = _weights(contacts, left, shared, own)
        if np.abs(step).max() < 1e-9:
            break
    covariance = np.asarray(np.linalg.inv(H), dtype=np.float64)
    misfit = math.sqrt(float(np.sum(weights * left**2 / shared) / max(float(weights.sum()), 1e-9)))
    covariance = covariance * max(misfit, 1.0) ** 2
    covariance[HEIGHT, HEIGHT] += (CONTACT_SIGMA / math.exp(at[HEIGHT])) ** 2
    return Plane(at, covariance, weights * own_weights[contacts.vehicles], misfit)


def _priors(contacts: Contacts, known: Known) -> tuple[FloatArray, FloatArray]:
    mean, sigma = np.zeros(CLASSES + len(contacts.names)), np.ones(CLASSES + len(contacts.names))
    for k, (told, wide) in enumerate(zip((known.pitch, known.roll, known.height), _WIDE, strict=True)):
        mean[k], sigma[k] = (0.0, wide) if told is None else told
        if k == HEIGHT:
            mean[k] = math.log(told[0]) if told is not None else 1.5
    sigma[CLASSES:] = contacts.class_sigmas
    return mean, sigma


def _linearised(contacts: Contacts, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Residuals (N,), their derivatives (N, 3 + C) with the sign of a prediction, and variances (N,) of the
    poses and of the road."""
    pitch, roll, log_height = at[:CLASSES].tolist()
    n = normal(pitch, roll)
    depth = np.maximum(contacts.points @ n, 0.05)
    by_pitch = (normal(pitch + _STEP, roll) - n) / _STEP
    by_roll = (normal(pitch, roll + _STEP) - n) / _STEP
    J = np.zeros((len(contacts), len(at)))
    # half measured, half predicted: the errors of either alone would pull the tilt
    expected = np.sqrt(depth * np.exp(log_height - at[CLASSES + contacts.classes]))
    J[:, PITCH] = -(contacts.points @ by_pitch) / expected
    J[:, ROLL] = -(contacts.points @ by_roll) / expected
    J[:, HEIGHT] = 1.0
    J[np.arange(len(contacts)), CLASSES + contacts.classes] = -1.0
    residual = np.log(depth) - log_height + at[CLASSES + contacts.classes]
    variance = np.einsum("i,nij,j->n", n, contacts.covariances, n) / depth**2
    away = np.linalg.norm(contacts.points, axis=1)
    road = (ROUGHNESS**2 + (SLOPE * away) ** 2) / math.exp(2.0 * log_height)
    return residual, J, variance, road


def _blocks(
    contacts: Contacts, poses: FloatArray, road: FloatArray, weights: FloatArray, own_weights: FloatArray
) -> tuple[FloatArray, FloatArray, list[tuple[NDArray[np.intp], FloatArray]]]:
    """Variances of single residuals (N,), of what a vehicle's have in common (V,), and of each vehicle its
    rows with the inverse of their covariance."""
    own = contacts.own_sigmas[contacts.classes] ** 2
    common, fresh = own + SHARED * poses, (1.0 - SHARED) * poses + road
    total = common + fresh
    order = np.argsort(contacts.vehicles, kind="stable")
    edges = np.flatnonzero(np.diff(contacts.vehicles[order])) + 1
    blocks, of_vehicle = [], np.zeros(contacts.vehicle_count)
    for v, rows in enumerate(np.split(order, edges)):
        root = np.sqrt(common[rows] / own_weights[v])
        single = fresh[rows] + total[rows] * (1.0 / weights[rows] - 1.0)
        of_vehicle[v] = float(np.mean(common[rows]))
        blocks.append((rows, np.linalg.inv(np.outer(root, root) + np.diag(single))))
    return total, of_vehicle, blocks


def _weights(
    contacts: Contacts, left: FloatArray, total: FloatArray, common: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Of contacts and of vehicles: those of Student's t."""
    count = np.bincount(contacts.vehicles, minlength=contacts.vehicle_count)
    mean = np.bincount(contacts.vehicles, left, contacts.vehicle_count) / count
    own = (_DOF + 1.0) / (_DOF + mean**2 / common)
    apart = left - mean[contacts.vehicles]
    single = (_DOF + 1.0) / (_DOF + apart**2 / total)
    return np.minimum(single, 1.0), np.minimum(own, 1.0)
