"""Vehicles of the virtual drive, as arrays: what a camera sees of them, and the truth."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

import groundpose as gp
from groundpose.lab.contenders.objects import Array, Objects, relative_thresholds
from groundpose.lab.evaluate.simulated.keypoint_noise import OUTSIDE, Seen
from groundpose.vehicles import CLASSES, keypoint_indices

SPLIT = "test"
EVERY = 5
"""Frames between two that are used: neighbours look alike."""
# those that KITTI counts: its level "hard"
LEAST_HEIGHT_PX, MOST_OCCLUSION, MOST_TRUNCATION = 25.0, 2, 0.5
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Vehicles:
    """N vehicles seen by one camera; row k of every array is vehicle k."""

    camera: gp.Camera
    seen: Seen
    classes: tuple[str, ...]
    """N classes"""
    bbox_3d: Array
    """(N, 2, 3) metres"""
    R: Array
    t: Array
    occlusion: Integers
    truncation: Array
    """Fraction of the box outside the image."""

    def __len__(self) -> int:
        """Number of vehicles."""
        return len(self.classes)

    def __getitem__(self, rows: slice) -> Vehicles:
        """Some of the vehicles."""
        per_vehicle = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "camera"}
        return Vehicles(self.camera, **per_vehicle)

    @property
    def view(self) -> gp.View:
        """The nominal one: no tilt at all (paper, sec. 4.2.1)."""
        return gp.View(self.camera)

    @property
    def distance(self) -> Array:
        """(N,) metres."""
        return np.asarray(np.linalg.norm(self.t, axis=1))

    @property
    def tilt_error_deg(self) -> Array:
        """(N,) angle between a vehicle's up axis and the nominal one, from shaking and slopes together."""
        return np.asarray(np.degrees(np.arccos(np.clip(self.R[:, 1, 1], -1.0, 1.0))))

    @cached_property
    def known_models(self) -> list[gp.ShapeModel]:
        """Each vehicle's own keypoints and box (G1)."""
        own = np.isfinite(self.seen.keypoints_3d[..., 0])
        rows = zip(self.seen.keypoints_3d, own, self.bbox_3d, self.classes, strict=True)
        return [gp.ShapeModel(points[k], bbox_3d=box, name=class_name) for points, k, box, class_name in rows]

    def class_models(self, model: Callable[[str], gp.ShapeModel]) -> list[gp.ShapeModel]:
        """Each vehicle's class (G2); `model` gives the one of a class."""
        each = {class_name: model(class_name) for class_name in dict.fromkeys(self.classes)}
        return [each[class_name] for class_name in self.classes]

    def given(
        self, keypoints_2d: Array, scores: Array, bboxes: Array, models: list[gp.ShapeModel]
    ) -> Objects:
        """What contenders are given of the vehicles when this is seen of them."""
        return Objects(
            view=self.view,
            keypoints_2d=keypoints_2d,
            keypoint_scores=scores,
            bboxes=bboxes,
            models=models,
            inlier_threshold=relative_thresholds(bboxes),
            R=self.R,
            t=self.t,
            fewest_points=4,
        )


@dataclass(frozen=True)
class Row:
    """One vehicle; arrays of its own P keypoints. Fields as in a label of the drive."""

    keypoints_2d: Array
    keypoint_states: npt.NDArray[np.integer[Any]]
    keypoints_3d: Array
    bbox: Array
    class_name: str
    bbox_3d: Array
    R: Array
    t: Array
    occlusion: int
    truncation: float


WIDTH = max(len(keypoint_indices(class_name)) for class_name in CLASSES)
"""Keypoints of the class that has most: rows are padded to it, whatever classes there are."""


@lru_cache(maxsize=1)
def collect(count: int, seed: int) -> Vehicles:
    """The first `count` vehicles of the drive's test split that KITTI would count; vehicle k depends on
    (seed, k) only."""
    from groundpose.lab.drive.drive import scene
    from groundpose.lab.drive.labels import labels
    from groundpose.lab.drive.splits import scene_seed

    rows: list[Row] = []
    for number in itertools.count(0, EVERY):
        frame = scene(scene_seed(seed, SPLIT), number)
        rows += [row for row in map(row_of, labels(frame)) if counts(row)]
        if len(rows) >= count:
            return from_rows(frame.camera, rows[:count])
    raise AssertionError("itertools.count ends")


def row_of(label: Any) -> Row:
    """What is kept of a label of the drive."""
    return Row(**{f.name: getattr(label, f.name) for f in fields(Row)})


def counts(row: Row) -> bool:
    """Whether KITTI would count it."""
    height = row.bbox[3] - row.bbox[1]
    return bool(
        height >= LEAST_HEIGHT_PX and row.occlusion <= MOST_OCCLUSION and row.truncation <= MOST_TRUNCATION
    )


def from_rows(camera: gp.Camera, rows: Sequence[Row], width: int = WIDTH) -> Vehicles:
    """Rows in one, padded to `width` keypoints."""
    seen = Seen(
        _padded([row.keypoints_2d for row in rows], width, np.nan),
        _padded([row.keypoint_states.astype(np.int64) for row in rows], width, OUTSIDE),
        _padded([row.keypoints_3d for row in rows], width, np.nan),
        np.stack([row.bbox for row in rows]),
    )
    return Vehicles(
        camera=camera,
        seen=seen,
        classes=tuple(row.class_name for row in rows),
        bbox_3d=np.stack([row.bbox_3d for row in rows]),
        R=np.stack([row.R for row in rows]),
        t=np.stack([row.t for row in rows]),
        occlusion=np.array([row.occlusion for row in rows]),
        truncation=np.array([row.truncation for row in rows]),
    )


def _padded(arrays: Sequence[npt.NDArray[Any]], width: int, fill: float) -> npt.NDArray[Any]:
    first = arrays[0]
    padded = np.full((len(arrays), width, *first.shape[1:]), fill, dtype=first.dtype)
    for row, array in zip(padded, arrays, strict=True):
        row[: len(array)] = array
    return padded
