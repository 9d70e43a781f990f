"""2D boxes of images from files: the format is recognised by the content.

A format is a row of `BOXES`: what it is called, how it is recognised, how it is read. Boxes are `left, top,
right, bottom` pixels as the file has them; no half pixel is added or taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import PurePosixPath

from groundpose._checks import FloatArray, input_error
from groundpose.formats.content import Content, read_content
from groundpose.formats.fields import Field
from groundpose.formats.frames import FRAME_MEMBERS, OBJECT_MEMBERS, read_truth, read_view
from groundpose.formats.kitti.labels import DONT_CARE, KittiLabel, read_labels
from groundpose.types import View
from groundpose.vehicles.classes import CLASSES

VEHICLES = frozenset(
    (*CLASSES, "vehicle", "car", "van", "bus", "minibus", "truck", "pickup", "suv", "trailer")
)
"""Names of detectors' and labels' classes (in lower case) that are vehicles; a box without a name is one."""

ANY = ""
"""The image of boxes that a file gives without naming an image."""


@dataclass(frozen=True)
class Box:
    """One box.

    Attributes:
        bbox: left, top, right, bottom pixels; NaN = not known.
        id: of the object. name: the class that the file gives it, "" for none.
        score: of the detector, NaN for none. truth: its pose `(R, t)`, if the file has one.
    """

    bbox: tuple[float, float, float, float]
    id: str | int
    name: str = ""
    score: float = math.nan
    truth: tuple[FloatArray, FloatArray] | None = None

    @property
    def is_vehicle(self) -> bool:
        """By its name."""
        return not self.name or self.name.lower() in VEHICLES


@dataclass(frozen=True)
class Boxes:
    """The boxes of one image, and its camera if the file has it."""

    boxes: tuple[Box, ...]
    view: View | None = None


@dataclass(frozen=True)
class BoxFile:
    """The boxes of a file: `images` maps the name of an image (or a number) to its boxes."""

    place: str
    images: Mapping[str, Boxes]

    @cached_property
    def _by_name(self) -> dict[str, list[str]]:
        """Keys of `images` by their last part: files may name folders that are not there any more."""
        found: dict[str, list[str]] = {}
        for key in self.images:
            found.setdefault(PurePosixPath(key).name, []).append(key)
        return found

    def of(self, image: str) -> Boxes:
        """The boxes of an image: those of the same path, the same file name, the same name without its
        ending, the same number, or those of any image. Raises InputError when the file has none for it."""
        path = PurePosixPath(image.replace("\\", "/"))
        if str(path) in self.images:
            return self.images[str(path)]
        for name in (path.name, path.stem, path.stem.lstrip("0") or "0", ANY):
            keys = self._by_name.get(name, [])
            if len(keys) > 1:
                raise input_error(self.place, f"boxes of one image named {name}", f"of {', '.join(keys[:3])}")
            if keys:
                return self.images[keys[0]]
        raise input_error(self.place, f"boxes of {path.name}", "none")


@dataclass(frozen=True)
class BoxFormat:
    """One format: its name in errors, whether a file's content is in it, and its reader.

    `read` maps images to boxes, see `BoxFile`, and raises InputError naming file and line or field.
    """

    name: str
    suits: Callable[[Content], bool]
    read: Callable[[Content], Mapping[str, Boxes]]


def read_boxes(path: str | PathLike[str]) -> BoxFile:
    """Boxes from a file of any format of `BOXES`.

    Raises:
        OSError: no such file. InputError: no format suits, or the file is not as its format has it.
    """
    content = read_content(path)
    for row in BOXES:
        if row.suits(content):
            return BoxFile(str(path), row.read(content))
    known = "; ".join(row.name for row in BOXES)
    raise input_error(str(path), f"2D boxes ({known})", "something else")


_KITTI_COLUMNS = 15


def _is_kitti(content: Content) -> bool:
    """Text of so many columns; also no text at all, which is how KITTI writes an image without objects."""
    lines = content.text.split("\n", 1)
    return not content.json and (not content.text.strip() or len(lines[0].split()) >= _KITTI_COLUMNS)


def _kitti(content: Content) -> dict[str, Boxes]:
    rows = [row for row in read_labels(content.place) if row.type != DONT_CARE]
    return {ANY: Boxes(tuple(_kitti_box(row, i) for i, row in enumerate(rows)))}


def _kitti_box(row: KittiLabel, number: int) -> Box:
    return Box(row.bbox, number, row.type, math.nan if row.score is None else row.score)


def _is_coco(content: Content) -> bool:
    """A data set: one object with images and annotations."""
    return len(content.json) == 1 and _has(content.json[0], ("images", "annotations"))


def _coco(content: Content) -> dict[str, Boxes]:
    root = content.json[0]
    images = {
        field.need("id").label(): field.need("file_name").text() for field in root.need("images").items()
    }
    names = _categories(root)
    found: dict[str | int, list[Box]] = {image: [] for image in images}
    for field in root.need("annotations").items():
        crowd, image = field.get("iscrowd"), field.need("image_id")
        if image.label() not in found:
            image.fail("the id of one of the images")
        if crowd is None or not crowd.value:
            found[image.label()].append(_coco_box(field, names, len(found[image.label()])))
    return {str(PurePosixPath(name)): Boxes(tuple(found[image])) for image, name in images.items()}


def _is_coco_results(content: Content) -> bool:
    """Detections of a data set: a list of objects that name an image and a box."""
    rows = content.json[0].value if len(content.json) == 1 else None
    return isinstance(rows, list) and bool(rows) and _has(Field(rows[0], ""), ("image_id", "bbox"))


# Of COCO's own 91 categories, for files of results, which have numbers only.
_COCO_NAMES: dict[str | int, str] = {3: "car", 6: "bus", 8: "truck"}


def _coco_results(content: Content) -> dict[str, Boxes]:
    found: dict[str, list[Box]] = {}
    for field in content.json[0].items():
        boxes = found.setdefault(str(field.need("image_id").label()), [])
        boxes.append(_coco_box(field, _COCO_NAMES, len(boxes)))
    return {image: Boxes(tuple(boxes)) for image, boxes in found.items()}


def _is_nuscenes(content: Content) -> bool:
    """2D annotations as nuScenes' tools export them: a list of objects with a file name and corners."""
    rows = content.json[0].value if len(content.json) == 1 else None
    return isinstance(rows, list) and bool(rows) and _has(Field(rows[0], ""), ("filename", "bbox_corners"))


def _nuscenes(content: Content) -> dict[str, Boxes]:
    """Categories are called like `vehicle.bus.rigid`; what counts here is their second part."""
    found: dict[str, list[Box]] = {}
    for field in content.json[0].items():
        boxes = found.setdefault(str(PurePosixPath(field.need("filename").text())), [])
        category, token = field.get("category_name"), field.get("sample_annotation_token")
        left, top, right, bottom = field.need("bbox_corners").numbers(4)
        name = category.text() if category else ""
        box, number = (left, top, right, bottom), token.label() if token else len(boxes)
        boxes.append(Box(box, number, name.removeprefix("vehicle.").partition(".")[0]))
    return {image: Boxes(tuple(boxes)) for image, boxes in found.items()}


def _categories(root: Field) -> dict[str | int, str]:
    given = root.get("categories")
    return {} if given is None else {c.need("id").label(): c.need("name").text() for c in given.items()}


def _coco_box(field: Field, names: Mapping[str | int, str], number: int) -> Box:
    left, top, width, height = field.need("bbox").numbers(4)
    label, category, score = field.get("id"), field.get("category_id"), field.get("score")
    name = "" if category is None or not names else names.get(category.label(), f"category {category.value}")
    return Box(
        (left, top, left + width, top + height),
        label.label() if label else number,
        name,
        score.number() if score else math.nan,
    )


def _is_frames(content: Content) -> bool:
    """Our frames, one or one per line; of their objects only boxes, names, scores and truth count."""
    return bool(content.json) and _has(content.json[0], ("objects",))


_BOX_MEMBERS = (*OBJECT_MEMBERS, "class", "score")


def _frames(content: Content) -> dict[str, Boxes]:
    found = {}
    for number, root in enumerate(content.json):
        root.members(FRAME_MEMBERS)
        view = read_view(root) if root.get("camera") else None
        boxes = tuple(_frame_box(field, i) for i, field in enumerate(root.need("objects").items()))
        image, label = root.get("image"), root.get("id")
        name = image.text() if image else str(label.label()) if label else str(number)
        alone = len(content.json) == 1 and image is None
        found[ANY if alone else str(PurePosixPath(name))] = Boxes(boxes, view)
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


def _is_list(content: Content) -> bool:
    """`[[left, top, right, bottom], ...]` of one image."""
    return len(content.json) == 1 and isinstance(content.json[0].value, list)


def _list(content: Content) -> dict[str, Boxes]:
    rows = [field.numbers(4, unknown=True) for field in content.json[0].items()]
    return {ANY: Boxes(tuple(Box((row[0], row[1], row[2], row[3]), i) for i, row in enumerate(rows)))}


def _has(field: Field, members: Collection[str]) -> bool:
    return isinstance(field.value, dict) and all(name in field.value for name in members)


BOXES: tuple[BoxFormat, ...] = (
    BoxFormat("KITTI's labels or results", _is_kitti, _kitti),
    BoxFormat("a COCO data set", _is_coco, _coco),
    BoxFormat("COCO results", _is_coco_results, _coco_results),
    BoxFormat("nuScenes' 2D annotations", _is_nuscenes, _nuscenes),
    BoxFormat('our frames {"objects": [{"bbox": ...}]}', _is_frames, _frames),
    BoxFormat("a JSON list of left, top, right, bottom", _is_list, _list),
)
"""The formats, asked in this order."""
