"""Cuboids for CVAT to begin with, "CVAT for images 1.1": upload them as annotations of a task with the same
pictures.

CVAT's cuboid has a front, which is the end of the vehicle that is nearer to the camera, and left and right as
the picture shows them; the attribute `end` says which end of the vehicle it is.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from groundpose._checks import FloatArray
from groundpose._writing import write_text
from groundpose.formats.columns import CORNERS, corner
from groundpose.formats.neighbours.context import Context, class_numbers, score
from groundpose.formats.scenes import Scene

_NAMES = tuple(f"{h}{side}{face}" for face in "12" for side in "lr" for h in "tb")
"""Of CVAT's points in their order: the left and right edge of the front, then, whatever their names say, the
right and left edge of the back; of each the top and the bottom."""
_SIDES, _HEIGHTS = ("left", "right"), ("top", "bottom")
_ATTRIBUTES = ("object", "end", "yaw_deg", "probability")


def write_cvat(scenes: Iterable[Scene], path: Path, context: Context) -> None:
    """Write the cuboids; see `groundpose.formats.neighbours.write_scenes`."""
    root = ET.Element("annotations")
    ET.SubElement(root, "version").text = "1.1"
    labels = ET.SubElement(ET.SubElement(ET.SubElement(root, "meta"), "task"), "labels")
    named: list[str] = []
    for number, scene in enumerate(scenes):
        with context.frame(scene):
            named += _add_image(root, number, scene, context)
    for name in class_numbers(tuple(named)):
        _add_label(labels, name)
    ET.indent(root)
    write_text(path, f'<?xml version="1.0" encoding="utf-8"?>\n{ET.tostring(root, encoding="unicode")}\n')


def _add_label(labels: ET.Element, name: str) -> None:
    label = ET.SubElement(labels, "label")
    ET.SubElement(label, "name").text = name
    attributes = ET.SubElement(label, "attributes")
    for attribute in _ATTRIBUTES:
        item = ET.SubElement(attributes, "attribute")
        for key, text in (("name", attribute), ("mutable", "False"), ("input_type", "text"), ("values", "")):
            ET.SubElement(item, key).text = text


def _add_image(root: ET.Element, number: int, scene: Scene, context: Context) -> list[str]:
    width, height = scene.image_size()
    name = str(scene.id) if scene.image is None else scene.image.name
    size = {"width": str(width), "height": str(height)}
    image = ET.SubElement(root, "image", {"id": str(number), "name": name, **size})
    pixels, shown = scene.corner_pixels, scene.shown_boxes
    named = []
    for k in scene.rows:
        if np.isnan(pixels[k]).any():
            context.left_out["object that is partly behind the camera"] += 1
            continue
        if np.isnan(shown[k]).any():
            context.left_out["object outside the picture"] += 1
            continue
        named.append(scene.classes[k] or "vehicle")
        points, end = cuboid(scene.corners[k], pixels[k])
        edges = {
            f"{axis}{name}": f"{value:.2f}"
            for name, point in zip(_NAMES, points.tolist(), strict=True)
            for axis, value in zip("xy", point, strict=True)
        }
        hidden = scene.motion is not None and not scene.motion.seen[k]
        label = {"label": named[-1], "source": "auto", "occluded": str(int(hidden))}
        shape = ET.SubElement(image, "cuboid", {**label, **edges, "z_order": "0"})
        said = (str(scene.ids[k]), end, f"{np.degrees(scene.yaw[k]):.2f}", f"{score(scene, k):.4f}")
        for attribute, text in zip(_ATTRIBUTES, said, strict=True):
            ET.SubElement(shape, "attribute", {"name": attribute}).text = text
    return named


def cuboid(corners: FloatArray, pixels: FloatArray) -> tuple[FloatArray, str]:
    """CVAT's eight points (8, 2) of a box (8, 3), (8, 2) in the order of `CORNERS`, and the vehicle's end,
    "front" or "rear", that is CVAT's front."""
    ends = {end: [k for k, name in enumerate(CORNERS) if name.startswith(end)] for end in ("front", "rear")}
    near, far = sorted(ends, key=lambda end: float(np.linalg.norm(corners[ends[end]].mean(axis=0))))
    seen = {side: pixels[[corner(near, height, side) for height in _HEIGHTS], 0] for side in _SIDES}
    left, right = sorted(_SIDES, key=lambda side: float(seen[side].mean()))
    order = ((near, left), (near, right), (far, right), (far, left))
    rows = [corner(end, height, side) for end, side in order for height in _HEIGHTS]
    return pixels[rows], near
