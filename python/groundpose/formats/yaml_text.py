"""YAML as other tools write it, as values that know where they stand."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from groundpose._checks import input_error
from groundpose.formats.fields import Field

_CORE = "tag:yaml.org,2002:"
_SCALARS = {
    "null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    "bool": (r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    "int": (r"[-+]?[0-9]{1,4000}", list("-+0123456789")),
    "float": (
        r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN|Nan)",
        list("-+.0123456789"),
    ),
}
"""Which words are no strings, after YAML 1.2: in 1.1 `1e-3` is a string, 012 is ten and 1:30 is ninety."""


def parse_yaml(text: str, place: str) -> Field | None:
    """The mapping or list of a YAML text, a list of them when it has several; None for a plain text.

    OpenCV's `%YAML:1.0` and tags of any name are taken. Raises InputError naming the line: no YAML, a key
    twice, an alias.
    """
    import yaml

    if text.startswith("%"):  # a directive that YAML has with a space: "%YAML 1.0"
        text = text[text.find("\n") :] if "\n" in text else ""
    try:
        found = [value for value in yaml.load_all(text, Loader=_loader()) if value is not None]
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        raise input_error(f"{place}:{mark.line + 1}" if mark else place, "YAML", error.problem) from None
    except (yaml.YAMLError, ValueError) as error:
        raise input_error(place, "YAML", str(error).splitlines()[0]) from None
    except RecursionError:
        raise input_error(place, "YAML", "lists in lists without end") from None
    different = [value for i, value in enumerate(found) if value not in found[:i][-1:]]
    value = different[0] if len(different) == 1 else different
    if not value or not isinstance(value, (dict, list)):
        return None
    _refuse_aliases(value, place)
    return Field(value, place)


@cache
def _loader() -> Any:
    """PyYAML's safe loader, in C where it is there, with the scalars above; it passes tags by."""
    import yaml

    loader: Any = type("_Loader", (getattr(yaml, "CSafeLoader", yaml.SafeLoader),), {})
    loader.yaml_implicit_resolvers = {}
    for name, (pattern, first) in _SCALARS.items():
        loader.add_implicit_resolver(_CORE + name, re.compile(f"^(?:{pattern})$"), first)
    loader.add_constructor(f"{_CORE}int", lambda _, node: int(node.value))
    loader.add_constructor(
        f"{_CORE}float",
        lambda _, node: float(node.value.lower().replace(".inf", "inf").replace(".nan", "nan")),
    )
    loader.add_constructor(f"{_CORE}map", _mapping)
    loader.add_multi_constructor("", _untagged)
    return loader


def _mapping(loader: Any, node: Any) -> dict[str, Any]:
    import yaml

    found: dict[str, Any] = {}
    for key_node, value_node in node.value:
        key = str(loader.construct_object(key_node, deep=True))
        if key in found:
            raise yaml.constructor.ConstructorError(None, None, f"the key {key!r} twice", key_node.start_mark)
        found[key] = loader.construct_object(value_node, deep=True)
    return found


def _untagged(loader: Any, _tag: str, node: Any) -> Any:
    if isinstance(node.value, str):
        return node.value
    is_mapping = bool(node.value) and isinstance(node.value[0], tuple)
    return _mapping(loader, node) if is_mapping else loader.construct_sequence(node, deep=True)


def _refuse_aliases(value: Any, place: str) -> None:
    """Written out, an alias of aliases may have no end."""
    seen: set[int] = set()
    waiting = [value]
    while waiting:
        item = waiting.pop()
        if isinstance(item, (dict, list)):
            if id(item) in seen:
                raise input_error(place, "YAML without aliases", "an alias of a list or a mapping (*name)")
            seen.add(id(item))
            waiting += item.values() if isinstance(item, dict) else item
