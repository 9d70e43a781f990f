"""How docstrings and signatures are read for the site: an extension of griffe.

- `fx, fy: focal lengths` in a section is one entry for each name, so that each finds its type and default.
- Lines of an interpreter session become a block of code; so does what follows a line that ends in `::`.
- A default that is a private name is shown as its value.
- Docstrings of a class's fields become its table of attributes.
"""

from __future__ import annotations

import importlib
import re
from typing import Any

import griffe

_GROUP = re.compile(
    r"^(?P<indent> {4,})(?P<names>\w+(?:, \w+)+): (?P<text>.*(?:\n(?P=indent) +.*)*)", re.MULTILINE
)
_ERRORS = re.compile(r"^    (?P<names>\w+Error(?:, \w+Error)*) (?P<text>[^:]*)$")
_SECOND = re.compile(r"(?<=\. )(?P<name>[a-z_]\w*(?:, \w+)*|[A-Z]\w+Error): (?=\S)")
_SESSION = re.compile(r"^(?P<indent> *)>>> .*(?:\n(?P=indent)\S.*)*", re.MULTILINE)
_PRIVATE = re.compile(r"_[A-Z]\w*")
_SIMPLE = (bool, int, float, str, tuple, type(None))


class Docstrings(griffe.Extension):
    """Reads docstrings as this repository writes them."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Every object after its docstring was found."""
        if obj.docstring is not None:
            obj.docstring.value = readable(obj.docstring.value)

    def on_attribute(self, *, attr: griffe.Attribute, **_: Any) -> None:
        """Fields of the dataclasses, whose values are the defaults of a signature."""
        attr.value = _shown(attr.value, attr)

    def on_class_members(self, *, cls: griffe.Class, **_: Any) -> None:
        """Fields that have docstrings of their own are a table of their class."""
        fields = {name: field.docstring for name, field in cls.attributes.items() if _is_documented(field)}
        if cls.docstring is not None and fields and "Attributes:" not in cls.docstring.value:
            entries = [f"    {name}: {' '.join(text.value.split())}" for name, text in fields.items()]
            cls.docstring.value += "\n\nAttributes:\n" + "\n".join(entries)

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Parameters of functions."""
        for parameter in func.parameters:
            parameter.default = _shown(parameter.default, func)


def _is_documented(attribute: griffe.Attribute) -> bool:
    return attribute.docstring is not None and "property" not in attribute.labels


def readable(text: str) -> str:
    """A docstring with one entry for each name and its sessions as code."""
    text = re.sub(r"::$", ":", re.sub(r" *# doctest: .*$", "", _entries(text), flags=re.M), flags=re.M)
    return _SESSION.sub(
        lambda found: f"{found['indent']}```pycon\n{found.group()}\n{found['indent']}```", text
    )


def _entries(text: str) -> str:
    """Entries that stand in one line, or share one text, apart."""
    lines = []
    inside = False
    for line in text.splitlines():
        if re.fullmatch(r"(Args|Attributes|Raises):", line):
            inside = True
        elif line and not line.startswith(" "):
            inside = False
        if inside and line.startswith("    "):
            line = _SECOND.sub(r"\n    \g<name>: ", _ERRORS.sub(r"    \g<names>: \g<text>", line))
        lines.append(line)
    return _GROUP.sub(_each, "\n".join(re.sub(r" +\n", "\n", line) for line in lines))


def _each(found: re.Match[str]) -> str:
    names = found["names"].split(", ")
    return "\n".join(f"{found['indent']}{name}: {found['text']}" for name in names)


def _shown(default: Any, owner: griffe.Object) -> Any:
    """The default as text that says what it is."""
    if default is None or not _PRIVATE.fullmatch(str(default)):
        return default
    try:
        module = importlib.import_module(owner.module.path)
    except ImportError:  # a module of an extra that is not installed here, and so not on the site
        return default
    value = getattr(module, str(default))
    if isinstance(value, _SIMPLE):
        return repr(value).replace("inf", "math.inf") if isinstance(value, float) else repr(value)
    return str(owner.module.members[str(default)].value)
