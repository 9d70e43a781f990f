"""ApolloCar3D: `groundpose evaluate apollo`; and the tilt on real roads: `groundpose evaluate tilt`."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

from groundpose.formats.apollo import ApolloSet
from groundpose.formats.kitti.table import KittiTable
from groundpose.formats.skips import Skips
from groundpose.lab.contenders.registry import described
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.kitti.keypoints import Simulated
from groundpose.lab.evaluate.kitti.objects import cars_of
from groundpose.lab.evaluate.real import APOLLO_NOTE, compare
from groundpose.lab.evaluate.real_data import (
    APOLLO_TILT_DEG,
    RealObjects,
    apollo,
    apollo_images,
    apollo_library,
)
from groundpose.lab.evaluate.tilt import table, ways

APOLLO_SPREAD_DEG = 1.6
KITTI_SPREAD_DEG = 0.7
KITTI_OFF_DEG = 3.0
"""By how much the nominal tilt is wrong where it is: that of a car braking hard."""
Content = dict[str, Any]


def header() -> Content:
    """What every file of numbers begins with."""
    return {
        "command": " ".join(["groundpose", *map(shlex.quote, sys.argv[1:])]),
        "versions": report.versions(),
        "machine": report.machine(),
    }


def run_folder(root: Path, models: Path, split: Path | None) -> Content:
    """The public set as it unpacks. Raises OSError, InputError."""
    skipped = Skips()
    folder = ApolloSet(root, apollo_library(models))
    images = [image for name in folder.ids(split, skipped) if (image := folder.read(name, skipped))]
    sets = [_one(each) for known in (True, False) for each in apollo_images(images, folder.models, known)]
    return {**header(), "libraries": described("real"), "sets": sets, "skipped": skipped.record()}


def run_table(data: Path) -> Content:
    """The development cars. Raises OSError."""
    return {
        **header(),
        "libraries": described("real"),
        "sets": [_one(apollo(data, known)) for known in (True, False)],
    }


def _one(objects: RealObjects) -> Content:
    return {**compare(objects, APOLLO_NOTE), "tilt": table(objects, _apollo_ways())}


def _apollo_ways() -> list[Any]:
    return ways(APOLLO_TILT_DEG, APOLLO_SPREAD_DEG, -APOLLO_TILT_DEG)


TILT_NOTES = {
    "apollo": (
        "Tilt 8.9 deg in the mean, 1.6 deg spread between images; keypoints labelled by hand, some 9 cars "
        "an image. Wrong by -8.9 deg: the camera is taken to be level."
    ),
    "kitti": (
        "Real vehicles and boxes of a real detector, keypoints simulated with a CNN's errors. The labels "
        "know no tilt (they are upright in the camera's frame), so that 0 is exactly right here."
    ),
}


def run_tilt(data: Path, limit: int | None = None) -> Content:
    """Tables of `tilt` on ApolloCar3D (known models, shape basis) and KITTI; those whose file is there.

    `limit`: only so many frames of KITTI. FileNotFoundError when neither is there.
    """
    sets = []
    if (data / "apollo_cars_dev.npz").exists():
        for known in (True, False):
            objects = apollo(data, known)
            sets.append(_tilt_set(objects, TILT_NOTES["apollo"], table(objects, _apollo_ways())))
    vehicles = data / "kitti_vehicles_dev.npz"
    if vehicles.exists():
        objects = cars_of(KittiTable(vehicles, True), Simulated(), "detections", Skips(), limit)
        lines = table(objects, ways(0.0, KITTI_SPREAD_DEG, KITTI_OFF_DEG))
        sets.append(_tilt_set(objects, TILT_NOTES["kitti"], lines))
    if not sets:
        raise FileNotFoundError(2, "expected apollo_cars_dev.npz or kitti_vehicles_dev.npz there", str(data))
    return {**header(), "sets": sets}


def _tilt_set(objects: RealObjects, note: str, lines: list[Content]) -> Content:
    return {"name": objects.name, "objects": len(objects), "note": note, "tilt": lines}
