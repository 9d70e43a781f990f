"""XML of labelling tools, without the parts of XML that can grow: no entities, no documents of other
places."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from groundpose._checks import input_error
from groundpose.formats.fields import Field

_DEEPEST = 64


def parse_xml(text: str, place: str) -> Element:
    """The root of an XML text. Raises InputError for a broken one, one with entities and one too deep."""
    builder, parser, depth = TreeBuilder(), expat.ParserCreate(), 0

    def start(tag: str, attributes: Mapping[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            raise input_error(place, f"XML of at most {_DEEPEST} levels", "more")
        builder.start(tag, dict(attributes))

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def entity(*_: object) -> NoReturn:
        raise input_error(place, "XML without entities", "a declaration of one")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(text.encode("utf-8"), True)
    except expat.ExpatError as error:
        raise input_error(place, "XML", error) from None
    except (ValueError, LookupError) as error:  # an encoding that is none
        raise input_error(place, "XML", error) from None
    return builder.close()


class Node:
    """An element that knows where it stands, so that errors name file and path."""

    def __init__(self, element: Element, place: str, path: str = "") -> None:
        """An element; `path` as `object[2]/bndbox`."""
        self.element, self.place, self.path = element, place, path or element.tag

    @property
    def tag(self) -> str:
        """Its name."""
        return self.element.tag

    def all(self, tag: str) -> list[Node]:
        """Its children of a name."""
        return [
            Node(child, self.place, f"{self.path}/{tag}[{k}]")
            for k, child in enumerate(self.element.findall(tag))
        ]

    def need(self, tag: str) -> Node:
        """Its first child of a name (or path). Raises InputError without one."""
        child = self.element.find(tag)
        if child is None:
            raise input_error(f"{self.place}: {self.path}", f"an element {tag}", "none")
        return Node(child, self.place, f"{self.path}/{tag}")

    def text(self, tag: str) -> str:
        """The text of a child, "" without one."""
        return (self.element.findtext(tag) or "").strip()

    def attribute(self, name: str) -> str:
        """An attribute, "" without one."""
        return self.element.get(name, "").strip()

    def numbers(self, *names: str) -> list[float]:
        """Numbers of attributes or, where there is none of that name, of children's texts."""
        return [self._number(name) for name in names]

    def _number(self, name: str) -> float:
        given = self.attribute(name) or self.text(name)
        where = f"{self.path}/{name}"
        try:
            return Field(float(given), self.place, where).number()
        except ValueError:
            raise input_error(f"{self.place}: {where}", "a finite number", repr(given[:40])) from None
