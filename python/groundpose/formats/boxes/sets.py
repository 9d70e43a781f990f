"""Boxes from the JSON of data sets and detectors: COCO, nuScenes, our own frames, plain lists."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

from groundpose.formats.boxes.box import ANY, Box, Boxes, by_image, kept
from groundpose.formats.boxes.text import numbered_box
from groundpose.formats.boxes.tools import first, has
from groundpose.formats.content import Content
from groundpose.formats.fields import Field
from groundpose.formats.frames import FRAME_MEMBERS, OBJECT_MEMBERS, read_truth, read_view
from groundpose.formats.skips import Skips
from groundpose.vehicles.words import NO_CLASS, first_number, numbered_name, vehicle_class


def is_coco(content: Content) -> bool:
    """A data set: one object with images and annotations."""
    return len(content.json) == 1 and has(content.json[0], ("images", "annotations"))


def coco(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """A data set; crowds are no objects. Numbers of images and categories may be text."""
    root = content.json[0]
    rows = kept(root.need("images").items(), lambda field, _: _image(field), skipped)
    names = _categories(root)
    images = {key: name for key, name, _ in rows}
    sizes = {name: size for _, name, size in rows}
    counts: Counter[str] = Counter()

    def name_of(kind: str | int) -> str:
        return names.get(str(kind), f"category {kind}") if names else ""

    def read(field: Field, _: int) -> tuple[str, Box] | None:
        crowd, image = field.get("iscrowd"), field.need("image_id")
        if str(image.label()) not in images:
            image.fail("the id of one of the images")
        if crowd is not None and crowd.value:
            return None
        name = images[str(image.label())]
        counts[name] += 1
        return name, _coco_box(field, name_of, counts[name] - 1)

    pairs = kept(root.need("annotations").items(), read, skipped)
    found = by_image(pairs, sizes)
    return {name: replace(boxes, size=sizes[name]) for name, boxes in found.items()}


def _image(field: Field) -> tuple[str, str, tuple[int, int] | None]:
    width, height = field.get("width"), field.get("height")
    size = (int(width.number()), int(height.number())) if width and height else None
    key, name = str(field.need("id").label()), field.need("file_name").text()
    return key, name, size if size and min(size) > 0 else None


def _categories(root: Field) -> dict[str, str]:
    given = root.get("categories")
    if given is None:
        return {}
    return {str(c.need("id").label()): c.need("name").text() for c in given.items()}


def _coco_box(field: Field, name_of: Callable[[str | int], str], number: int) -> Box:
    left, top, width, height = field.need("bbox").numbers(4)
    label, category, score = (
        field.get("track_id") or field.get("id"),
        field.get("category_id"),
        field.get("score"),
    )
    kind = None if category is None else category.label()
    return Box(
        (left, top, left + width, top + height),
        label.label() if label else number,
        "" if kind is None else name_of(kind),
        score.number() if score else math.nan,
        class_id=kind if isinstance(kind, int) else None,
    )


def is_coco_results(content: Content) -> bool:
    """Detections of a data set: a list of objects that name an image and a box."""
    return _is_list_of(content, "image_id", "bbox")


def _is_list_of(content: Content, *members: str) -> bool:
    return len(content.json) == 1 and isinstance(content.json[0].value, list) and has(first(content), members)


def coco_results(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """Categories have numbers only: COCO's own, or a detector's where they cannot be COCO's."""
    rows = content.json[0].items()
    numbers = [row.value.get("category_id") for row in rows if isinstance(row.value, dict)]
    start = first_number([int(n) for n in numbers if isinstance(n, (int, float))])

    def name_of(kind: str | int) -> str:
        return kind if isinstance(kind, str) else numbered_name(kind, start)

    counts: Counter[str] = Counter()

    def read(field: Field, _: int) -> tuple[str, Box]:
        image = str(field.need("image_id").label())
        counts[image] += 1
        return image, _coco_box(field, name_of, counts[image] - 1)

    found = by_image(kept(rows, read, skipped))
    said = (
        ("class numbers: read as detectors count them, from 0 (2 car, 5 bus, 7 truck)",) if start == 0 else ()
    )
    return {name: replace(boxes, remarks=said) for name, boxes in found.items()}


def is_nuscenes(content: Content) -> bool:
    """2D annotations as nuScenes' tools export them: a list of objects with a file name and corners."""
    return _is_list_of(content, "filename", "bbox_corners")


def nuscenes(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """Categories are called like `vehicle.bus.rigid`; the name of the box is their second part.

    `vehicle.construction` and its like, whose second part is no vehicle by itself, keep all of it.
    """

    counts: Counter[str] = Counter()

    def read(field: Field, _: int) -> tuple[str, Box]:
        image, category = field.need("filename").text(), field.get("category_name")
        token = field.get("instance_token") or field.get("sample_annotation_token")
        left, top, right, bottom = field.need("bbox_corners").numbers(4)
        name = category.text() if category else ""
        identity = token.label() if token else counts[image]
        counts[image] += 1
        second = name.removeprefix("vehicle.").partition(".")[0]
        known = vehicle_class(second) != NO_CLASS or vehicle_class(name) == NO_CLASS
        bbox = (left, top, right, bottom)
        return image, Box(bbox, identity, second if known else name)

    return by_image(kept(content.json[0].items(), read, skipped))


def is_frames(content: Content) -> bool:
    """Our frames, one or one per line; of their objects only boxes, names, scores and truth count."""
    return bool(content.json) and has(content.json[0], ("objects",))


_BOX_MEMBERS = (*OBJECT_MEMBERS, "class", "score")


def frames(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """Frames by image, id or number."""
    found = {}
    for number, root in enumerate(content.json):
        root.members(FRAME_MEMBERS)
        view = read_view(root) if root.get("camera") else None
        boxes = tuple(kept(root.need("objects").items(), _frame_box, skipped))
        image, label = root.get("image"), root.get("id")
        name = image.text() if image else str(label.label()) if label else str(number)
        alone = len(content.json) == 1 and image is None
        found[ANY if alone else name] = Boxes(boxes, view)
    return found


def _frame_box(field: Field, number: int) -> Box:
    field.members(_BOX_MEMBERS)
    box, label, score, truth = (field.get(name) for name in ("bbox", "id", "score", "truth"))
    name = field.get("class") or field.get("model")
    left, top, right, bottom = box.numbers(4, unknown=True) if box else (math.nan,) * 4
    return Box(
        (left, top, right, bottom),
        label.label() if label else number,
        name.text() if name else "",
        score.number() if score else math.nan,
        read_truth(truth) if truth else None,
    )


def is_list(content: Content) -> bool:
    """`[[left, top, right, bottom], ...]` of one image."""
    return len(content.json) == 1 and isinstance(content.json[0].value, list)


def plain_list(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """Rows of 4 numbers, 5 with a score, 6 with the number of a class."""

    def read(field: Field, number: int) -> Box:
        if not isinstance(field.value, list) or not 4 <= len(field.value) <= 6:
            field.fail("a list of 4 numbers, 5 with a score, 6 with a class")
        return numbered_box(field.numbers(len(field.value), unknown=True), number, field.where)

    return {ANY: Boxes(tuple(kept(content.json[0].items(), read, skipped)))}
