"""Where the keypoints of labelled boxes come from: a network that looks at the image, or a simulated
detector."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Protocol

import numpy as np
import numpy.typing as npt

import groundpose as gp
from groundpose._checks import FloatArray, input_error
from groundpose.formats.kitti.dataset import KittiFrame
from groundpose.formats.kitti.labels import CLASS_OF, DONT_CARE, KittiLabel
from groundpose.formats.kitti.results import R_from_rotation_y
from groundpose.lab.evaluate.simulated.keypoint_noise import HIDDEN, OUTSIDE, VISIBLE, Detector, Seen
from groundpose.vehicles import CLASSES, keypoint_indices, keypoint_names, shape_model

WIDTH = max(len(keypoint_indices(class_name)) for class_name in CLASSES)
MODELS = ("class", "sized", "rigid")
"""What a solver knows of a vehicle: the shape model of its class, that stretched to the labelled size, or
the stretched mean alone."""
_MOST_DEVIATION = 2.0
"""Simulated bodies have shape coefficients up to so many standard deviations."""

# Ends of a vehicle that show a keypoint beside the side it is on; keypoints of the middle plane have the
# end alone.
_FRONT = (
    *("headlamp", "mirror", "windscreen_top", "windscreen_bottom", "front_bumper", "front_plate"),
    "box_front_top",
)
_REAR = (
    *("taillamp", "mirror", "rear_bumper", "rear_window_bottom", "rear_window_top", "roof_rear"),
    *("cab_roof_rear", "bed_rear_top", "bed_rear_bottom", "box_rear_top", "box_rear_bottom"),
    *("guard_rear", "rear_plate", "tailgate"),
)

KEYPOINT_ERRORS = tuple(f.name for f in fields(gp.Options) if f.name.startswith("keypoint_error_"))


@dataclass(frozen=True)
class Found:
    """Keypoints of N boxes: (P_i, 2) pixels with NaN for those not seen, (P_i,) scores, the model of each;
    how their errors are shared (options of
    `groundpose.Options` by name)."""

    keypoints_2d: list[FloatArray]
    scores: list[FloatArray]
    models: list[gp.ShapeModel]
    errors: Mapping[str, float | None] = field(default_factory=dict)


class KeypointSource(Protocol):
    """Finds keypoints."""

    def __call__(
        self, frame: KittiFrame, bboxes: FloatArray, labels: Sequence[KittiLabel | None]
    ) -> Found | None:
        """Keypoints in boxes (N, 4) of a frame; `labels` are those the boxes belong to. None: not possible
        for this frame (no image)."""
        ...


class Network:
    """The keypoint network on the image; what is labelled is not looked at."""

    def __init__(self, path: str | None = None, threads: int | None = None) -> None:
        """Load a network, the bundled one for None. OSError, InputError as `keypoints.Pipeline`."""
        from groundpose.keypoints.pipeline import Pipeline

        self.path, self.pipeline = path, Pipeline(path, threads=threads)

    def __reduce__(self) -> tuple[type[Network], tuple[str | None, int]]:
        """Another process loads its own, for one thread: a loaded network cannot be copied."""
        return Network, (self.path, 1)

    def __call__(
        self, frame: KittiFrame, bboxes: FloatArray, labels: Sequence[KittiLabel | None]
    ) -> Found | None:
        """See `KeypointSource`."""
        from groundpose.keypoints.image import as_rgb

        if frame.image is None:
            return None
        found = self.pipeline.detect(as_rgb(frame.image), bboxes)
        models = [self.pipeline.models[class_name or CLASSES[0]] for class_name in found.classes]
        errors = {name: getattr(self.pipeline.options, name) for name in KEYPOINT_ERRORS}
        return Found(found.keypoints, found.scores, models, errors)


@dataclass(frozen=True)
class Simulated:
    """Keypoints of a random body of the labelled size, seen with the errors of a real CNN.

    Object k of a frame depends on `seed`, the frame's id and k only. A box without label has wrong
    keypoints only.
    """

    seed: int = 0
    quality: float = 1.0
    """Of the detector, see `Detector`."""
    models: str = "class"
    """One of MODELS."""

    def __post_init__(self) -> None:
        """Raises InputError."""
        if self.models not in MODELS:
            raise input_error("models", f"one of {', '.join(MODELS)}", repr(self.models))

    def __call__(
        self, frame: KittiFrame, bboxes: FloatArray, labels: Sequence[KittiLabel | None]
    ) -> Found | None:
        """See `KeypointSource`."""
        key = zlib.crc32(f"{self.seed}/{frame.id}".encode())
        points, states, solid = seen_of(frame, labels, [(key, k) for k in range(len(labels))])
        seen = Seen(points, states, solid, bboxes)
        pixels, scores = Detector("CNN", self.quality)(seen, key)
        classes = [CLASSES[0] if label is None else CLASS_OF[label.type] for label in labels]
        lengths = [len(keypoint_indices(class_name)) for class_name in classes]
        return Found(
            [row[:n] for row, n in zip(pixels, lengths, strict=True)],
            [np.nan_to_num(row[:n]) for row, n in zip(scores, lengths, strict=True)],
            [self._model(class_name, label) for class_name, label in zip(classes, labels, strict=True)],
        )

    def _model(self, class_name: str, label: KittiLabel | None) -> gp.ShapeModel:
        model = shape_model(class_name)
        if label is None or self.models == "class":
            return model
        sized = model.scaled(label.length, label.height, label.width)
        if self.models == "sized":
            return sized
        names = sized.keypoint_names
        return gp.ShapeModel(sized.keypoints_3d, sized.bbox_3d, keypoint_names=names, name=sized.name)


def seen_of(
    frame: KittiFrame, labels: Sequence[KittiLabel | None], keys: Sequence[tuple[int, ...]]
) -> tuple[FloatArray, npt.NDArray[np.int64], FloatArray]:
    """Exact pixels (N, P, 2), states (N, P) and bodies (N, P, 3) of labelled vehicles; equal keys, equal
    shapes."""
    nobody = shape_model(CLASSES[0]).keypoints_3d
    bodies = [nobody if label is None else _body(label, key) for label, key in zip(labels, keys, strict=True)]
    points, states = _exact(frame, bodies, labels)
    solid = np.full((len(bodies), WIDTH, 3), np.nan)
    for row, body in zip(solid, bodies, strict=True):
        row[: len(body)] = body
    return points, states, solid


def _exact(
    frame: KittiFrame, bodies: Sequence[FloatArray], labels: Sequence[KittiLabel | None]
) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Exact pixels (N, P, 2) and states (N, P)."""
    pixels = np.full((len(bodies), WIDTH, 2), np.nan)
    states = np.full((len(bodies), WIDTH), OUTSIDE)
    width, height = frame.image_size
    K, offset = frame.camera.K, frame.camera_from_labels
    others = np.array([(*x.bbox, x.location[2]) for x in frame.labels if x.type != DONT_CARE])
    for k, (body, label) in enumerate(zip(bodies, labels, strict=True)):
        if label is None:
            continue
        R, t = R_from_rotation_y(label.rotation_y), label.location + offset
        points = body @ R.T + t
        if (points[:, 2] <= 0.1).any():
            continue  # a vehicle beside the camera: no detector sees its keypoints
        at = (points @ K.T)[:, :2] / points[:, 2:]
        inside = ((at >= 0.0) & (at <= [width - 1.0, height - 1.0])).all(axis=1)
        before = others[others[:, 4] < label.location[2] - 0.5]
        hidden = ((at[:, None] > before[:, :2]) & (at[:, None] < before[:, 2:4])).all(axis=2).any(axis=1)
        shown = _faces_camera(CLASS_OF[label.type], body, -R.T @ t) & ~hidden
        pixels[k, : len(body)] = at
        states[k, : len(body)] = np.where(inside, np.where(shown, VISIBLE, HIDDEN), OUTSIDE)
    return pixels, states


def _body(label: KittiLabel, key: tuple[int, ...]) -> FloatArray:
    """Keypoints (P, 3) of a random body with the labelled size, origin at its bottom centre."""
    model = shape_model(CLASS_OF[label.type])
    normal = np.random.default_rng(key).standard_normal(model.modes)
    coefficients = np.clip(normal, -_MOST_DEVIATION, _MOST_DEVIATION) * np.sqrt(model.eigenvalues)
    points = model.keypoints(coefficients)
    # as `ShapeModel.stretched_bbox_3d`: the box grows with the extent of the keypoints
    stretch = np.ptp(model.keypoints_3d, axis=0) / np.ptp(points, axis=0)
    size = model.bbox_3d[1] - model.bbox_3d[0]
    factor = np.array([label.width, label.height, label.length]) / size * stretch
    return np.asarray((points - model.bottom_centre) * factor)


def _faces_camera(class_name: str, body: FloatArray, camera: FloatArray) -> npt.NDArray[np.bool_]:
    """(P,) whether the vehicle itself leaves a keypoint in sight of a camera at this place, object frame."""
    low, high = body.min(axis=0), body.max(axis=0)
    left, right, front, rear = _surfaces(class_name)
    shown = (left & (camera[0] < low[0])) | (right & (camera[0] > high[0]))
    return np.asarray(shown | (front & (camera[2] > high[2])) | (rear & (camera[2] < low[2])))


@cache
def _surfaces(class_name: str) -> tuple[npt.NDArray[np.bool_], ...]:
    """(P,) each: whether a keypoint is on the left, the right, the front, the rear."""
    names = keypoint_names(class_name)
    bare = [name.removeprefix("left_").removeprefix("right_") for name in names]
    return (
        np.array([name.startswith("left_") for name in names]),
        np.array([name.startswith("right_") for name in names]),
        np.array([name in _FRONT for name in bare]),
        np.array([name in _REAR for name in bare]),
    )
