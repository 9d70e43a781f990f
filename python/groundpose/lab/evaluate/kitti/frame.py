"""One frame: poses by every method, their errors against the labels, and what they are worth as
detections."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

import groundpose as gp
from groundpose._checks import FloatArray, input_error
from groundpose.formats.kitti.dataset import KittiFrame, difficulty
from groundpose.formats.kitti.labels import CLASS_OF, KittiLabel
from groundpose.formats.kitti.results import R_from_rotation_y, bottom_centres, results
from groundpose.formats.skips import Skips
from groundpose.lab.contenders.contender import Contender, as_poses, nothing
from groundpose.lab.contenders.objects import Objects, padded, relative_thresholds
from groundpose.lab.contenders.registry import by_option
from groundpose.lab.contenders.use import with_scores
from groundpose.lab.evaluate.kitti.average_precision import NEIGHBOURS, Hits, Overlaps, image_boxes, judge
from groundpose.lab.evaluate.kitti.keypoints import Found, KeypointSource
from groundpose.lab.evaluate.kitti.overlap import image_overlap
from groundpose.lab.metrics import (
    angular_translation_error_deg,
    rotation_error_deg,
    translation_error_percent,
    yaw_error_deg,
)
from groundpose.lab.timing import Clock

CAMERA_HEIGHT = 1.65
"""Of KITTI's cameras above the road, metres."""
LEAST_MATCH = 0.5
"""Overlap in the image from which a detection belongs to a label."""
BOXES = ("labels", "detections")


@dataclass(frozen=True)
class Task:
    """What is evaluated; everything that changes a number."""

    methods: tuple[str, ...] = ("default",)
    boxes: str = "labels"
    classes: tuple[str, ...] = tuple(CLASS_OF)
    keypoints: str = "network"
    """Where they come from, in words."""
    pitch_deg: float = 0.0
    """Nominal."""
    frame_tilt_sigma_deg: float | None = None
    """The frame's tilt is estimated from its objects when given."""
    height: float | None = None
    """Of the camera, metres; when it is given all vehicles of a frame stand on one road."""
    region: str | None = None
    """Where vehicles are as large as there, a name of `groundpose.sizes.REGIONS`; the same."""
    least_score: float = 0.0
    """Detections below it are not looked at."""

    def __post_init__(self) -> None:
        """Raises InputError for a name that is none."""
        contenders = by_option("kitti")
        for name, given, known in (
            ("--method", self.methods, contenders),
            ("--boxes", (self.boxes,), BOXES),
            ("--class", self.classes, NEIGHBOURS),
        ):
            for value in given:
                if value not in known:
                    raise input_error(name, f"one of {', '.join(known)}", repr(value))
        gp.SizePrior.region(self.region or "world")
        for option in self.methods:
            if reason := contenders[option].missing():
                raise input_error("--method", "a method that is installed", reason)

    @cached_property
    def frame(self) -> gp.FramePriors | None:
        """What is known of every frame, if anything is."""
        if self.height is None and self.region is None:
            return None
        return gp.FramePriors(size=gp.SizePrior.region(self.region or "world"))

    @property
    def settings(self) -> dict[str, Any]:
        """As JSON has them."""
        return {key: list(v) if isinstance(v, tuple) else v for key, v in asdict(self).items()}


LABEL_COLUMNS = ("kind", "level", "distance_m", "truncated", "occluded", "height_px", "tilt_deg")
"""Of a labelled object: class (its place in `Task.classes`), difficulty, ...; `tilt_deg`: how far the road
under it, by its labelled place and the camera's height, is from the nominal tilt."""
ERROR_COLUMNS = (
    *("e_r_deg", "e_a_deg", "e_t_percent", "yaw_deg", "depth_percent", "depth_ground_percent"),
    *("iou_bev", "iou_3d", "distance_percent", "distance_interval_percent"),
)
"""Of an answer; NaN without one. `depth_ground_percent`: with the distance that puts the object on a road
at the camera's height. `distance_percent`: positive when it is too far away;
`distance_interval_percent`: half the interval that is said to hold the true distance in 95 % of all cases."""


@dataclass
class FrameResult:
    """What is kept of a frame."""

    labels: list[list[float]] = field(default_factory=list)
    """One row of LABEL_COLUMNS per object with a box."""
    missed: int = 0
    """Labels that count but no detection belongs to."""
    errors: dict[str, list[list[float]]] = field(default_factory=dict)
    """{method: one row of ERROR_COLUMNS per object}"""
    hits: dict[str, dict[str, Hits]] = field(default_factory=dict)
    """{method: {class: hits}}"""
    seconds: dict[str, float] = field(default_factory=dict)
    """{method: time of its batch call}"""
    keypoint_seconds: float = 0.0
    boxes: int = 0


@dataclass(frozen=True)
class Prepared:
    """Boxes of a frame with the labels they belong to, and their keypoints."""

    boxes: list[KittiLabel]
    labels: list[KittiLabel | None]
    missed: int
    found: Found

    @property
    def bboxes(self) -> FloatArray:
        """(N, 4) px"""
        return image_boxes(self.boxes)


def prepare(frame: KittiFrame, task: Task, source: KeypointSource, skipped: Skips) -> Prepared | None:
    """Boxes and keypoints; None when the source cannot look at this frame."""
    vehicles = [x for x in frame.labels if x.type in task.classes]
    boxes, missed = vehicles, 0
    labels: list[KittiLabel | None] = [*vehicles]
    if task.boxes == "detections":
        boxes, labels, missed = _matched(_asked(frame, task), vehicles)
    if not boxes:
        return Prepared([], [], missed, Found([], [], []))
    found = source(frame, image_boxes(boxes), labels)
    if found is None:
        skipped.add("frame without an image for the network", f"frame {frame.id}")
        return None
    return Prepared(boxes, labels, missed, found)


def _asked(frame: KittiFrame, task: Task) -> list[KittiLabel]:
    """Detections that are looked at."""
    found = frame.detections or []
    return [x for x in found if x.type in task.classes and (x.score or 0.0) >= task.least_score]


def given(frame: KittiFrame, prepared: Prepared, task: Task) -> Objects:
    """What contenders are given of a frame."""
    found, sigma = prepared.found, task.frame_tilt_sigma_deg
    R, t = nothing(len(prepared.boxes))
    return Objects(
        view=gp.View(frame.camera, math.radians(task.pitch_deg), height=task.height),
        keypoints_2d=padded(found.keypoints_2d, np.nan, 2),
        keypoint_scores=padded(found.scores, 0.0),
        bboxes=prepared.bboxes,
        models=found.models,
        inlier_threshold=relative_thresholds(prepared.bboxes),
        R=R,
        t=t,
        fewest_points=4,
        frame_tilt_sigma=None if sigma is None else math.radians(sigma),
        frame=task.frame,
        keypoint_errors=found.errors,
    )


def estimate(frame: KittiFrame, prepared: Prepared, task: Task, contender: Contender) -> gp.PoseBatch:
    """Poses of a frame by one contender, which makes the most of scores that it can."""
    objects = given(frame, prepared, task)
    return as_poses(objects, with_scores(contender).solve(objects, Clock()))


def evaluate(
    frame: KittiFrame, task: Task, source: KeypointSource, skipped: Skips
) -> tuple[FrameResult, dict[str, list[KittiLabel]]] | None:
    """Numbers of a frame and its results in KITTI's terms by method; None when it cannot be used."""
    clock, contenders = Clock(), by_option("kitti")
    prepared = clock(prepare, frame, task, source, skipped)
    if prepared is None:
        return None
    result = FrameResult(
        [_label_row(x, frame, task) for x in prepared.labels if x is not None], prepared.missed
    )
    result.keypoint_seconds, result.boxes = clock.seconds, len(prepared.boxes)
    answers = {}
    for name in task.methods:
        clock = Clock()
        poses = clock(estimate, frame, prepared, task, contenders[name])
        result.seconds[name] = clock.seconds
        answers[name] = as_results(frame, prepared, poses)
        overlaps = Overlaps.of(answers[name], frame.labels)
        result.errors[name] = errors_of(frame, prepared, poses, overlaps)
        result.hits[name] = {
            class_name: judge(frame.labels, answers[name], class_name, overlaps)
            for class_name in task.classes
        }
    return result, answers


def as_results(frame: KittiFrame, prepared: Prepared, poses: gp.PoseBatch) -> list[KittiLabel]:
    """The poses in KITTI's terms, with the detector's scores if it gave any."""
    given = [box.score for box in prepared.boxes if box.score is not None]
    scores = given if len(given) == len(prepared.boxes) else None
    return results(poses, [box.type for box in prepared.boxes], scores, frame.camera_from_labels)


def _matched(
    detections: list[KittiLabel], vehicles: list[KittiLabel]
) -> tuple[list[KittiLabel], list[KittiLabel | None], int]:
    """Detections by falling score, the label of each, and the number of labels left."""
    detections = sorted(detections, key=lambda x: -(x.score or 0.0))
    overlap = image_overlap(image_boxes(detections), image_boxes(vehicles))
    labels: list[KittiLabel | None] = [None] * len(detections)
    for k, row in enumerate(overlap if len(vehicles) else ()):
        best = int(row.argmax())
        if row[best] >= LEAST_MATCH:
            labels[k], overlap[:, best] = vehicles[best], 0.0
    return detections, labels, len(vehicles) - sum(label is not None for label in labels)


def _label_row(label: KittiLabel, frame: KittiFrame, task: Task) -> list[float]:
    x, y, z = (label.location + frame.camera_from_labels).tolist()
    distance = math.hypot(x, y, z)
    road = math.degrees(math.atan2(y - CAMERA_HEIGHT, math.hypot(x, z)))
    return [
        *(task.classes.index(label.type), difficulty(label), distance, label.truncated, label.occluded),
        *(label.bbox[3] - label.bbox[1], road - task.pitch_deg),
    ]


def errors_of(
    frame: KittiFrame, prepared: Prepared, poses: gp.PoseBatch, overlaps: Overlaps
) -> list[list[float]]:
    """One row of ERROR_COLUMNS per object with a label."""
    rows = [k for k, label in enumerate(prepared.labels) if label is not None]
    if not rows:
        return []
    labels = [label for label in prepared.labels if label is not None]
    own = rows, [frame.labels.index(label) for label in labels]
    angles = np.array([label.rotation_y for label in labels])
    t = np.array([label.location for label in labels]) + frame.camera_from_labels
    R, centre = poses.R[rows], bottom_centres(poses)[rows]
    height = centre @ poses.view.R_camera_from_ground[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        on_road = np.where(height > 0.0, CAMERA_HEIGHT / height, np.nan) * centre[:, 2]
    columns = (
        rotation_error_deg(np.stack([R_from_rotation_y(angle) for angle in angles]), R),
        angular_translation_error_deg(t, centre),
        translation_error_percent(t, centre),
        yaw_error_deg(angles, np.arctan2(-R[:, 2, 2], R[:, 0, 2])),
        100.0 * np.abs(centre[:, 2] / t[:, 2] - 1.0),
        100.0 * np.abs(on_road / t[:, 2] - 1.0),
        overlaps.above[own],
        overlaps.space[own],
        100.0 * (np.linalg.norm(centre, axis=1) / np.linalg.norm(t, axis=1) - 1.0),
        100.0 * _distance_intervals(poses, rows, centre),
    )
    rows_of_columns: list[list[float]] = np.stack(columns, axis=1).tolist()
    return rows_of_columns


def _distance_intervals(poses: gp.PoseBatch, rows: list[int], centre: FloatArray) -> FloatArray:
    """(n,) half the 95 % interval of the distance of bottom centres (n, 3), as fractions of it."""
    distance = np.linalg.norm(centre, axis=1)
    ray = centre / distance[:, None]
    variance = np.einsum("ni,nij,nj->n", ray, poses.covariance[rows, 3:, 3:], ray)
    return np.asarray(np.sqrt(poses.region(dimensions=1) * variance) / distance)


def truth_as_results(frame: KittiFrame) -> list[KittiLabel]:
    """The labels as if they had been found: the self-check."""
    return [replace(label, score=1.0) for label in frame.labels]
