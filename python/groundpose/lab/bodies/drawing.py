"""`python -m groundpose.lab.bodies.drawing`: the keypoints of each class on a body (paper, Fig. C.1)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from groundpose._checks import FloatArray
from groundpose.draw.save import save_figure
from groundpose.lab.bodies.body import MATERIALS, Body
from groundpose.lab.bodies.catalogue import body
from groundpose.lab.bodies.geometry.mesh import rotation
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import keypoint_indices

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FOLDER = Path("docs/vehicles")
EXAMPLES: dict[str, tuple[str, int]] = {
    "car": ("sedan", 1),
    "van_bus": ("minibus", 1),
    "pickup": ("double_cab", 1),
    "box_truck": ("cab_gap", 1),
}
"""Style and seed of the drawn body of each class."""
# Azimuth and elevation of the viewpoint, degrees: from the front left, from the rear right.
_VIEWS = ((218.0, 18.0), (38.0, 18.0))
_MARGIN_M, _SAMPLES = 0.35, 2
_TONES = {
    "glass": 0.62,
    "tyre": 0.38,
    "plastic": 0.48,
    "grille": 0.42,
    "headlamp": 1.0,
    "taillamp": 0.55,
    "seam": 0.5,
}
_VISIBLE, _HIDDEN, _ACCENT = "#1a1a1a", "#8a8f98", "#d1495b"
# A keypoint lies on a surface; it counts as hidden when another surface is this far (metres) in front of it.
_DEPTH_TOLERANCE = 0.04


def draw_keypoints(class_name: str, pixels_per_metre: float = 110.0) -> Figure:
    """Draw the keypoints of class `class_name` with their numbers on a body seen from two sides.

    Dark numbers are visible in that view, grey ones hidden.
    """
    from matplotlib.figure import Figure

    style, seed = EXAMPLES[class_name]
    vehicle = body(class_name, seed, style)
    figure = Figure(figsize=(12.0, 4.6), layout="constrained")
    for axes, (turn, elevation) in zip(figure.subplots(1, 2), _VIEWS, strict=True):
        R = rotation("x", np.deg2rad(elevation)) @ rotation("y", np.deg2rad(turn))
        _draw_view(axes, vehicle, R, pixels_per_metre * _SAMPLES)
    return figure


def _draw_view(axes: Axes, vehicle: Body, R: FloatArray, scale: float) -> None:
    """One view along z of the frame into which `R` turns the object frame."""
    corners = (vehicle.vertices @ R.T)[:, :2]
    origin = corners.min(axis=0) - _MARGIN_M
    width, height = np.ceil((corners.max(axis=0) + _MARGIN_M - origin) * scale).astype(int).tolist()
    shade, depth = _raster(vehicle, R, origin, scale, (width, height))
    shade = shade[: height // _SAMPLES * _SAMPLES, : width // _SAMPLES * _SAMPLES]
    small = shade.reshape(shade.shape[0] // _SAMPLES, _SAMPLES, -1, _SAMPLES).mean(axis=(1, 3))
    axes.imshow(small, cmap="gray", vmin=0.0, vmax=1.0, interpolation="none")
    points = vehicle.keypoints_3d @ R.T
    pixels = (points[:, :2] - origin) * scale
    column, row = np.round(pixels).astype(int).T
    near = np.array([depth[r - 2 : r + 3, c - 2 : c + 3].max() for r, c in zip(row, column, strict=True)])
    visible = points[:, 2] < near + _DEPTH_TOLERANCE
    at = pixels / _SAMPLES - 0.5
    middle = at.mean(axis=0)
    for number, (x, y), seen in zip(keypoint_indices(vehicle.class_name), at, visible, strict=True):
        colour = _VISIBLE if seen else _HIDDEN
        away = np.array([x, y]) - middle
        offset = 9.0 * away / max(float(np.hypot(*away)), 1.0)
        axes.plot(x, y, "o", ms=4.5 if seen else 3.0, mfc=_ACCENT if seen else "none", mec=_ACCENT, mew=0.7)
        axes.annotate(
            str(number),
            (x, y),
            offset.tolist(),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=8,
            color=colour,
            bbox={"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.75},
        )
    axes.set_axis_off()


def _raster(
    vehicle: Body, R: FloatArray, origin: FloatArray, scale: float, size: tuple[int, int]
) -> tuple[FloatArray, FloatArray]:
    """Grey picture (H, W) and depth (H, W) of a body seen along z without perspective."""
    width, height = size
    tones = np.array([_TONES.get(name, 0.92) for name in MATERIALS])[vehicle.materials]
    triangles = (vehicle.vertices @ R.T)[vehicle.faces]
    a, b, c = (triangles[:, i] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    grey = tones * (0.62 + 0.38 * np.clip(normal @ np.array([-0.35, -0.8, -0.48]), 0.0, 1.0))
    shade, depth = np.ones((height, width)), np.full((height, width), np.inf)
    flat = (triangles[..., :2] - origin) * scale
    low, high = np.ceil(flat.min(axis=1)), np.floor(flat.max(axis=1))
    for i in np.flatnonzero(
        (normal[:, 2] < -1e-3) & np.all(low <= high, axis=1)
    ):  # covers the centre of a pixel
        _fill(shade, depth, flat[i], triangles[i, :, 2], float(grey[i]))
    return shade, depth


def _fill(shade: FloatArray, depth: FloatArray, corners: FloatArray, z: FloatArray, grey: float) -> None:
    """Draw one triangle where it is the nearest surface."""
    low, high = np.floor(corners.min(axis=0)).astype(int), np.ceil(corners.max(axis=0)).astype(int) + 1
    x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    (ax, ay), (bx, by), (cx, cy) = corners
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if abs(area) < 1e-9:
        return
    v = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
    w = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
    inside = (v >= -1e-6) & (w >= -1e-6) & (v + w <= 1.0 + 1e-6)
    here = z[0] + v * (z[1] - z[0]) + w * (z[2] - z[0])
    rows = slice(low[1], high[1]), slice(low[0], high[0])
    nearer = inside & (here < depth[rows])
    depth[rows][nearer] = here[nearer]
    shade[rows][nearer] = grey


def main(folder: Path = FOLDER) -> None:
    """Write `keypoints_KIND.png`."""
    folder.mkdir(parents=True, exist_ok=True)
    for class_name in CLASSES:
        path = folder / f"keypoints_{class_name}.png"
        save_figure(draw_keypoints(class_name), path, 110)
        print(path)


if __name__ == "__main__":
    main()
