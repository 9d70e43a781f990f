"""COCO with 3D boxes, as Omni3D has them (Brazil et al., CVPR 2023), for pycocotools and Cube R-CNN.

The box's axes there are x forward, y down, z left; `dimensions` are width, height, length; corners go round
the right side, from the top of the rear, then round the left one. An object without an answer keeps its 2D
box, with `valid3D` false. Vehicles of tracks have a `track_id`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose._writing import write_text
from groundpose.formats.neighbours.context import Context, class_numbers, score
from groundpose.formats.records import camera_members, tilt_members
from groundpose.formats.scenes import Scene

_OBJECT_FROM_BOX = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
_X = np.array([-0.5, 0.5, 0.5, -0.5] * 2)
_Y = np.array([-0.5, -0.5, 0.5, 0.5] * 2)
_Z = np.array([-0.5] * 4 + [0.5] * 4)


def write_coco(scenes: Iterable[Scene], path: Path, context: Context) -> None:
    """Write a data set; see `groundpose.formats.neighbours.write_scenes`."""
    images: list[dict[str, Any]] = []
    rows: list[dict[str, Any]] = []
    for number, scene in enumerate(scenes, 1):
        with context.frame(scene):
            images.append(_image(scene, number))
            rows += _annotations(scene, number, context)
    names = tuple(row["category_name"] for row in rows)
    numbers = class_numbers(names)
    for k, row in enumerate(rows, 1):
        row["id"], row["category_id"] = k, numbers[row["category_name"]]
    categories = [{"id": k, "name": name} for name, k in numbers.items()]
    data = {"info": {"name": "groundpose"}, "images": images, "annotations": rows, "categories": categories}
    write_text(path, json.dumps(data, allow_nan=False) + "\n")


def _image(scene: Scene, number: int) -> dict[str, Any]:
    width, height = scene.image_size()
    name = str(scene.id) if scene.image is None else str(scene.image)
    return {
        **{"id": number, "width": width, "height": height, "file_name": name, "file_path": name},
        **{"frame": scene.id, "K": scene.view.camera.K.tolist(), "camera": camera_members(scene.view.camera)},
        **tilt_members(scene.view),
    }


def _annotations(scene: Scene, image: int, context: Context) -> Iterator[dict[str, Any]]:
    shown = scene.shown_boxes
    for k, ok in enumerate(scene.ok.tolist()):
        box = _box(scene.bboxes[k], shown[k])
        if box is None:
            context.left_out["object without a 2D box"] += 1
            continue
        left, top, right, bottom = box
        yield {
            **{"image_id": image, "category_name": scene.classes[k] or "vehicle", "iscrowd": 0},
            **{"bbox": [left, top, right - left, bottom - top], "bbox2D_tight": box},
            **{"area": (right - left) * (bottom - top), "valid3D": ok, "object": scene.ids[k]},
            **({} if scene.motion is None else {"track_id": scene.ids[k]}),
            **(_solid(scene, k) if ok else {"status": scene.status[k]}),
        }


def _box(given: FloatArray, shown: FloatArray) -> list[float] | None:
    """The given 2D box, with what the picture shows of the 3D box where a side is not known."""
    given = np.where(np.isnan(given), shown, given)
    return None if np.isnan(given).any() else [float(x) for x in given]


def _solid(scene: Scene, k: int) -> dict[str, Any]:
    length, height, width = scene.size[k].tolist()
    R = scene.R[k] @ _OBJECT_FROM_BOX
    corners = np.stack([length * _X, height * _Y, width * _Z], axis=1) @ R.T + scene.centre[k]
    return {
        **{"center_cam": scene.centre[k].tolist(), "dimensions": [width, height, length]},
        **{"R_cam": R.tolist(), "bbox3D_cam": corners.tolist(), "behind_camera": False},
        "score": score(scene, k),
    }
