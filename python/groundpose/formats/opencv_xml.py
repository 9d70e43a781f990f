"""OpenCV's FileStorage in XML, as the same values that its YAML and JSON hold."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

from groundpose._checks import input_error
from groundpose.formats.fields import Field


def parse_opencv_xml(text: str, place: str) -> Field | None:
    """The mapping of an `<opencv_storage>`; None for another XML. Raises InputError naming the line."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise input_error(place, "XML without a DOCTYPE", "one")
    try:
        root = ElementTree.fromstring(text)
        return Field(_value(root, place), place) if root.tag == "opencv_storage" else None
    except ElementTree.ParseError as error:
        raise input_error(f"{place}:{error.position[0]}", "XML", error) from None
    except RecursionError:
        raise input_error(place, "XML", "elements in elements without end") from None


def _value(element: ElementTree.Element, place: str) -> Any:
    children = list(element)
    if not children:
        return _scalar((element.text or "").strip())
    if all(child.tag == "_" for child in children):
        return [_value(child, place) for child in children]
    found: dict[str, Any] = {}
    for child in children:
        if child.tag in found:
            raise input_error(f"{place}: {child.tag}", "one such element", "two")
        found[child.tag] = _value(child, place)
    return found


def _scalar(text: str) -> Any:
    """A number, or a str: also of several numbers, which OpenCV writes with blanks between."""
    for number in (int, float):
        try:
            return number(text)
        except ValueError:
            pass
    return text.strip('"')
