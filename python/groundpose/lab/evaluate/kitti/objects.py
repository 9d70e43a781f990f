"""Labelled cars of many frames as one set of objects, for experiments that look at all of them at once."""

from __future__ import annotations

from typing import Any

import numpy as np

import groundpose as gp
from groundpose.formats.kitti.dataset import DIFFICULTIES, KittiFrames, difficulty
from groundpose.formats.kitti.results import R_from_rotation_y
from groundpose.formats.skips import Skips
from groundpose.lab.contenders.objects import relative_thresholds
from groundpose.lab.evaluate.kitti.frame import Task, prepare
from groundpose.lab.evaluate.kitti.keypoints import KeypointSource
from groundpose.lab.evaluate.real_data import RealObjects

CLASS = "Car"
"""One class: all have the same keypoints."""


def cars_of(
    folder: KittiFrames, source: KeypointSource, boxes: str, skipped: Skips, limit: int | None = None
) -> RealObjects:
    """The cars that KITTI counts of all frames, by their label or by detections that belong to one.

    ValueError when the frames have several cameras or no car.
    """
    task = Task(boxes=boxes, classes=(CLASS,))
    columns: list[tuple[Any, ...]] = []
    cameras = set()
    for name in folder.ids()[:limit]:
        frame = folder.read(name, skipped)
        prepared = None if frame is None else prepare(frame, task, source, skipped)
        if frame is None or prepared is None:
            continue
        cameras.add(frame.camera)
        found = prepared.found
        given = zip(
            prepared.labels, prepared.bboxes, found.keypoints_2d, found.scores, found.models, strict=True
        )
        for label, box, points, scores, model in given:
            if label is not None and difficulty(label) < len(DIFFICULTIES):
                turn = R_from_rotation_y(label.rotation_y)
                place = label.location + frame.camera_from_labels - turn @ model.bottom_centre
                columns.append((name, box, points, scores, model, turn, place))
    if len(cameras) != 1:
        raise ValueError(f"{folder.root}: expected cars of one camera, got {len(cameras)} cameras")
    stacks = [list(column) for column in zip(*columns, strict=True)]
    names, bboxes, keypoints, weights, models, R, t = stacks
    return RealObjects(
        name=f"KITTI, boxes of {boxes}",
        view=gp.View(cameras.pop()),
        keypoints_2d=np.stack(keypoints),
        keypoint_scores=np.stack(weights),
        bboxes=np.stack(bboxes),
        inlier_threshold=relative_thresholds(np.stack(bboxes)),
        models=models,
        R=np.stack(R),
        t=np.stack(t),
        scale_known=False,
        frames=np.array(names),
    )
