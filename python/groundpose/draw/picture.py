"""Overlay and bird's-eye view in one picture with a legend."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from groundpose._checks import input_error
from groundpose.draw.birds_eye import draw_birds_eye
from groundpose.draw.colours import (
    BOX,
    FRONT,
    INLIER,
    MISSING,
    NO_POSE,
    OUTLIER,
    PAPER,
    POSE,
    POSE_LIGHT,
    SPREAD,
    TRUTH,
)
from groundpose.draw.lines import claimed
from groundpose.draw.overlay import checked_image, draw_overlay
from groundpose.draw.save import save_figure
from groundpose.poses import PoseBatch

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI = 100
# Pixels of the paper: width of the overlay and of that of a wide image; width of the bird's-eye view over its
# height, its least height; strips and gaps.
_OVERLAY, _WIDE_OVERLAY, _SLENDER, _LOWEST, _TITLE, _LEGEND, _GAP = 1500, 1700, 0.58, 560, 40, 40, 12
_WIDE = 2.2
_NARROWEST = 0.1  # width over height, of a paper of matplotlib


def draw_poses(
    poses: PoseBatch,
    image: ArrayLike | None = None,
    path: str | PathLike[str] | None = None,
    *,
    truth: tuple[ArrayLike, ...] | None = None,
    title: str = "",
) -> Figure:
    """Overlay and bird's-eye view side by side; `PoseBatch.draw` describes the arguments."""
    from matplotlib.figure import Figure

    if path is not None:
        check_path(path)
    pixels = checked_image(image, poses)
    aspect = max(pixels.shape[1] / pixels.shape[0], _NARROWEST)
    across = _WIDE_OVERLAY if aspect > _WIDE else _OVERLAY
    overlay = round(across / aspect)
    high = max(overlay + _LEGEND, _LOWEST)
    wide, top = round(_SLENDER * high), _TITLE if title else _GAP
    width, height = 3 * _GAP + across + wide, top + high + _GAP
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=PAPER)

    def part(x: float, y: float, right: float, down: float) -> Any:
        return figure.add_axes((x / width, 1.0 - (y + down) / height, right / width, down / height))

    draw_overlay(pixels, poses, part(_GAP, top, across, overlay))
    draw_birds_eye(poses, truth, part(2 * _GAP + across, top, wide, high))
    if title:
        figure.text(_GAP / width, 1.0 - 0.5 * top / height, title, fontsize=14, va="center")
    figure.legend(
        handles=_legend(poses, truth is not None),
        loc="upper center",
        bbox_to_anchor=((_GAP + 0.5 * across) / width, 1.0 - (top + overlay) / height),
        ncols=10,
        frameon=False,
        fontsize=10,
        columnspacing=1.4,
        borderaxespad=0.5,
    )
    if path is not None:
        save_figure(figure, path, _DPI)
    return figure


def check_path(path: str | PathLike[str]) -> None:
    """Refuse, before any work, a name whose ending says no kind of picture. Raises InputError."""
    from matplotlib.figure import Figure

    kinds = Figure().canvas.get_supported_filetypes()
    if Path(path).suffix.lstrip(".").lower() not in kinds:
        raise input_error("path", f"a name that ends in one of {', '.join(sorted(kinds))}", path)


def _legend(poses: PoseBatch, truth: bool) -> list[Any]:
    """Entries for what this picture holds."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    point: dict[str, Any] = {"linestyle": "none", "markersize": 6}
    seen, shaped = claimed(poses), bool(poses.ok.any())
    own = np.arange(seen.shape[1]) < np.array([len(m.keypoints_3d) for m in poses.models])[:, None]
    missing = bool((~seen & own)[poses.ok].any())
    entries = [
        (True, Line2D([], [], color=BOX, label="2D box given")),
        (not poses.ok.all(), Line2D([], [], color=NO_POSE, linestyle="--", label="no pose, with its status")),
        (True, Line2D([], [], marker="o", color=INLIER, label="inlier", **point)),
        (True, Line2D([], [], marker="x", color=OUTLIER, label="outlier", **point)),
        (
            missing,
            Line2D([], [], marker="o", color=MISSING, markerfacecolor="none", label="not seen", **point),
        ),
        (shaped, Line2D([], [], color=POSE_LIGHT, label="3D box")),
        (shaped, Patch(facecolor=FRONT, alpha=0.5, edgecolor=FRONT, label="its front")),
        (True, Patch(facecolor=POSE_LIGHT, alpha=0.7, edgecolor=POSE, label="footprint")),
        (truth, Line2D([], [], color=TRUTH, linestyle="--", label="truth")),
        (True, Line2D([], [], color=SPREAD, label="95 % of position")),
    ]
    return [handle for shown, handle in entries if shown]
