"""The keypoints of the vehicle classes: one table, in the order of the network's channels.

Counts as in the paper (appendix C): car 28, van_bus 26, pickup 26, box_truck 30. The paper names no
definitions; ours are places that a picture shows from more than one side: corners of glass, lamps,
wheels, mirrors, bumper corners, edges of a cargo bed or box. Left and right are the driver's; the object
frame has x to the right, y down, z forward.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import input_error
from groundpose.vehicles.classes import CLASSES

KINDS = CLASSES
"""The former name of `groundpose.vehicles.CLASSES`."""

_ALL = CLASSES
_PAIRS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("front_wheel", "centre of the front wheel's outer face", _ALL),
    ("rear_wheel", "centre of the (first) rear wheel's outer face", _ALL),
    ("headlamp", "outer end of the headlamp's lens, half its height", _ALL),
    ("taillamp", "outer end of the tail lamp's lens, half its height", _ALL),
    ("mirror", "outermost point of the side mirror's housing", _ALL),
    ("windscreen_top", "upper outer corner of the windscreen's glass", _ALL),
    ("windscreen_bottom", "lower outer corner of the windscreen's glass", _ALL),
    ("front_bumper", "lower corner of the front bumper, where front and side meet", _ALL),
    ("rear_bumper", "lower corner of the rear bumper, where rear and side meet", ("car", "van_bus")),
    ("rear_window_bottom", "lower outer corner of the rear window's glass", ("car", "van_bus")),
    ("rear_window_top", "upper outer corner of the rear window's glass", ("car",)),
    ("belt_b", "lower rear corner of the front side window: belt line at the B pillar", ("car",)),
    ("belt_c", "lower rear corner of the last side window: belt line at the last pillar", ("car",)),
    ("roof_rear", "rear upper corner of the body, where roof, side and rear meet", ("van_bus",)),
    ("side_window_top", "upper rear corner of the first side window, the driver's", ("van_bus",)),
    ("cab_roof_rear", "rear corner of the cab's roof, where roof, side and rear meet", ("pickup",)),
    ("bed_front", "front upper corner of the cargo bed's side wall, outer edge", ("pickup",)),
    ("bed_rear_top", "rear upper corner of the cargo bed, outer edge", ("pickup",)),
    ("bed_rear_bottom", "rear lower corner of the cargo bed's side, below the tail lamp", ("pickup",)),
    ("cab_window", "lower rear corner of the cab's side window", ("box_truck",)),
    ("box_front_top", "front upper corner of the box", ("box_truck",)),
    ("box_front_bottom", "front lower corner of the box", ("box_truck",)),
    ("box_rear_top", "rear upper corner of the box", ("box_truck",)),
    ("box_rear_bottom", "rear lower corner of the box", ("box_truck",)),
    ("guard_rear", "lower outer end of the bar under the rear of the chassis", ("box_truck",)),
)
_MIDDLE: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("front_plate", "centre of the front number plate", _ALL),
    ("rear_plate", "centre of the rear number plate", ("car", "van_bus", "box_truck")),
    ("tailgate", "middle of the tailgate's upper edge", ("pickup",)),
)


@dataclass(frozen=True)
class Keypoint:
    """One row of the table.

    Args:
        name: unique; those off the middle plane start with "left_" or "right_".
        where: what it is on the vehicle.
        partner: name of its mirror image; None on the middle plane.
        classes: the classes that have it.
    """

    name: str
    where: str
    partner: str | None
    classes: tuple[str, ...]

    @property
    def kinds(self) -> tuple[str, ...]:
        """The former name of `classes`."""
        return self.classes


def _pair(name: str, where: str, classes: tuple[str, ...]) -> tuple[Keypoint, Keypoint]:
    left, right = f"left_{name}", f"right_{name}"
    return Keypoint(left, where, right, classes), Keypoint(right, where, left, classes)


KEYPOINTS: tuple[Keypoint, ...] = tuple(side for row in _PAIRS for side in _pair(*row)) + tuple(
    Keypoint(name, where, None, classes) for name, where, classes in _MIDDLE
)
"""All, K of them; the order is that of the network's channels and never changes."""


def keypoint_indices(class_name: str) -> NDArray[np.intp]:
    """Rows (P,) of `KEYPOINTS` that the class `class_name` has, in order.

    Raises:
        InputError: an unknown class.
    """
    if class_name not in CLASSES:
        raise input_error("class_name", f"one of {', '.join(CLASSES)}", repr(class_name))
    return np.array(
        [i for i, keypoint in enumerate(KEYPOINTS) if class_name in keypoint.classes], dtype=np.intp
    )


def keypoint_names(class_name: str) -> tuple[str, ...]:
    """Names of the P keypoints of class `class_name`, in order. Raises InputError for an unknown class."""
    return tuple(KEYPOINTS[i].name for i in keypoint_indices(class_name))


def flip_indices() -> NDArray[np.intp]:
    """Permutation (K,): keypoint `i` of a mirrored image is keypoint `flip_indices()[i]` of the original."""
    row = {keypoint.name: i for i, keypoint in enumerate(KEYPOINTS)}
    return np.array([row[keypoint.partner or keypoint.name] for keypoint in KEYPOINTS], dtype=np.intp)
