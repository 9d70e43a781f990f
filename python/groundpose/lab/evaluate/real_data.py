"""Real keypoints with known truth, in our conventions: cars of KITTI (a CNN's keypoints) and of ApolloCar3D.

The files are test input and not part of this package; see `lab.data`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import groundpose as gp
from groundpose.formats.apollo import CAMERAS, IMAGE_SIZE, OURS_FROM_APOLLO, ApolloImage
from groundpose.lab.contenders.objects import Array, Objects, relative_thresholds
from groundpose.lab.data import rotation_about_y

# KITTI objects: x forward, y down, z left; ours: x right, y down, z forward
OURS_FROM_KITTI = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
KITTI_IMAGE = (1242, 375)
APOLLO_TILT_DEG = 8.9
APOLLO_FEWEST_KEYPOINTS = 8
APOLLO_MODES = 5
# The 14 keypoints of a KITTI car span headlight to tail light, roof to wheel CENTRE and (mirrors aside) the
# width; the size in the labels spans roof to ground. The radius is a choice, see the note in `real`.
WHEEL_RADIUS_M = 0.35
MIRRORS = ("L_SideViewMirror", "R_SideViewMirror")


@dataclass(frozen=True, kw_only=True)
class RealObjects(Objects):
    """N objects of one camera and the labelled truth."""

    name: str
    scale_known: bool
    """Whether the models have the true size, so that a distance can be right."""
    frames: npt.NDArray[Any] | None = None
    """(N,) the image of each object; None: not known."""

    @property
    def of_all(self) -> tuple[str, ...]:
        """See `Objects`."""
        return (*super().of_all, "name", "scale_known")


def kitti(folder: Path) -> RealObjects:
    """108 cars of KITTI tracking, 14 keypoints of a CNN with scores, labelled boxes, sizes and yaws.

    The labels are in the frame of camera 0, the images are of camera 2 with projection P2: its fourth column
    is the offset between the two. FileNotFoundError when the file is not there.
    """
    with np.load(folder / "kitti_cnn_keypoints14_dev.npz") as data:
        keypoints, label, names = data["kp"], data["label"], data["names"].tolist()
        mean = data["mean_shape_kitti_frame"] @ OURS_FROM_KITTI.T
        projections = data["P2_by_seq"][data["seq"]]
    P = projections[0]
    if np.abs(projections - P).max() > 0.0:
        raise ValueError("P2: expected one camera for all sequences, got several")
    K = P[:, :3]
    camera = gp.Camera.from_K(K, image_size=KITTI_IMAGE)
    height, width, length = label[:, 11:14].T
    body = [name not in MIRRORS for name in names]
    bboxes = np.ascontiguousarray(label[:, 7:11])
    models = [_kitti_model(mean, body, names, size) for size in zip(length, height, width, strict=True)]
    return RealObjects(
        name="KITTI, CNN keypoints",
        view=gp.View(camera),
        keypoints_2d=np.ascontiguousarray(keypoints[..., :2]),
        keypoint_scores=np.ascontiguousarray(keypoints[..., 2]),
        bboxes=bboxes,
        inlier_threshold=relative_thresholds(bboxes),
        models=models,
        R=rotation_about_y(label[:, 17] + math.pi / 2),
        t=label[:, 14:17] + np.linalg.solve(K, P[:, 3]),
        scale_known=True,
    )


def _kitti_model(
    mean: Array, body: list[bool], names: list[str], size: tuple[float, float, float]
) -> gp.ShapeModel:
    """The mean shape (in no unit) stretched to one car; origin at the bottom centre as in the labels."""
    length, height, width = size
    low, high = mean[body].min(axis=0), mean[body].max(axis=0)
    scale = np.array([width, height - WHEEL_RADIUS_M, length]) / (high - low)
    points = (mean - (low + high) / 2) * scale
    points[:, 1] += -WHEEL_RADIUS_M - points[:, 1].max()
    box = [[-width / 2, -height, -length / 2], [width / 2, 0.0, length / 2]]
    return gp.ShapeModel(points, bbox_3d=box, keypoint_names=names)


def apollo(folder: Path, known_model: bool) -> RealObjects:
    """Cars of ApolloCar3D with at least 8 of 66 keypoints labelled by hand; boxes of the VISIBLE part only.

    `known_model`: each car's own model, or else the mean and modes of all 79. The nominal tilt is the
    mean of the data set. FileNotFoundError when a file is not there.
    """
    library = apollo_library(folder / "apollo_models.npz")
    with np.load(folder / "apollo_cars_dev.npz") as data:
        labelled = data["kp"][..., 2] == 2
        kept = labelled.sum(axis=1) >= APOLLO_FEWEST_KEYPOINTS
        keypoints = np.where(labelled[..., None], data["kp"][..., :2], np.nan)[kept]
        left, top, width, height = data["bbox_xywh"][kept].T
        K, R, t, car = data["K"], data["R"][kept], data["t"][kept], data["car_id"][kept]
        frames = data["image_id"][kept]
    bboxes = np.stack([left, top, left + width, top + height], axis=1)
    models = apollo_models(library, car.tolist(), known_model)
    camera = gp.Camera.from_K(K, image_size=IMAGE_SIZE)
    return RealObjects(
        name=_apollo_name(known_model),
        view=gp.View(camera, pitch=math.radians(APOLLO_TILT_DEG)),
        keypoints_2d=np.ascontiguousarray(keypoints),
        keypoint_scores=None,
        bboxes=bboxes,
        inlier_threshold=relative_thresholds(bboxes),
        models=models,
        R=R @ OURS_FROM_APOLLO.T,
        t=t,
        scale_known=known_model,
        frames=frames,
    )


def apollo_library(path: Path) -> Array:
    """(79, 66, 3) metres, our object frame: keypoints of the car models, from `keypoints_3d` of an .npz."""
    with np.load(path) as data:
        return np.asarray(data["keypoints_3d"] @ OURS_FROM_APOLLO.T)


def apollo_models(library: Array, cars: Sequence[int], known_model: bool) -> list[gp.ShapeModel]:
    """What is known of each car: its own model of the library, or mean and modes of all."""
    if not known_model:
        return [gp.ShapeModel.fit(library, modes=APOLLO_MODES)] * len(cars)
    each = {k: gp.ShapeModel(library[k]) for k in set(cars)}
    return [each[k] for k in cars]


def apollo_images(images: Sequence[ApolloImage], library: Array, known_model: bool) -> list[RealObjects]:
    """Cars of the public set with enough labelled keypoints, one `RealObjects` a camera; see `apollo`."""
    found = []
    for camera in CAMERAS.values():
        rows = [
            (image.id, car)
            for image in images
            for car in image.cars
            if image.camera is camera and np.isfinite(car.keypoints_2d[:, 0]).sum() >= APOLLO_FEWEST_KEYPOINTS
        ]
        if rows:
            cars = [car for _, car in rows]
            bboxes = np.array([car.bbox for car in cars])
            found.append(
                RealObjects(
                    name=_apollo_name(known_model),
                    view=gp.View(camera, pitch=math.radians(APOLLO_TILT_DEG)),
                    keypoints_2d=np.stack([car.keypoints_2d for car in cars]),
                    keypoint_scores=None,
                    bboxes=bboxes,
                    inlier_threshold=relative_thresholds(bboxes),
                    models=apollo_models(library, [car.car_id for car in cars], known_model),
                    R=np.stack([car.R for car in cars]),
                    t=np.stack([car.t for car in cars]),
                    scale_known=known_model,
                    frames=np.array([name for name, _ in rows]),
                )
            )
    return found


def _apollo_name(known_model: bool) -> str:
    return "ApolloCar3D, " + ("known models" if known_model else "shape basis of 79 models")
