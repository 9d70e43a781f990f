"""Poses for the annotators of supervision, with the package supervision (extra `supervision`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from groundpose.formats.conversions import to_body_axes
from groundpose.formats.extras import extra_package
from groundpose.formats.neighbours.context import score
from groundpose.formats.scenes import Scene
from groundpose.poses import PoseBatch
from groundpose.vehicles.classes import CLASSES

NO_CLASS = -1
"""Number of a class that is not in `groundpose.vehicles.CLASSES`."""


def to_supervision(poses: PoseBatch) -> Any:
    """`supervision.Detections` of the objects whose 2D boxes are known; see `PoseBatch.to_supervision`."""
    supervision = extra_package("supervision", "supervision", "supervision")
    scene = Scene.of(poses)
    rows = np.flatnonzero(np.isfinite(scene.bboxes).all(axis=1))
    names = np.array([scene.classes[k] or scene.status[k] for k in rows], dtype=str)
    numbers = [CLASSES.index(name) if name in CLASSES else NO_CLASS for name in names]
    arrays = {
        "index": rows,
        "class_name": names,
        "status": np.array([scene.status[k] for k in rows], dtype=str),
        "yaw": scene.yaw[rows],
        "centre": scene.centre[rows],
        "size": scene.size[rows],
        "R": to_body_axes(scene.R[rows]),
        "cuboid": scene.corner_pixels[rows],
    }
    sure = [score(scene, k) if scene.ok[k] else 0.0 for k in rows.tolist()]
    return supervision.Detections(
        xyxy=scene.bboxes[rows].astype(np.float32),
        confidence=np.array(sure, dtype=np.float32),
        class_id=np.array(numbers, dtype=int),
        data=arrays,
    )
