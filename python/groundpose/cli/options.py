"""The solver's options as options of a command: names, types, defaults and help are those of `Options`."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable
from dataclasses import Field, fields
from functools import wraps
from typing import Annotated, Any, Literal, get_origin, get_type_hints

import typer

from groundpose import _core
from groundpose._checks import input_error
from groundpose.cli.output import mistakes
from groundpose.options import Options

# Angles: radians in the library, degrees on the command line, whose option ends in `-deg`.
_ANGLES = ("tilt_sigma", "keypoint_error_turn")
# A command line has no way to give one number per object; it gives coefficients one after the other.
_COEFFICIENTS: Any = tuple[(float,) * (1 + _core.EVIDENCE)]  # type: ignore[misc]
_TYPES = {"inlier_threshold": float, "probability_coefficients": _COEFFICIENTS}
_METAVARS: dict[Any, str] = {
    str: "NAME",
    float: "X",
    float | None: "X",
    int: "N",
    tuple[float, float] | None: "X X",
    tuple[float, float, float]: "T T T",
}
_METAVARS |= {_COEFFICIENTS: "X.."}
_TEXTS = {"inlier_threshold": "pixels, for all objects; default: by the longer side of the 2D box."}


def takes_options(command: Callable[..., None]) -> Callable[..., None]:
    """A command with an option for each field of `Options`; it gets them together as its `options`."""
    own = inspect.signature(command, eval_str=True)
    options = {f.name: _parameter(f) for f in fields(Options) if f.init}

    @wraps(command)
    def typed(**given: Any) -> None:
        said = {name: given.pop(parameter.name) for name, parameter in options.items()}
        with mistakes():
            angles = {name: _radians(name, said[name]) for name in _ANGLES if said[name] is not None}
            values = {name: value for name, value in (said | angles).items() if value is not None}
            made = Options(**values)
        command(**given, options=made)

    parameters = [p for p in own.parameters.values() if p.name != "options"] + [*options.values()]
    typed.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    typed.__annotations__ = {p.name: p.annotation for p in parameters}
    return typed


def _radians(name: str, degrees: float) -> float:
    """Of a standard deviation. Raises InputError in degrees, as they were typed."""
    if not degrees >= 0.0:
        raise input_error(f"--{name.replace('_', '-')}-deg", "degrees from 0 on", f"{degrees:g}")
    return math.radians(degrees)


def _parameter(option: Field[Any]) -> inspect.Parameter:
    name, default, hint = option.name, option.default, get_type_hints(Options)[option.name]
    kind: Any = str if get_origin(hint) is Literal else _TYPES.get(name, hint)
    info = typer.Option(
        help=_help(name),
        metavar=_METAVARS.get(kind),
        show_default=False if default is None else _shown(default),
        rich_help_panel="Method",
    )
    return inspect.Parameter(
        f"{name}_deg" if name in _ANGLES else name,
        inspect.Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[kind | None, info],
    )


def _shown(default: Any) -> str:
    if isinstance(default, bool):
        return "on" if default else "off"
    return " ".join(f"{x:g}" for x in default) if isinstance(default, tuple) else str(default)


def _help(name: str) -> str:
    """What the docstring of `Options` says of a field."""
    found = re.search(rf"^    {name}: (.*(?:\n {{5,}}.*)*)", inspect.getdoc(Options) or "", re.MULTILINE)
    text = _TEXTS.get(name) or (" ".join(found[1].split()) if found else "")
    text = text.replace("`", "").replace("None: ", "default: ")
    if name in _ANGLES:
        text = text.replace("radians", "degrees")
    return text[:1].upper() + text[1:]
