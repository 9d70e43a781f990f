"""Frames of an evaluation to look at: a recording for Rerun, and the paper's Fig. 6 (RE against HRE)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import groundpose as gp
from groundpose._checks import input_error
from groundpose.draw.colours import FRONT, INLIER, PAPER, POSE_LIGHT
from groundpose.draw.lines import box_lines, shape_lines
from groundpose.formats.kitti.dataset import KittiFrame
from groundpose.formats.kitti.results import R_from_rotation_y
from groundpose.formats.rerun_log import RerunLog, Truth
from groundpose.formats.skips import Skips
from groundpose.lab.contenders.registry import by_option
from groundpose.lab.evaluate.kitti.frame import Prepared, estimate, prepare
from groundpose.lab.evaluate.kitti.run import Advance, Worker

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURE_METHODS = ("p1p+re", "p1p+hre")
_ROWS = ("inlier keypoints", "3D boxes", "shapes")


def record(worker: Worker, ids: Sequence[str], path: Path, advance: Advance | None = None) -> int:
    """Poses of frames by the first method as a recording, with the labels; how many frames there are in
    it."""
    method, count = by_option("kitti")[worker.task.methods[0]], 0
    with RerunLog(path) as log:
        for number, name in enumerate(ids):
            found = _frame(worker, name)
            if found is not None:
                frame, prepared = found
                poses = estimate(frame, prepared, worker.task, method)
                names = [f"{k} {box.type}" for k, box in enumerate(prepared.boxes)]
                log.add(number, poses, pixels_of(frame), names, _truth(frame, prepared))
                count += 1
            if advance is not None:
                advance(number + 1, len(ids))
    return count


def _frame(worker: Worker, name: str) -> tuple[KittiFrame, Prepared] | None:
    skipped = Skips()
    frame = worker.folder.read(name, skipped)
    prepared = None if frame is None else prepare(frame, worker.task, worker.source, skipped)
    return None if frame is None or prepared is None else (frame, prepared)


def _truth(frame: KittiFrame, prepared: Prepared) -> Truth:
    count = len(prepared.labels)
    R, t, size = np.full((count, 3, 3), np.nan), np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    for k, label in enumerate(prepared.labels):
        if label is not None:
            R[k], t[k] = R_from_rotation_y(label.rotation_y), label.location + frame.camera_from_labels
            size[k] = label.height, label.width, label.length
    return R, t, size


def pixels_of(frame: KittiFrame) -> Any:
    """The image (H, W, 3), or None."""
    if frame.image is None:
        return None
    from groundpose.keypoints.image import as_rgb

    return as_rgb(frame.image)


def figure6(worker: Worker, name: str) -> Figure:
    """The paper's Fig. 6: RNSC-P1P with RE at the left and HRE at the right; inlier keypoints, 3D boxes,
    shapes.

    Raises InputError when the frame cannot be used.
    """
    from matplotlib.figure import Figure

    found = _frame(worker, name)
    if found is None or not found[1].boxes:
        raise input_error("frame", "a frame with vehicles that can be used", name)
    frame, prepared = found
    width, height = frame.image_size
    drawn = Figure(figsize=(14.0, 0.9 + 3 * 6.9 * height / width), layout="constrained", facecolor=PAPER)
    panels = drawn.subplots(len(_ROWS), len(FIGURE_METHODS), squeeze=False)
    image = pixels_of(frame)
    contenders = by_option("kitti")
    for column, option in enumerate(FIGURE_METHODS):
        poses = estimate(frame, prepared, worker.task, contenders[option])
        for axes, row in zip(panels[:, column], _ROWS, strict=True):
            shown = np.full((height, width, 3), 60, dtype=np.uint8) if image is None else image
            axes.imshow(shown, interpolation="antialiased")
            axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=(), yticks=())
            _PANELS[row](axes, poses)
        inliers = int(poses.inlier_count[poses.ok].sum())
        panels[0, column].set_title(f"{contenders[option].name}: {inliers} inliers", fontsize=11)
    for axes, row in zip(panels[:, 0], _ROWS, strict=True):
        axes.set_ylabel(row, fontsize=10)
    return drawn


def _inliers(axes: Axes, poses: gp.PoseBatch) -> None:
    points = poses.keypoints_2d[poses.inlier_mask]
    axes.scatter(points[:, 0], points[:, 1], s=9, color=INLIER, edgecolors=PAPER, linewidths=0.3)


def _boxes(axes: Axes, poses: gp.PoseBatch) -> None:
    from matplotlib.collections import LineCollection

    for pose in poses:
        if pose.ok:
            lines = box_lines(poses.view, pose)
            axes.add_collection(LineCollection(lines.others, colors=POSE_LIGHT, linewidths=1.2))
            axes.add_collection(LineCollection(lines.front, colors=FRONT, linewidths=1.4))


def _shapes(axes: Axes, poses: gp.PoseBatch) -> None:
    from matplotlib.collections import LineCollection

    for pose in poses:
        if pose.ok:
            near, far = shape_lines(poses.view, pose)
            axes.add_collection(LineCollection(far, colors=POSE_LIGHT, linewidths=0.5, alpha=0.5))
            axes.add_collection(LineCollection(near, colors=PAPER, linewidths=1.0))


_PANELS = dict(zip(_ROWS, (_inliers, _boxes, _shapes), strict=True))
