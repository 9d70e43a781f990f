"""Boxes from the JSON of labelling tools and data sets: Label Studio, labelme, BDD100K, Cityscapes."""

from __future__ import annotations

import math
from collections.abc import Collection

from groundpose.formats.boxes.box import ANY, Box, Boxes, kept
from groundpose.formats.boxes.xml import TURNED
from groundpose.formats.content import Content
from groundpose.formats.fields import Field
from groundpose.formats.skips import Skips

Corners = tuple[float, float, float, float]


def has(field: Field, members: Collection[str]) -> bool:
    """Whether it is an object with these members."""
    return isinstance(field.value, dict) and all(name in field.value for name in members)


def entries(content: Content) -> list[Field]:
    """Those of a list, or the JSON values themselves."""
    if len(content.json) == 1 and isinstance(content.json[0].value, list):
        return content.json[0].items()
    return list(content.json)


def first(content: Content) -> Field:
    """The first of `entries`, without looking at the others; an empty one if there is none."""
    root = next(iter(content.json), Field(None, content.place))
    if len(content.json) == 1 and isinstance(root.value, list):
        return Field(next(iter(root.value), None), content.place, "[0]")
    return root


def is_label_studio(content: Content) -> bool:
    """Tasks with `data` and `annotations`."""
    return has(first(content), ("data",)) and (
        has(first(content), ("annotations",)) or has(first(content), ("predictions",))
    )


def label_studio(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """Rectangles in percent of the image, of the last annotation of each task, else of its prediction."""
    found = {}
    for task in entries(content):
        done = [one for name in ("predictions", "annotations") if (g := task.get(name)) for one in g.items()]
        regions = done[-1].need("result").items() if done else []
        boxes = kept(regions, lambda field, k: _region(field, k, skipped), skipped)
        image = next((v for _, v in task.need("data").entries() if isinstance(v.value, str)), None)
        sides = [(r.get("original_width"), r.get("original_height")) for r in regions]
        size = next(((int(w.number()), int(h.number())) for w, h in sides if w and h), None)
        found[image.text() if image else ANY] = Boxes(tuple(boxes), size=size, fractions=True)
    return found


def _region(field: Field, number: int, skipped: Skips) -> Box | None:
    if field.need("type").value not in ("rectanglelabels", "rectangle"):
        return None
    value = field.need("value")
    turned = value.get("rotation")
    if turned is not None and turned.number() != 0.0:
        skipped.add(TURNED, value.where)
        return None
    left, top, width, height = (value.need(name).number() / 100.0 for name in ("x", "y", "width", "height"))
    names, score = value.get("rectanglelabels"), field.get("score")
    name = names.items()[0].text() if names and names.value else ""
    label = field.get("id")
    bbox = (left, top, left + width, top + height)
    return Box(bbox, label.label() if label else number, name, score.number() if score else math.nan)


def is_labelme(content: Content) -> bool:
    """`shapes` of one image."""
    return len(content.json) == 1 and has(content.json[0], ("shapes",))


def labelme(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """Rectangles, and the boxes around polygons."""
    root = content.json[0]
    boxes = kept(root.need("shapes").items(), _shape, skipped)
    width, height, path = (root.get(name) for name in ("imageWidth", "imageHeight", "imagePath"))
    size = (int(width.number()), int(height.number())) if width and height else None
    return {path.text() if path else ANY: Boxes(tuple(boxes), size=size)}


def _shape(field: Field, number: int) -> Box | None:
    form, group = field.get("shape_type"), field.get("group_id")
    if form is not None and form.value not in ("rectangle", "polygon"):
        return None
    bbox = around(field.need("points"))
    return Box(bbox, group.label() if group else number, field.need("label").text())


def around(points: Field) -> Corners:
    """The box of points."""
    rows = points.rows(2)
    if len(rows) < 2:
        points.fail("two points or more", str(len(rows)))
    xs, ys = zip(*rows, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def is_bdd(content: Content) -> bool:
    """BDD100K's and Scalabel's frames, alone, in a list or in `frames`."""
    root = first(content)
    inner = root.value.get("frames") if isinstance(root.value, dict) else None
    if isinstance(inner, list) and inner:
        root = Field(inner[0], content.place, "frames[0]")
    return has(root, ("name", "labels"))


def _bdd_frames(content: Content) -> list[Field]:
    if not content.json:
        return []
    root = content.json[0]
    if has(root, ("frames",)) and isinstance(root.value["frames"], list):
        return root.need("frames").items()
    return [field for field in entries(content) if isinstance(field.value, dict)]


def bdd(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """Labels with a `box2d`; lanes and areas are passed over."""
    found = {}
    for frame in _bdd_frames(content):
        labels, size = frame.get("labels"), frame.get("size")
        boxes = kept(labels.items() if labels else [], _bdd_box, skipped)
        name = frame.need("name").text()
        sides = (int(size.need("width").number()), int(size.need("height").number())) if size else None
        found[name] = Boxes(tuple(boxes), size=sides)
    return found


def _bdd_box(field: Field, number: int) -> Box | None:
    box, label, score = field.get("box2d"), field.get("id"), field.get("score")
    if box is None:
        return None
    left, top, right, bottom = (box.need(name).number() for name in ("x1", "y1", "x2", "y2"))
    name = field.need("category").text()
    return Box(
        (left, top, right, bottom),
        label.label() if label else number,
        name,
        score.number() if score else math.nan,
    )


def is_cityscapes(content: Content) -> bool:
    """Cityscapes' objects of one image: 3D (with a 2D box), or polygons."""
    return len(content.json) == 1 and has(content.json[0], ("imgWidth", "imgHeight", "objects"))


def cityscapes(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """The amodal 2D box (as if nothing stood before the vehicle), cut at the image's border; of polygons
    theirs."""
    root = content.json[0]
    width, height = (int(root.need(name).number()) for name in ("imgWidth", "imgHeight"))

    def read(field: Field, number: int) -> Box:
        box, label, score = field.get("2d"), field.get("instanceId"), field.get("score")
        if box is not None:
            left, top, w, h = (box.get("amodal") or box.need("modal")).numbers(4)
            bbox = (left, top, left + w, top + h)
        else:
            bbox = around(field.need("polygon"))
        cut = (max(bbox[0], 0.0), max(bbox[1], 0.0), min(bbox[2], width - 1.0), min(bbox[3], height - 1.0))
        return Box(
            cut,
            label.label() if label else number,
            field.need("label").text(),
            score.number() if score else math.nan,
        )

    boxes = kept(root.need("objects").items(), read, skipped)
    return {ANY: Boxes(tuple(boxes), size=(width, height))}
