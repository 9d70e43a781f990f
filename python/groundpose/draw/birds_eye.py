"""The bird's-eye view: footprints on the ground, 95 % ellipses of their position, the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from groundpose._checks import FloatArray, input_error, shaped
from groundpose.draw.colours import GRID, MISSING, PAPER, POSE, POSE_LIGHT, SPREAD, TRUTH
from groundpose.draw.lines import footprint
from groundpose.poses import PoseBatch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ELLIPSE_LEVEL = 0.95


def draw_birds_eye(
    poses: PoseBatch, truth: tuple[ArrayLike, ...] | None = None, axes: Axes | None = None
) -> Axes:
    """Footprints on the ground seen from above, with 95 % ellipses of their position.

    Args:
        poses: the poses.
        truth: `(R, t)` arrays (N, 3, 3) and (N, 3) in the camera frame, NaN = none; or `(R, t, bbox_3d)` with
            the true 3D boxes (N, 2, 3), else the truth has the estimated size.
        axes: where to draw; None: a new figure.
    """
    axes = _new_axes() if axes is None else axes
    reach: list[FloatArray] = [np.array([[-6.0, 0.0], [6.0, 12.0]])]  # the limits follow from what is drawn
    if truth is not None:
        reach += _draw_truth(axes, poses, truth)
    for i in np.flatnonzero(poses.ok):
        reach.append(_draw_footprint(axes, poses, int(i)))
    _frame_ground(axes, poses, np.concatenate(reach))
    return axes


def _new_axes() -> Axes:
    from matplotlib.figure import Figure

    axes = Figure(figsize=(5.0, 7.2), layout="constrained").subplots()
    assert not isinstance(axes, np.ndarray)
    return axes


def _draw_truth(axes: Axes, poses: PoseBatch, truth: tuple[ArrayLike, ...]) -> list[FloatArray]:
    from matplotlib.patches import Polygon

    if len(truth) not in (2, 3):
        raise input_error("truth", "(R, t) or (R, t, bbox_3d)", f"{len(truth)} of them")
    count = len(poses)
    R, t = shaped("truth R", truth[0], (count, 3, 3)), shaped("truth t", truth[1], (count, 3))
    boxes = shaped("truth bbox_3d", truth[2], (count, 2, 3)) if len(truth) == 3 else None
    outlines = []
    for i in np.flatnonzero(np.isfinite(t).all(axis=1)).tolist():
        outline = footprint_on_ground(poses, i, R[i], t[i], None if boxes is None else boxes[i])
        dashes = (0, (3, 2))
        axes.add_patch(Polygon(outline, fill=False, edgecolor=TRUTH, linestyle=dashes, linewidth=1.2))
        outlines.append(outline)
        if not poses.ok[i]:
            _number(axes, f"{i} no pose", outline, below=True)
    return outlines


def footprint_on_ground(
    poses: PoseBatch, index: int, R: FloatArray, t: FloatArray, bbox_3d: FloatArray | None = None
) -> FloatArray:
    """`[x, z]` (C, 2), metres in the ground frame, of an object's outline at a pose: of its estimated shape,
    or of `bbox_3d` (2, 3)."""
    pose = poses[index]
    if bbox_3d is None:
        corners = footprint(pose.model, pose.shape_coefficients if pose.ok else None)
    else:
        (x0, _, z0), (x1, bottom, z1) = bbox_3d
        corners = np.array([[x0, bottom, z0], [x0, bottom, z1], [x1, bottom, z1], [x1, bottom, z0]])
    points = corners @ R.T + t
    return np.asarray((points @ poses.view.R_camera_from_ground)[:, [0, 2]])


def _draw_footprint(axes: Axes, poses: PoseBatch, index: int) -> FloatArray:
    from matplotlib.patches import Polygon

    pose = poses[index]
    outline = footprint_on_ground(poses, index, pose.R, pose.t)
    axes.add_patch(Polygon(outline, facecolor=POSE_LIGHT, edgecolor=POSE, alpha=0.7))
    corners = footprint(pose.model, pose.shape_coefficients)
    (x0, bottom, z0), (x1, _, z1) = corners.min(axis=0), corners.max(axis=0)
    x, z = 0.5 * (x0 + x1), 0.5 * (z0 + z1)
    nose = np.array([[x0, bottom, z], [x, bottom, z1], [x1, bottom, z]]) @ pose.R.T + pose.t
    axes.plot(*(nose @ poses.view.R_camera_from_ground)[:, [0, 2]].T, color=PAPER, linewidth=1.2)
    ellipse = position_ellipse(poses, index)
    axes.fill(*ellipse.T, facecolor=SPREAD, edgecolor=SPREAD, linewidth=1.4, alpha=0.8)
    _number(axes, str(index), outline)
    return outline


def _number(axes: Axes, label: str, outline: FloatArray, below: bool = False) -> None:
    beside = (outline[:, 0].mean(), outline[:, 1].min()) if below else outline[np.argmax(outline[:, 0])]
    axes.annotate(
        label,
        (float(beside[0]), float(beside[1])),
        xytext=(0 if below else 3, -3),
        textcoords="offset points",
        ha="center" if below else "left",
        va="top" if below else "baseline",
        fontsize=9,
        color=TRUTH,
        clip_on=True,
    )


def position_ellipse(poses: PoseBatch, index: int) -> FloatArray:
    """`[x, z]` (64, 2), metres in the ground frame, of the 95 % ellipse around the object's middle."""
    pose = poses[index]
    middle = pose.model.bbox_3d.mean(axis=0)
    lever = pose.R @ middle
    # A rotation step moves the middle as well: d(R m) = -[R m]_x dw.
    cross = np.array([[0.0, lever[2], -lever[1]], [-lever[2], 0.0, lever[0]], [lever[1], -lever[0], 0.0]])
    to_ground = poses.view.R_camera_from_ground[:, [0, 2]].T
    jacobian = to_ground @ np.hstack([cross, np.eye(3)])
    covariance = jacobian @ pose.covariance @ jacobian.T
    if not np.isfinite(covariance).all():
        return np.empty((0, 2))
    values, vectors = np.linalg.eigh(covariance)
    angles = np.linspace(0.0, 2.0 * np.pi, 64)
    circle = np.stack([np.cos(angles), np.sin(angles)])
    radii = np.sqrt(poses.region(ELLIPSE_LEVEL, dimensions=2) * np.maximum(values, 0.0))[:, None]
    return np.asarray((to_ground @ (lever + pose.t)) + (vectors @ (radii * circle)).T)


def _frame_ground(axes: Axes, poses: PoseBatch, reach: FloatArray) -> None:
    """Limits, rings every ten metres and the camera with its field of view."""
    low, high = reach.min(axis=0) - 2.0, reach.max(axis=0) + 2.0
    near = min(low[1], -1.0)
    paper = axes.get_window_extent()
    # the camera in the middle, all of the paper used
    half = max(high[0], -low[0], 0.5 * (high[1] - near) * paper.width / paper.height)
    high[1] = near + 2.0 * half * paper.height / paper.width
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 181)
    for radius in np.arange(10.0, float(np.hypot(half, high[1])), 10.0):
        axes.plot(radius * np.sin(angles), radius * np.cos(angles), color=GRID, linewidth=0.8, zorder=0)
        beside = -0.72 * half  # where no vehicle's number is likely
        if abs(beside) < radius < high[1]:
            at = (beside, float(np.sqrt(radius**2 - beside**2)))
            axes.annotate(f"{radius:.0f} m", at, fontsize=8, color=MISSING, ha="center", va="bottom")
    camera = poses.view.camera
    if camera.image_size is not None:
        for column in (0.0, float(camera.image_size[0])):
            side, _, ahead = 200.0 * camera.directions_of((column, camera.cy))  # NaN beyond a wide lens
            axes.plot([0.0, side], [0.0, ahead], color=MISSING, linewidth=0.9, zorder=0)
    axes.plot(0.0, 0.0, marker="^", markersize=9, color=TRUTH, clip_on=False)
    axes.set(xlim=(-half, half), ylim=(near, high[1]), aspect="equal", xticks=(), yticks=())
