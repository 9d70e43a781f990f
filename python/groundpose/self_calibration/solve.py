"""From sightings of vehicles to tilt, height and sizes of classes: poses in the view so far, the road through
their contacts, poses in the view of that road, until it stays."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray, input_error
from groundpose.estimate import estimate_poses
from groundpose.options import Options
from groundpose.poses import PoseBatch
from groundpose.self_calibration.contacts import Contacts
from groundpose.self_calibration.plane import CLASSES, HEIGHT, PITCH, ROLL, Known, Plane, fit_plane
from groundpose.self_calibration.sightings import Sightings
from groundpose.sizes import SizePrior
from groundpose.types import View

FEWEST = 8
"""Vehicles without which nothing is said."""
ERROR_FACTOR = 10.0
"""`Options.keypoint_error_factor` of a network's keypoints where the caller gives none."""

_MOST_SIGHTINGS = 6  # of a vehicle: more show the same
_STARTS_DEG = (-45.0, -30.0, -20.0, -10.0, 0.0)  # first guesses of the pitch where none is told
_FEW = 60  # sightings that choose among them
_ROUNDS, _CLOSE = 10, math.radians(0.01)
_STEPS = 12  # of the history


@dataclass(frozen=True, eq=False)
class Road:
    """The road under a camera: the plane through contacts, and what it follows from."""

    sightings: Sightings
    poses: PoseBatch
    contacts: Contacts
    plane: Plane


def enough(vehicles: int) -> None:
    """Raises InputError for fewer than FEWEST."""
    if vehicles < FEWEST:
        raise input_error("vehicles", f"at least {FEWEST} with a pose", vehicles)


def thinned(sightings: Sightings) -> Sightings:
    """At most a few sightings of each vehicle, the first and the last among them."""
    rows: list[int] = []
    for vehicle in dict.fromkeys(sightings.vehicles.tolist()):
        own = np.flatnonzero(sightings.vehicles == vehicle)
        chosen = np.linspace(0, len(own) - 1, min(_MOST_SIGHTINGS, len(own))).round().astype(int)
        rows += own[np.unique(chosen)].tolist()
    return sightings[np.array(sorted(rows), np.intp)]


@dataclass(frozen=True, eq=False)
class Solver:
    """How the road is found: what is known, how large vehicles are, how poses are estimated."""

    known: Known
    sizes: SizePrior
    options: Options
    threads: int | None = None

    def road(self, sightings: Sightings, start: tuple[float, float] | None = None) -> Road:
        """The road, from a guess of pitch and roll, or from several.

        Raises:
            InputError: fewer than FEWEST vehicles with a pose.
        """
        pitch, roll = self._start(sightings) if start is None else start
        for _ in range(_ROUNDS):
            found = self._once(sightings, pitch, roll)
            moved = np.abs(found.plane.mean[[PITCH, ROLL]] - [pitch, roll]).max()
            pitch, roll = found.plane.mean[[PITCH, ROLL]].tolist()
            if moved < _CLOSE:
                break
        return found

    def poses(self, sightings: Sightings, pitch: float, roll: float) -> PoseBatch:
        """In a view with this tilt."""
        return estimate_poses(
            View(sightings.camera, pitch, roll),
            list(sightings.keypoints_2d),
            sightings.bboxes,
            [self.sizes.sized(model) for model in sightings.models],
            list(sightings.keypoint_scores),
            self.options,
            self.threads,
        )

    def _once(self, sightings: Sightings, pitch: float, roll: float) -> Road:
        poses = self.poses(sightings, pitch, roll)
        rows = np.flatnonzero(poses.ok & np.isfinite(poses.covariance).all(axis=(1, 2)))
        seen = sightings[rows]
        enough(len(set(seen.vehicles.tolist())))
        models = [poses.models[i] for i in rows]
        contacts = Contacts.of(
            poses.R[rows], poses.t[rows], poses.covariance[rows], models, seen.vehicles, self.sizes
        )
        return Road(sightings, poses, contacts, fit_plane(contacts, (pitch, roll), self.known))

    def _start(self, sightings: Sightings) -> tuple[float, float]:
        """The guess in whose view keypoints fit best."""
        roll = 0.0 if self.known.roll is None else self.known.roll[0]
        if self.known.pitch is not None:
            return self.known.pitch[0], roll
        few = sightings[np.unique(np.linspace(0, len(sightings) - 1, _FEW).round().astype(int))]
        guesses = np.radians(_STARTS_DEG).tolist()
        return min(guesses, key=lambda pitch: misfit(self.poses(few, pitch, roll))), roll


def misfit(poses: PoseBatch) -> float:
    """Mean of `PoseBatch.score`, 1 for those without a pose."""
    return float(np.where(poses.ok, poses.score, 1.0).mean())


@dataclass(frozen=True, eq=False)
class Settling:
    """How a calibration settled: after `vehicles` (K,) mean and standard deviation of pitch, roll (radians)
    and log height, (K, 3) each."""

    vehicles: FloatArray
    mean: FloatArray
    sigma: FloatArray


def settling(contacts: Contacts, plane: Plane, known: Known) -> Settling:
    """The same from the vehicles that came first, more and more."""
    total = contacts.vehicle_count
    numbers = np.unique(np.geomspace(min(FEWEST, total), total, _STEPS).round().astype(int))
    arrival = {v: k for k, v in enumerate(dict.fromkeys(contacts.vehicles.tolist()))}
    order = np.array([arrival[v] for v in contacts.vehicles.tolist()])
    start = (float(plane.mean[PITCH]), float(plane.mean[ROLL]))
    planes = [fit_plane(contacts[order < n], start, known) for n in numbers.tolist()]
    rows = slice(PITCH, HEIGHT + 1)
    return Settling(
        numbers.astype(float),
        np.array([plane.mean[rows] for plane in planes]),
        np.array([plane.sigmas[rows] for plane in planes]),
    )


def class_scales(contacts: Contacts, plane: Plane) -> dict[str, tuple[float, float]]:
    """Log mean size of each class over its model's, and its standard deviation."""
    mean, sigma = plane.mean[CLASSES:], plane.sigmas[CLASSES:]
    return {name: (float(m), float(s)) for name, m, s in zip(contacts.names, mean, sigma, strict=True)}
