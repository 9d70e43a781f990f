"""COCO keypoints of simulated frames: one category a class, its keypoints by name, a skeleton to draw."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from typing import Any

from groundpose.vehicles import KINDS, keypoint_names

# Lines of one side of a vehicle, drawn where a class has both ends; each is drawn left and right.
_SIDE = (
    ("front_bumper", "headlamp"),
    ("headlamp", "windscreen_bottom"),
    ("windscreen_bottom", "windscreen_top"),
    ("windscreen_bottom", "mirror"),
    ("front_bumper", "front_wheel"),
    ("front_wheel", "rear_wheel"),
    ("rear_wheel", "rear_bumper"),
    ("rear_bumper", "taillamp"),
    ("taillamp", "rear_window_bottom"),
    ("rear_window_bottom", "rear_window_top"),
    ("rear_window_top", "windscreen_top"),
    ("windscreen_bottom", "belt_b"),
    ("belt_b", "belt_c"),
    ("belt_c", "rear_window_bottom"),
    ("windscreen_top", "side_window_top"),
    ("windscreen_top", "roof_rear"),
    ("rear_window_bottom", "roof_rear"),
    ("windscreen_top", "cab_roof_rear"),
    ("cab_roof_rear", "bed_front"),
    ("bed_front", "bed_rear_top"),
    ("bed_rear_top", "bed_rear_bottom"),
    ("bed_rear_bottom", "taillamp"),
    ("rear_wheel", "bed_rear_bottom"),
    ("windscreen_bottom", "cab_window"),
    ("box_front_top", "box_front_bottom"),
    ("box_front_top", "box_rear_top"),
    ("box_rear_top", "box_rear_bottom"),
    ("box_front_bottom", "box_rear_bottom"),
    ("box_rear_bottom", "taillamp"),
    ("taillamp", "guard_rear"),
    ("rear_wheel", "guard_rear"),
)
# Lines from left to right.
_ACROSS = (
    *("front_bumper", "windscreen_bottom", "windscreen_top", "rear_bumper", "rear_window_bottom"),
    *("rear_window_top", "roof_rear", "cab_roof_rear", "bed_rear_bottom"),
    *("box_front_top", "box_rear_top", "box_rear_bottom", "guard_rear"),
)
# Lines from the middle plane to both sides.
_MIDDLE = (("front_plate", "headlamp"), ("rear_plate", "taillamp"), ("tailgate", "bed_rear_top"))


def category_id(kind: str) -> int:
    """Number of a class, from 1."""
    return KINDS.index(kind) + 1


def categories() -> list[dict[str, Any]]:
    """The four classes as COCO describes them."""
    return [
        {
            "id": category_id(kind),
            "name": kind,
            "supercategory": "vehicle",
            "keypoints": list(keypoint_names(kind)),
            "skeleton": skeleton(kind),
        }
        for kind in KINDS
    ]


def skeleton(kind: str) -> list[list[int]]:
    """Pairs of keypoint numbers, from 1, joined by a line."""
    names = keypoint_names(kind)
    lines = [(f"{side}_{a}", f"{side}_{b}") for a, b in _SIDE for side in ("left", "right")]
    lines += [(f"left_{a}", f"right_{a}") for a in _ACROSS]
    lines += [(a, f"{side}_{b}") for a, b in _MIDDLE for side in ("left", "right")]
    return [[names.index(a) + 1, names.index(b) + 1] for a, b in lines if a in names and b in names]


def write_lines(frames: Iterable[dict[str, Any]], suffix: str) -> Iterator[str]:
    """The pieces of a COCO file of frames as `labels.jsonl` has them; annotations are numbered from 1.

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
