"""Poses of the vehicles of an image, with what the network said of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.poses import PoseBatch

NOT_A_VEHICLE = "not_a_vehicle"
"""Status of an object in whose box the network sees no vehicle; `_core.STATUS` has the solver's."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class VehiclePoses(PoseBatch):
    """A `PoseBatch` of detected vehicles, and what the network said of them.

    Attributes:
        classes: (N,) str, the likeliest class; its model is `models[i]`. "" for an unusable box and for one
            without a vehicle.
        class_probabilities: (N, C) in the order of `groundpose.vehicles.CLASSES`, given that there is a
            vehicle; NaN for an unusable box.
        vehicle_probability: (N,) that there is a vehicle in the box; where it is below
            `Pipeline.vehicle_threshold` the status is "not_a_vehicle". 1 from a network of format version
            "1", NaN for an unusable box and for one whose class is no vehicle's.
        viewing_angle_probabilities: (N, 16) of the angle from which the network sees the vehicle: KITTI's
            alpha, `rotation_y - atan2(x, z)`, bin b centred on b * 22.5 degrees. They tell a pose from its
            reading turned round. NaN from a network of format version "1" and for an unusable box.
        keypoint_scores: (N, P) probability of each keypoint to be right, NaN beyond an object's own.
        seconds: what the steps took: "crop", "network", "decode", "solve".
        ids: (N,) str or int of the objects: of their tracks or boxes where these have any, else 0 to N - 1.
        box_remarks: what was done to the boxes that were given, each as "kind: details"; `remarks` has them
            too.
    """

    classes: NDArray[np.str_]
    class_probabilities: FloatArray
    vehicle_probability: FloatArray
    viewing_angle_probabilities: FloatArray
    keypoint_scores: FloatArray
    seconds: Mapping[str, float]
    ids: NDArray[np.object_]
    box_remarks: tuple[str, ...]

    def __repr__(self) -> str:
        """How many of what have an answer."""
        named, counts = np.unique(self.classes[self.ok], return_counts=True)
        what = ", ".join(f"{count} {class_name}" for class_name, count in zip(named, counts, strict=True))
        return f"VehiclePoses({int(self.ok.sum())} of {len(self)} ok{': ' * bool(what)}{what})"

    @property
    def remarks(self) -> tuple[str, ...]:
        """What looks wrong in the input: `PoseBatch.remarks` and what was done to the boxes."""
        return (*self.box_remarks, *super().remarks)

    @property
    def class_probability(self) -> FloatArray:
        """(N,) probability of the class chosen."""
        return np.asarray(self.class_probabilities.max(axis=1))

    @property
    def kinds(self) -> NDArray[np.str_]:
        """The former name of `classes`."""
        return self.classes

    @property
    def kind_probabilities(self) -> FloatArray:
        """The former name of `class_probabilities`."""
        return self.class_probabilities

    @property
    def kind_probability(self) -> FloatArray:
        """The former name of `class_probability`."""
        return self.class_probability
