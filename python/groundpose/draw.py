"""Pictures: poses over the image, and the bird's-eye view. matplotlib is imported when first used.

Longer than most files here because palette, legend and both views must agree.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, describe, input_error, shape_text, shaped, type_error
from groundpose.poses import Pose, PoseBatch

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, told apart with any colour vision; the only place where colours are chosen.
POSE, POSE_LIGHT, TRUTH, BOX = "#0072B2", "#56B4E9", "#000000", "#E69F00"
INLIER, OUTLIER, MISSING, NO_POSE, SPREAD = "#009E73", "#D55E00", "#777777", "#CC79A7", "#D55E00"
PAPER, GRID = "#FFFFFF", "#DDDDDD"

# An ellipse of this many standard deviations holds 95 % of a normal distribution in the plane.
ELLIPSE_SIGMAS = 2.448

# Nearest depth, metres, that lines of a box are drawn from.
_NEAR = 0.1

# Corners of a 3D box as (x, y, z) choices of min and max, and its edges; z = 1 is the front.
_CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))
_EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1]
_FRONT = (1, 3, 7, 5)


def draw_poses(
    poses: PoseBatch,
    image: object = None,
    path: str | PathLike[str] | None = None,
    *,
    truth: tuple[object, object] | None = None,
    title: str = "",
) -> Figure:
    """Overlay and bird's-eye view side by side; `PoseBatch.draw` describes the arguments."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(16.0, 6.4), layout="constrained", facecolor=PAPER)
    if path is not None:
        check_path(path)
    left, right = figure.subplots(1, 2, width_ratios=(3.4, 1.0))
    draw_overlay(image, poses, axes=left)
    draw_birds_eye(poses, truth, axes=right)
    if title:
        figure.suptitle(title, fontsize=14)
    figure.legend(
        handles=_legend(poses, truth is not None),
        loc="outside lower center",
        ncols=9,
        frameon=False,
        fontsize=10,
    )
    if path is not None:
        figure.savefig(path, dpi=110)
    return figure


def check_path(path: str | PathLike[str]) -> None:
    """Refuse, before any work, a name whose ending says no kind of picture. Raises InputError."""
    from matplotlib.figure import Figure

    kinds = Figure().canvas.get_supported_filetypes()
    if Path(path).suffix.lstrip(".").lower() not in kinds:
        raise input_error("path", f"a name that ends in one of {', '.join(sorted(kinds))}", path)


def draw_overlay(image: object, poses: PoseBatch, axes: Axes | None = None) -> Axes:
    """2D boxes, projected 3D boxes with their front face filled, and keypoints over the image.

    Args:
        image: (H, W, 3) or (H, W), uint8 or float 0 to 1, as the camera took it; None: blank.
        poses: the poses of this image.
        axes: where to draw; None: a new figure.

    Raises:
        InputError: an image of another size than the camera's `image_size`.
    """
    axes = _new_axes((12.8, 7.2)) if axes is None else axes
    pixels = _image(image, poses)
    height, width = pixels.shape[:2]
    axes.imshow(
        pixels, cmap="gray", vmin=0, vmax=255 if pixels.dtype == np.uint8 else 1, interpolation="antialiased"
    )
    for index in np.argsort(np.where(poses.ok, -poses.t[:, 2], -np.inf)):  # far ones first
        _draw_object(axes, poses, int(index))
    _draw_keypoints(axes, poses)
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=(), yticks=())
    return axes


def draw_birds_eye(
    poses: PoseBatch, truth: tuple[object, object] | None = None, axes: Axes | None = None
) -> Axes:
    """Footprints on the ground seen from above, with 95 % ellipses of their position.

    Args:
        poses: the poses.
        truth: `(R, t)` arrays (N, 3, 3) and (N, 3) in the camera frame, NaN = none.
        axes: where to draw; None: a new figure.
    """
    from matplotlib.patches import Polygon

    axes = _new_axes((5.0, 7.2)) if axes is None else axes
    reach: list[FloatArray] = [np.array([[-6.0, 0.0], [6.0, 12.0]])]  # the limits follow from what is drawn
    if truth is not None:
        R, t = shaped("truth R", truth[0], (len(poses), 3, 3)), shaped("truth t", truth[1], (len(poses), 3))
        for i in np.flatnonzero(np.isfinite(t).all(axis=1)):
            outline = footprint_on_ground(poses, int(i), R[i], t[i])
            axes.add_patch(
                Polygon(outline, fill=False, edgecolor=TRUTH, linestyle=(0, (3, 2)), linewidth=1.2)
            )
            reach.append(outline)
            if not poses.ok[i]:
                _number(axes, f"{i} no pose", outline, below=True)
    for i in np.flatnonzero(poses.ok):
        reach.append(_draw_footprint(axes, poses, int(i)))
    _frame_ground(axes, poses, np.concatenate(reach))
    return axes


def footprint_on_ground(poses: PoseBatch, index: int, R: FloatArray, t: FloatArray) -> FloatArray:
    """`[x, z]` (C, 2), metres in the ground frame, of an object's footprint at a pose."""
    model = poses.models[index]
    (x0, _, z0), (x1, bottom, z1) = model.bbox_3d
    corners = model.footprint
    if corners is None:
        corners = np.array([[x0, z0], [x0, z1], [x1, z1], [x1, z0]])
    points = np.insert(corners, 1, bottom, axis=1) @ R.T + t
    return np.asarray((points @ poses.view.R_camera_from_ground)[:, [0, 2]])


def _draw_object(axes: Axes, poses: PoseBatch, index: int) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    pose = poses[index]
    left, top, right, bottom = np.where(np.isfinite(pose.bbox), pose.bbox, np.nan)
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom], [left, top]])
    colour = BOX if pose.ok else NO_POSE
    axes.plot(corners[:, 0], corners[:, 1], color=colour, linestyle="-" if pose.ok else "--", linewidth=1.2)
    label = f"{index}" if pose.ok else f"{index} {pose.status}"
    if pose.ok:
        camera_corners = pose.model.bbox_3d[_CORNERS, [0, 1, 2]] @ pose.R.T + pose.t
        lines = [_segment(poses, camera_corners[list(edge)]) for edge in _EDGES]
        axes.add_collection(
            LineCollection([line for line in lines if line is not None], colors=POSE_LIGHT, linewidths=1.7)
        )
        if (camera_corners[list(_FRONT), 2] > _NEAR).all():
            front = poses.view.camera.distort(poses.view.project(camera_corners[list(_FRONT)]))
            axes.add_collection(PolyCollection([front], facecolors=POSE_LIGHT, alpha=0.4))
        label += f"  {np.linalg.norm(pose.t):.0f} m"
    _label(axes, label, corners, POSE if pose.ok else NO_POSE)


def _label(axes: Axes, label: str, corners: FloatArray, colour: str) -> None:
    if not np.isfinite(corners[:3]).all():
        return
    axes.annotate(
        label,
        (float(corners[:, 0].min()), float(corners[:, 1].min())),
        xytext=(1, 2),
        textcoords="offset points",
        fontsize=8.5,
        color=PAPER,
        bbox={"facecolor": colour, "edgecolor": "none", "pad": 1.2},
        annotation_clip=True,
    )


def _segment(poses: PoseBatch, ends: FloatArray) -> FloatArray | None:
    """A line of the camera frame in the image, cut at the near plane; curved by a lens, so in steps."""
    depths = ends[:, 2]
    if (depths <= _NEAR).all():
        return None
    if (depths <= _NEAR).any():
        behind = int(np.argmin(depths))
        share = (_NEAR - depths[1 - behind]) / (depths[behind] - depths[1 - behind])
        ends = ends.copy()
        ends[behind] = ends[1 - behind] + share * (ends[behind] - ends[1 - behind])
        ends[behind, 2] = _NEAR
    steps = np.linspace(0.0, 1.0, 2 if poses.view.camera.distortion is None else 12)[:, None]
    return poses.view.camera.distort(poses.view.project(ends[0] + steps * (ends[1] - ends[0])))


def _draw_keypoints(axes: Axes, poses: PoseBatch) -> None:
    seen = np.isfinite(poses.residuals)
    given = np.isfinite(poses.keypoints_2d).all(axis=2)
    missing = [_missing(poses, pose, seen[i]) for i, pose in enumerate(poses) if pose.ok]
    _scatter(axes, np.concatenate(missing or [np.empty((0, 2))]), s=18, facecolors="none", edgecolors=MISSING)
    _scatter(
        axes, poses.keypoints_2d[given & ~poses.inlier_mask], s=22, marker="x", color=OUTLIER, linewidths=1.3
    )
    _scatter(
        axes, poses.keypoints_2d[poses.inlier_mask], s=14, color=INLIER, edgecolors=PAPER, linewidths=0.5
    )


def _scatter(axes: Axes, points: FloatArray, **style: Any) -> None:
    axes.scatter(points[:, 0], points[:, 1], zorder=3, **style)


def _missing(poses: PoseBatch, pose: Pose, seen: NDArray[np.bool_]) -> FloatArray:
    points = pose.keypoints_3d[~seen[: len(pose.keypoints_3d)]]
    return poses.view.camera.distort(poses.view.project(points @ pose.R.T + pose.t))


def _draw_footprint(axes: Axes, poses: PoseBatch, index: int) -> FloatArray:
    from matplotlib.patches import Polygon

    pose = poses[index]
    outline = footprint_on_ground(poses, index, pose.R, pose.t)
    axes.add_patch(Polygon(outline, facecolor=POSE_LIGHT, edgecolor=POSE, alpha=0.7))
    (x0, _, z0), (x1, bottom, z1) = pose.model.bbox_3d
    x, z = 0.5 * (x0 + x1), 0.5 * (z0 + z1)
    nose = np.array([[x0, bottom, z], [x, bottom, z1], [x1, bottom, z]]) @ pose.R.T + pose.t
    axes.plot(*(nose @ poses.view.R_camera_from_ground)[:, [0, 2]].T, color=PAPER, linewidth=1.2)
    ellipse = position_ellipse(poses, index)
    axes.fill(*ellipse.T, facecolor=SPREAD, edgecolor=SPREAD, linewidth=1.4)
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
    radii = ELLIPSE_SIGMAS * np.sqrt(np.maximum(values, 0.0))[:, None]
    return np.asarray((to_ground @ (lever + pose.t)) + (vectors @ (radii * circle)).T)


def _frame_ground(axes: Axes, poses: PoseBatch, reach: FloatArray) -> None:
    """Limits, rings every ten metres and the camera with its field of view."""
    low, high = reach.min(axis=0) - 2.0, reach.max(axis=0) + 2.0
    half = max(high[0], -low[0], 0.27 * high[1])  # the camera in the middle, not too slender
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
            side = (column - camera.cx) / camera.fx
            axes.plot([0.0, 200.0 * side], [0.0, 200.0], color=MISSING, linewidth=0.9, zorder=0)
    axes.plot(0.0, 0.0, marker="^", markersize=9, color=TRUTH, clip_on=False)
    axes.set(xlim=(-half, half), ylim=(min(low[1], -1.0), high[1]), aspect="equal", xticks=(), yticks=())


def _legend(poses: PoseBatch, truth: bool) -> list[Any]:
    """Entries for what this picture holds."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    point: dict[str, Any] = {"linestyle": "none", "markersize": 6}
    seen, given = np.isfinite(poses.residuals), np.isfinite(poses.keypoints_2d).all(axis=2)
    entries = [
        (True, Line2D([], [], color=BOX, label="2D box given")),
        (not poses.ok.all(), Line2D([], [], color=NO_POSE, linestyle="--", label="no pose, with its status")),
        (True, Line2D([], [], marker="o", color=INLIER, label="inlier", **point)),
        (True, Line2D([], [], marker="x", color=OUTLIER, label="outlier", **point)),
        (
            bool((~seen[poses.ok]).any() and not given.all()),
            Line2D([], [], marker="o", color=MISSING, markerfacecolor="none", label="not seen", **point),
        ),
        (True, Patch(facecolor=POSE_LIGHT, alpha=0.7, edgecolor=POSE, label="estimate (front filled)")),
        (truth, Line2D([], [], color=TRUTH, linestyle="--", label="truth")),
        (True, Line2D([], [], color=SPREAD, label="95 % of position")),
    ]
    return [handle for shown, handle in entries if shown]


def _image(image: Any, poses: PoseBatch) -> NDArray[Any]:
    size = poses.view.camera.image_size
    if image is None:
        if size is None:
            points = poses.keypoints_2d[np.isfinite(poses.keypoints_2d).all(axis=2)]
            far = points.max(axis=0) + 20.0 if len(points) else (640.0, 480.0)
            size = (int(far[0]), int(far[1]))
        return np.full((size[1], size[0]), 245, dtype=np.uint8)
    pixels = np.asarray(image)
    if pixels.dtype.kind not in "uf" or pixels.ndim not in (2, 3):
        raise type_error("image", "an array (H, W) or (H, W, 3), uint8 or float 0 to 1", describe(image))
    if size is not None and pixels.shape[:2] != (size[1], size[0]):
        expected = f"{shape_text((size[1], size[0]))} as the camera's image_size"
        raise input_error("image", expected, shape_text(pixels.shape[:2]))
    return pixels


def _new_axes(inches: Sequence[float]) -> Axes:
    from matplotlib.figure import Figure

    axes = Figure(figsize=(inches[0], inches[1]), layout="constrained").subplots()
    assert not isinstance(axes, np.ndarray)
    return axes
