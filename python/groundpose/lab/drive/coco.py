"""COCO keypoints of simulated frames: one category per class, with named keypoints and a skeleton to draw."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import Any

from groundpose.vehicles import CLASSES, keypoint_names
from groundpose.vehicles.skeleton import skeleton


def category_id(class_name: str) -> int:
    """Number of a class, from 1."""
    return CLASSES.index(class_name) + 1


def categories() -> list[dict[str, Any]]:
    """The four classes as COCO describes them."""
    return [
        {
            "id": category_id(class_name),
            "name": class_name,
            "supercategory": "vehicle",
            "keypoints": list(keypoint_names(class_name)),
            "skeleton": [[a + 1, b + 1] for a, b in skeleton(class_name)],  # COCO counts from 1
        }
        for class_name in CLASSES
    ]


def write_lines(frames: Iterable[dict[str, Any]], suffix: str) -> Iterator[str]:
    """The pieces of a COCO file for frames read from `labels.jsonl`; annotations are numbered from 1.

    Visibility is COCO's: 0 not in the image, 1 hidden, 2 visible; `area` is that of the box.
    """
    images, number = [], 0
    yield '{"annotations": [\n'
    for frame in frames:
        width, height = frame["camera"]["image_size"]
        name = f"{frame['id']:06d}{suffix}"
        images.append({"id": frame["id"], "file_name": name, "width": width, "height": height})
        for item in frame["objects"]:
            number += 1
            yield (",\n" if number > 1 else "") + json.dumps(_annotation(number, frame["id"], item))
    yield f'\n],\n"categories": {json.dumps(categories())},\n"images": {json.dumps(images)}}}\n'


def _annotation(number: int, image: int, item: dict[str, Any]) -> dict[str, Any]:
    left, top, right, bottom = item["bbox"]
    keypoints: list[float] = []
    for pixel, state in zip(item["keypoints_2d"], item["_keypoint_states"], strict=True):
        keypoints += [0, 0, 0] if state == 0 else [*pixel, state]
    return {
        "id": number,
        "image_id": image,
        "category_id": category_id(item["model"]),
        "bbox": [left, top, round(right - left, 3), round(bottom - top, 3)],
        "area": round((right - left) * (bottom - top), 3),
        "iscrowd": 0,
        "keypoints": keypoints,
        "num_keypoints": sum(state > 0 for state in item["_keypoint_states"]),
    }
