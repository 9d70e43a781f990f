"""`calibrate`: from sightings of vehicles to a camera profile."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from groundpose._checks import FloatArray, type_error
from groundpose._core import InputError
from groundpose.camera_profile import CameraProfile
from groundpose.options import Options
from groundpose.self_calibration.contacts import Contacts
from groundpose.self_calibration.focal import Focal, estimate_focal
from groundpose.self_calibration.plane import CLASSES, HEIGHT, Known, Plane, fit_plane
from groundpose.self_calibration.sightings import Sightings
from groundpose.self_calibration.solve import (
    ERROR_FACTOR,
    Road,
    Settling,
    Solver,
    class_scales,
    enough,
    settling,
    thinned,
)
from groundpose.sizes import SizePrior
from groundpose.types import Camera, View

_ONE_DISTANCE = 0.15
"""Standard deviation of the logarithm of the distances below which vehicles are all at one distance."""
_DOUBTFUL_DEG = 1.0
_NO_FOCAL = 0.1


@dataclass(frozen=True, eq=False)
class Calibration:
    """A profile, how it settled with more and more vehicles, and the contacts and plane that it rests on.

    `focal` is None where the focal length was given or cannot be known.
    """

    profile: CameraProfile
    settling: Settling
    contacts: Contacts
    plane: Plane
    focal: Focal | None = None


def calibrate(
    sightings: Sightings,
    known: Known | None = None,
    sizes: SizePrior | None = None,
    focal: bool = False,
    options: Options | None = None,
    threads: int | None = None,
    source: str = "",
) -> Calibration:
    """Tilt, height, mean sizes of classes and, if asked, the focal length of a camera that stands still.

    Args:
        sightings: of the vehicles before it.
        known: what is known of pitch, roll and height; None: nothing. With a height the sizes of the classes
            are learned.
        sizes: how large vehicles are; None: as large as their shape models, the mean of a class within 8 %.
        focal: whether the camera's focal length is a guess, to be estimated.
        options: how poses are estimated; None: the defaults with errors as a network's.
        threads: 1 or more; None: all cores. The result is the same.
        source: what the profile says it was learned from.

    Raises:
        InputError: too few vehicles. TypeError: something else.
    """
    if not isinstance(sightings, Sightings):
        raise type_error("sightings", "Sightings", sightings)
    options = Options() if options is None else options
    if options.keypoint_error_factor is None:
        options = replace(options, keypoint_error_factor=ERROR_FACTOR)
    known = known or Known()
    solver = Solver(known, sizes or SizePrior.region(), options, threads)
    enough(len(set(sightings.vehicles.tolist())))
    few = thinned(sightings)
    road, remarks, found = solver.road(few), [], None
    if focal:
        found, said = _focal(solver, few, road)
        remarks += said
        road = road if found is None else found.road
    return _calibration(road.sightings.camera, road.contacts, road.plane, known, found, remarks, source)


def calibrate_contacts(
    camera: Camera,
    contacts: Contacts,
    start: tuple[float, float],
    known: Known | None = None,
    source: str = "",
) -> Calibration:
    """The same from poses that were estimated in a view with pitch and roll `start` (radians).

    Raises:
        InputError: too few vehicles.
    """
    known = known or Known()
    enough(contacts.vehicle_count)
    plane = fit_plane(contacts, start, known)
    moved = math.degrees(max(abs(plane.mean[0] - start[0]), abs(plane.mean[1] - start[1])))
    remarks = []
    if moved > 3.0:
        remarks.append(f"tilt: {moved:.1f} degrees from that of the poses; estimate them again with it")
    return _calibration(camera, contacts, plane, known, None, remarks, source)


def _focal(solver: Solver, sightings: Sightings, road: Road) -> tuple[Focal | None, list[str]]:
    try:
        found = estimate_focal(solver, sightings, road)
    except InputError as error:
        return None, [f"focal length: as given, not known from these vehicles ({error})"]
    if found.sigma > _NO_FOCAL:
        said = f"focal length: as given; these vehicles tell it only within {100 * found.sigma:.0f} %"
        return None, [said]
    return found, []


def _calibration(
    camera: Camera,
    contacts: Contacts,
    plane: Plane,
    known: Known,
    focal: Focal | None,
    remarks: list[str],
    source: str,
) -> Calibration:
    mean, covariance = plane.mean, plane.covariance[:CLASSES, :CLASSES].copy()
    if focal is not None:
        covariance += focal.sigma**2 * np.outer(focal.change, focal.change)
    view = View(camera, float(mean[0]), float(mean[1]), math.exp(mean[HEIGHT]))
    profile = CameraProfile(
        view=view,
        covariance=covariance,
        focal_sigma=0.0 if focal is None else focal.sigma,
        class_scales=class_scales(contacts, plane),
        vehicles=contacts.vehicle_count,
        sightings=len(contacts),
        source=source,
        remarks=(*_remarks(contacts, covariance), *remarks),
    )
    return Calibration(profile, settling(contacts, plane, known), contacts, plane, focal)


def _remarks(contacts: Contacts, covariance: FloatArray) -> list[str]:
    """What these vehicles cannot tell."""
    away = np.linalg.norm(contacts.points, axis=1)
    sigma = math.degrees(math.sqrt(covariance[0, 0]))
    found = []
    if float(np.log(away).std()) < _ONE_DISTANCE:
        said = f"vehicles are all about {float(np.median(away)):.0f} m away"
        found.append(f"{said}: pitch and height can hardly be told apart")
    if sigma > _DOUBTFUL_DEG:
        found.append(f"pitch: known within {sigma:.1f} degrees only; more vehicles, near and far, say more")
    return found
