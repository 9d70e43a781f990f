"""Tasks with predictions for Label Studio, which has no cuboids: of each vehicle its 2D box as a rectangle,
and the faces of its 3D box at the bottom and at its front end as polygons.

`CONFIG` is the labelling interface for them: paste it into the settings of the project.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose._writing import write_text
from groundpose.formats.columns import corner
from groundpose.formats.neighbours.context import Context, score
from groundpose.formats.scenes import Scene
from groundpose.vehicles.classes import CLASSES

_LABELS = "".join(f'<Label value="{name}"/>' for name in (*CLASSES, "vehicle"))
CONFIG = f"""<View>
  <Image name="image" value="$image"/>
  <RectangleLabels name="box" toName="image">{_LABELS}</RectangleLabels>
  <PolygonLabels name="face" toName="image"><Label value="bottom"/><Label value="front"/></PolygonLabels>
</View>
"""
"""The labelling interface."""
_ROUND = (("left", 0), ("right", 0), ("right", 1), ("left", 1))
FACES = {
    "bottom": [corner(("front", "rear")[end], "bottom", side) for side, end in _ROUND],
    "front": [corner("front", ("bottom", "top")[height], side) for side, height in _ROUND],
}
"""Numbers of the corners of each face, around it."""


def write_label_studio(scenes: Iterable[Scene], path: Path, context: Context) -> None:
    """Write the tasks; see `groundpose.formats.neighbours.write_scenes`."""
    tasks = []
    for scene in scenes:
        with context.frame(scene):
            tasks.append(_task(scene, context))
    write_text(path, json.dumps(tasks, allow_nan=False) + "\n")


def _task(scene: Scene, context: Context) -> dict[str, Any]:
    size = scene.image_size()
    regions = [region for k in range(len(scene)) for region in _regions(scene, k, size, context)]
    sure = [score(scene, k) for k in scene.rows]
    prediction: dict[str, Any] = {"model_version": "groundpose", "result": regions}
    if sure:
        prediction["score"] = min(sure)
    image = str(scene.id) if scene.image is None else str(scene.image)
    return {"data": {"image": image, "frame": scene.id}, "predictions": [prediction]}


def _regions(scene: Scene, k: int, size: tuple[int, int], context: Context) -> list[dict[str, Any]]:
    found = []
    name = f"{scene.ids[k]}"
    head = {"to_name": "image", "original_width": size[0], "original_height": size[1], "image_rotation": 0}
    percent = 100.0 / np.array(size)
    if np.isfinite(scene.bboxes[k]).all():
        low, high = np.clip(scene.bboxes[k].reshape(2, 2) * percent, 0.0, 100.0)
        label = scene.classes[k] if scene.classes[k] in CLASSES else "vehicle"
        value = dict(zip(("x", "y", "width", "height"), [*low.tolist(), *(high - low).tolist()], strict=True))
        value |= {"rotation": 0, "rectanglelabels": [label]}
        region = {"id": f"{name}-box", "from_name": "box", "type": "rectanglelabels", "value": value}
        found.append(head | region)
    if not scene.ok[k]:
        return found
    pixels = scene.view.camera.image_of(scene.corners[k])
    for face, rows in FACES.items():
        polygon = clipped(pixels[rows] * percent) if np.isfinite(pixels[rows]).all() else np.empty((0, 2))
        if len(polygon) < 3:
            context.left_out["face that the picture does not show"] += 1
            continue
        shape = {"points": polygon.tolist(), "closed": True, "polygonlabels": [face]}
        region = {"id": f"{name}-{face}", "from_name": "face", "type": "polygonlabels", "value": shape}
        found.append(head | region | {"score": score(scene, k)})
    return found


def clipped(polygon: FloatArray) -> FloatArray:
    """What of a polygon (N, 2) lies between 0 and 100, (M, 2) (Sutherland and Hodgman, 1974)."""
    for axis, sign, limit in ((0, 1.0, 0.0), (0, -1.0, -100.0), (1, 1.0, 0.0), (1, -1.0, -100.0)):
        inside = sign * polygon[:, axis] - limit
        kept: list[FloatArray] = []
        for k in range(len(polygon)):
            if inside[k - 1] * inside[k] < 0.0:
                part = inside[k - 1] / (inside[k - 1] - inside[k])
                kept.append(polygon[k - 1] + part * (polygon[k] - polygon[k - 1]))
            if inside[k] >= 0.0:
                kept.append(polygon[k])
        polygon = np.array(kept).reshape(-1, 2)
    return np.clip(polygon, 0.0, 100.0)
