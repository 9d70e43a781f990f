"""COCO keypoints: detections or labels of keypoints as frames to estimate, and frames as COCO.

A category's keypoints are brought into a model's order by their names; those a model does not have are left
out, those a category does not have are not seen.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from itertools import count
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray, input_error
from groundpose.formats.boxes.box import kept
from groundpose.formats.content import read_content
from groundpose.formats.fields import Field
from groundpose.formats.frames import Frame, FrameObject
from groundpose.formats.skips import Skips
from groundpose.shape import ShapeModel
from groundpose.types import View

Path_ = str | PathLike[str]
NOT_LABELLED = 0
"""COCO's visibility of a keypoint that is not there; 1 hidden, 2 visible."""


def read_keypoints(
    path: Path_, view: View, models: Mapping[str, ShapeModel], skipped: Skips | None = None
) -> Iterator[Frame]:
    """The images of a COCO keypoint file as frames, in the order of its `images`.

    Args:
        path: a data set (images, annotations, categories). An annotation's `score` is not looked at;
            visibilities from 0 to 1 (as detectors write them) become scores, COCO's 0, 1, 2 do not.
        view: of all images.
        models: by the name of the category; annotations of other categories are left out. A model's
            `keypoint_names` must be there.
        skipped: takes annotations that cannot be used, and the others are read; None: the first one is an
            error. One with `keypoints: []` (a track in a frame without its shape) is nothing.

    Raises:
        OSError, InputError naming file and field.
    """
    content = read_content(path)
    if len(content.json) != 1:
        raise input_error(str(path), "one COCO data set", "something else")
    root = content.json[0]
    for name, model in models.items():
        if not model.keypoint_names:
            raise input_error(f"models[{name!r}]", "a model with keypoint_names", "none")
    categories = {str(c.need("id").label()): c for c in root.need("categories").items()}
    orders = {key: _order(c, models) for key, c in categories.items() if c.need("name").text() in models}
    images = [(f.need("id").label(), f.need("file_name").text()) for f in root.need("images").items()]
    found: dict[str, list[FrameObject]] = {str(image): [] for image, _ in images}

    def read(field: Field, _: int) -> tuple[str, FrameObject] | None:
        key, crowd = str(field.need("category_id").label()), field.get("iscrowd")
        if key not in categories:
            field.need("category_id").fail("the id of a category")
        if key not in orders or (crowd is not None and crowd.value) or field.need("keypoints").value == []:
            return None
        owner = field.need("image_id")
        if str(owner.label()) not in found:
            owner.fail("the id of an image")
        return str(owner.label()), _object(field, categories[key].need("name").text(), orders[key])

    rows = root.need("annotations").items()
    read_rows = map(read, rows, count()) if skipped is None else kept(rows, read, skipped)
    for owner, item in filter(None, read_rows):
        found[owner].append(item)
    for image, name in images:
        objects = tuple(found[str(image)])
        place = Path(path).parent / name
        each = tuple(models[o.model] for o in objects)
        yield Frame(image, f"{path}: {name}", view, place, objects, each)


def _order(category: Field, models: Mapping[str, ShapeModel]) -> list[int | None]:
    """For each keypoint of the model its number in the category."""
    given = [item.text() for item in category.need("keypoints").items()]
    wanted = models[category.need("name").text()].keypoint_names
    if not set(given) & set(wanted):
        category.need("keypoints").fail(
            f"names of the model, such as {wanted[0]}", given[0] if given else "none"
        )
    return [given.index(name) if name in given else None for name in wanted]


def _object(field: Field, model: str, order: list[int | None]) -> FrameObject:
    points = field.need("keypoints")
    rows = np.array([item.number() for item in points.items()])
    if len(rows) % 3 or len(rows) < 3 * (max((k for k in order if k is not None), default=0) + 1):
        points.fail("three numbers for each keypoint of the category", f"{len(rows)} numbers")
    rows = rows.reshape(-1, 3)
    mine = np.array([rows[k] if k is not None else [np.nan, np.nan, 0.0] for k in order])
    mine[mine[:, 2] == NOT_LABELLED, :2] = np.nan
    box, label = field.get("bbox"), field.get("id")
    graded = bool(((rows[:, 2] > 0.0) & (rows[:, 2] < 1.0)).any())
    bbox = None
    if box is not None:
        left, top, width, height = box.numbers(4)
        bbox = [left, top, left + width, top + height]
    scores = mine[:, 2].tolist() if graded else None
    return FrameObject(label.label() if label else -1, model, mine[:, :2].copy(), scores, bbox, None)


def format_keypoints(frames: Iterable[Frame]) -> str:
    """Frames as a COCO data set: keypoints seen are visible (2), or have their score where there are
    scores."""
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    categories: dict[str, dict[str, Any]] = {}
    for frame in frames:
        name = str(frame.image.name if frame.image else frame.id)
        size = frame.view.camera.image_size or (0, 0)
        images.append({"id": frame.id, "file_name": name, "width": size[0], "height": size[1]})
        for item, model in zip(frame.objects, frame.models, strict=True):
            names = list(model.keypoint_names) or [str(k) for k in range(len(model.keypoints_3d))]
            new = {"id": len(categories) + 1, "name": item.model, "keypoints": names, "skeleton": []}
            category = categories.setdefault(item.model, new)
            annotations.append(_annotation(len(annotations) + 1, frame.id, item, category["id"]))
    content = {"images": images, "annotations": annotations, "categories": list(categories.values())}
    return json.dumps(content, allow_nan=False) + "\n"


def _annotation(number: int, image: str | int, item: FrameObject, category: int) -> dict[str, Any]:
    seen = np.asarray(np.isfinite(item.keypoints_2d).all(axis=1))
    grades: FloatArray = np.full(len(seen), 2.0)
    if item.keypoint_scores is not None:
        grades = np.nan_to_num(np.array(item.keypoint_scores, dtype=float))
    triples = np.column_stack([item.keypoints_2d, grades])
    triples[~seen] = 0.0
    record: dict[str, Any] = {"id": number, "image_id": image, "category_id": category, "iscrowd": 0}
    record |= {"keypoints": triples.ravel().tolist(), "num_keypoints": int(seen.sum())}
    if item.bbox is not None and np.isfinite(item.bbox).all():
        left, top, right, bottom = item.bbox
        record |= {"bbox": [left, top, right - left, bottom - top], "area": (right - left) * (bottom - top)}
    return record
