"""The overlay: 2D boxes, 3D boxes with their front marked, shapes and keypoints over the image."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from groundpose._checks import FloatArray, describe, input_error, shape_text, type_error
from groundpose.draw.colours import BOX, FRONT, INLIER, MISSING, NO_POSE, OUTLIER, PAPER, POSE, POSE_LIGHT
from groundpose.draw.lines import box_lines, claimed, shape_lines
from groundpose.poses import Pose, PoseBatch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Marks of a keypoint: points of 1/72 inch, as a fraction of the object's longer side there, and limits.
_MARK, _SMALLEST_MARK, _LARGEST_MARK = 0.05, 2.0, 5.5
# Of objects shorter than this on the paper (points) only boxes, number and inliers are drawn: the rest would
# hide them.
_DETAILED = 24.0

_LARGEST_BLANK = 8192  # pixels of a side that keypoints span where there is no image


def draw_overlay(image: ArrayLike | None, poses: PoseBatch, axes: Axes | None = None) -> Axes:
    """2D boxes, projected 3D boxes with their front face in yellow, shapes and keypoints over the image.

    The lines of a shape are drawn for the bundled classes, faintly where the vehicle itself hides them.

    Args:
        image: (H, W, 3) or (H, W), uint8 or float 0 to 1, as the camera took it; None: blank.
        poses: the poses of this image.
        axes: where to draw; None: a new figure.

    Raises:
        InputError: an image of another size than the camera's `image_size`.
    """
    axes = _new_axes() if axes is None else axes
    pixels = show(axes, checked_image(image, poses))
    for index in np.argsort(np.where(poses.ok, -np.linalg.norm(poses.t, axis=1), -np.inf)):  # far ones first
        draw_object(axes, poses, int(index))
    height, width = pixels.shape[:2]
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=(), yticks=())
    return axes


def show(axes: Axes, pixels: NDArray[Any]) -> NDArray[Any]:
    """Put a checked image on the axes and set them up for it, so that sizes on the paper are known."""
    height, width = pixels.shape[:2]
    bright = 255 if pixels.dtype == np.uint8 else 1
    axes.imshow(pixels, cmap="gray", vmin=0, vmax=bright, interpolation="antialiased")
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=(), yticks=())
    return pixels


def draw_object(axes: Axes, poses: PoseBatch, index: int, labelled: bool = True) -> None:
    """All of one object; `labelled`: with number, class and distance or its status."""
    pose = poses[index]
    left, top, right, bottom = np.where(np.isfinite(pose.bbox), pose.bbox, np.nan)
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom], [left, top]])
    colour, dash = (BOX, "-") if pose.ok else (NO_POSE, "--")
    axes.plot(corners[:, 0], corners[:, 1], color=colour, linestyle=dash, linewidth=1.0)
    size = _points(axes, max(right - left, bottom - top))
    detailed = not (pose.ok and size < _DETAILED)
    if pose.ok:
        _draw_box(axes, poses, pose)
        if detailed:
            _draw_shape(axes, poses, pose)
    mark = float(np.clip(_MARK * size, _SMALLEST_MARK, _LARGEST_MARK)) if np.isfinite(size) else _LARGEST_MARK
    _draw_keypoints(axes, poses, index, pose, mark, detailed)
    if labelled:
        said = _said(poses, index, pose) if detailed else str(index)
        _label(axes, said, corners, POSE if pose.ok else NO_POSE)


def _points(axes: Axes, pixels: float) -> float:
    """Pixels of the image in points (1/72 inch) of the paper."""
    (low, _), (high, _) = axes.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    figure = axes.get_figure(root=True)
    assert figure is not None
    return float(pixels * abs(high - low) * 72.0 / figure.dpi)


def _said(poses: PoseBatch, index: int, pose: Pose) -> str:
    classes = getattr(poses, "classes", None)
    words = [str(index), *([] if classes is None else [str(classes[index]).replace("_", " ")])]
    return " ".join([*words, f"{np.linalg.norm(pose.t):.0f} m" if pose.ok else pose.status])


def _draw_box(axes: Axes, poses: PoseBatch, pose: Pose) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    lines = box_lines(poses.view, pose)
    if lines.area is not None and lines.faces_camera:
        axes.add_collection(PolyCollection([lines.area], facecolors=FRONT, alpha=0.16))
    axes.add_collection(LineCollection(lines.others, colors=POSE_LIGHT, linewidths=1.5))
    # Behind the body the front is only hinted at.
    style: dict[str, Any] = (
        {"linewidths": 1.8} if lines.faces_camera else {"linewidths": 1.2, "linestyles": "--"}
    )
    axes.add_collection(LineCollection(lines.front, colors=FRONT, **style))


def _draw_shape(axes: Axes, poses: PoseBatch, pose: Pose) -> None:
    from matplotlib.collections import LineCollection

    near, far = shape_lines(poses.view, pose)
    axes.add_collection(LineCollection(far, colors=PAPER, linewidths=0.6, alpha=0.3))
    axes.add_collection(LineCollection(near, colors=PAPER, linewidths=0.9, alpha=0.9))


def _draw_keypoints(
    axes: Axes, poses: PoseBatch, index: int, pose: Pose, mark: float, detailed: bool
) -> None:
    seen = claimed(poses)[index][: len(pose.keypoints_2d)]
    inlier = pose.inlier_mask & seen
    _scatter(
        axes, pose.keypoints_2d[inlier], s=mark**2, color=INLIER, edgecolors=PAPER, linewidths=0.12 * mark
    )
    if not detailed:
        return
    if pose.ok:
        hidden = pose.keypoints_3d[~seen] @ pose.R.T + pose.t
        places = poses.view.camera.image_of(hidden)
        _scatter(axes, places, s=(0.75 * mark) ** 2, facecolors="none", edgecolors=MISSING, linewidths=0.8)
    wrong = pose.keypoints_2d[seen & ~inlier]
    _scatter(axes, wrong, s=(0.9 * mark) ** 2, marker="x", color=OUTLIER, linewidths=0.25 * mark)


def _scatter(axes: Axes, points: FloatArray, **style: Any) -> None:
    axes.scatter(points[:, 0], points[:, 1], zorder=3, **style)


def _label(axes: Axes, label: str, corners: FloatArray, colour: str) -> None:
    if not np.isfinite(corners[:3]).all():
        return
    (left, top), (right, _) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    (_, width), (height, _) = axes.get_xlim(), axes.get_ylim()
    at_right, at_top = left > 0.9 * width, top < 0.03 * height  # no room there for the words
    axes.annotate(
        label,
        (min(right, width) if at_right else left, max(top, 0.0)),
        xytext=(-2 if at_right else 1, -3 if at_top else 2),
        textcoords="offset points",
        ha="right" if at_right else "left",
        va="top" if at_top else "baseline",
        fontsize=8.5,
        color=PAPER,
        bbox={"facecolor": colour, "edgecolor": "none", "pad": 1.2},
        annotation_clip=True,
        zorder=4,
    )


def checked_image(image: Any, poses: PoseBatch) -> NDArray[Any]:
    """The image as an array, or a blank one; InputError, TypeError as `draw_overlay` says."""
    size = poses.view.camera.image_size
    if image is None:
        if size is None:
            points = poses.keypoints_2d
            points = points[((points >= 0.0) & (points < _LARGEST_BLANK)).all(axis=2)]
            far = points.max(axis=0) + 20.0 if len(points) else (640.0, 480.0)
            size = (int(far[0]), int(far[1]))
        if max(size) > 2 * _LARGEST_BLANK:
            raise input_error("image", f"one, where the camera's image is {size[0]} x {size[1]}", "none")
        return np.full((size[1], size[0]), 245, dtype=np.uint8)
    pixels = np.asarray(image)
    if pixels.dtype.kind not in "uf" or pixels.ndim not in (2, 3):
        raise type_error("image", "an array (H, W) or (H, W, 3), uint8 or float 0 to 1", describe(image))
    if size is not None and pixels.shape[:2] != (size[1], size[0]):
        expected = f"{shape_text((size[1], size[0]))} as the camera's image_size"
        raise input_error("image", expected, shape_text(pixels.shape[:2]))
    return pixels


def _new_axes() -> Axes:
    from matplotlib.figure import Figure

    axes = Figure(figsize=(12.8, 7.2), layout="constrained").subplots()
    assert not isinstance(axes, np.ndarray)
    return axes
