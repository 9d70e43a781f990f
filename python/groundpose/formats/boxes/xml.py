"""Boxes from XML: Pascal VOC, CVAT (images and tracks), UA-DETRAC."""

from __future__ import annotations

from functools import partial

from groundpose.formats.boxes.box import ANY, Box, Boxes, by_image, kept, whole
from groundpose.formats.content import Content
from groundpose.formats.skips import Skips
from groundpose.formats.xml import Node, parse_xml

TURNED = "turned box"


def root_of(content: Content) -> Node:
    """The root of an XML file."""
    return Node(parse_xml(content.text, content.place), content.place)


def is_voc(content: Content) -> bool:
    """`<annotation>` of one image."""
    return is_xml(content) and "<annotation>" in content.text[:2000]


def is_cvat(content: Content) -> bool:
    """`<annotations>` of images or tracks."""
    return is_xml(content) and "<annotations>" in content.text[:2000]


def is_detrac(content: Content) -> bool:
    """`<sequence>` of frames."""
    return is_xml(content) and "<sequence" in content.text[:2000]


def is_xml(content: Content) -> bool:
    """Whether the text begins like XML."""
    return content.text.lstrip()[:1] == "<"


def voc(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """Pixel coordinates as they are there; `trackid` (ImageNet) is the id."""
    root = root_of(content)
    size = root.element.find("size")
    boxes = kept(root.all("object"), _voc_box, skipped)
    sides = None if size is None else _size(root.need("size"), "width", "height")
    return {root.text("filename") or ANY: Boxes(tuple(boxes), size=sides)}


def _voc_box(node: Node, number: int) -> Box:
    left, top, right, bottom = node.need("bndbox").numbers("xmin", "ymin", "xmax", "ymax")
    label = node.text("trackid") or number
    return Box((left, top, right, bottom), label, node.text("name"))


def cvat(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """Images by their names; tracks by the numbers of frames, boxes outside the image left out."""
    root = root_of(content)
    found = {}
    for image in root.all("image"):
        boxes = kept(image.all("box"), lambda node, k: _cvat_box(node, k, skipped), skipped)
        size = _size(image, "width", "height") if image.attribute("width") else None
        found[image.attribute("name")] = Boxes(tuple(boxes), size=size)
    tracked: list[tuple[str, Box]] = []
    for track in root.all("track"):
        tracked += kept(track.all("box"), partial(_tracked, track, skipped), skipped)
    return found | by_image(tracked)


def _cvat_box(node: Node, number: int, skipped: Skips) -> Box | None:
    if node.attribute("rotation") and node.numbers("rotation") != [0.0]:
        skipped.add(TURNED, f"{node.place}: {node.path}")
        return None
    left, top, right, bottom = node.numbers("xtl", "ytl", "xbr", "ybr")
    return Box((left, top, right, bottom), number, node.attribute("label"))


def _tracked(track: Node, skipped: Skips, node: Node, _: int) -> tuple[str, Box] | None:
    if node.attribute("outside") == "1":
        return None
    box = _cvat_box(node, 0, skipped)
    if box is None:
        return None
    (frame,) = node.numbers("frame")
    return str(int(frame)), Box(box.bbox, whole(track.attribute("id")), track.attribute("label"))


def detrac(content: Content, skipped: Skips) -> dict[str, Boxes]:
    """By the numbers of frames, from 1; "others" are vehicles of no class of theirs."""
    root = root_of(content)
    found = {}
    for frame in root.all("frame"):
        (number,) = frame.numbers("num")
        targets = [target for group in frame.all("target_list") for target in group.all("target")]
        found[str(int(number))] = Boxes(tuple(kept(targets, _detrac_box, skipped)))
    return found


def _detrac_box(node: Node, number: int) -> Box:
    left, top, width, height = node.need("box").numbers("left", "top", "width", "height")
    described = node.element.find("attribute")
    name = "" if described is None else described.get("vehicle_type", "")
    label = node.attribute("id")
    return Box(
        (left, top, left + width, top + height),
        whole(label) if label else number,
        "vehicle" if name == "others" else name,
    )


def _size(node: Node, width: str, height: str) -> tuple[int, int] | None:
    w, h = node.numbers(width, height)
    return (int(w), int(h)) if w > 0 and h > 0 else None
