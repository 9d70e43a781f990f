"""What is told of the place of a camera: `world.yaml`, or the same as JSON.

One of these says where the camera's ground lies, heading in degrees from north to the east:

    map: {east: 1200.0, north: 3400.0, heading_deg: 90.0}
    geographic: {latitude: 48.137, longitude: 11.575, heading_deg: 90.0}
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from groundpose._checks import input_error, read_text
from groundpose.formats.fields import Field, parse
from groundpose.formats.yaml_text import parse_yaml
from groundpose.world import World

_MEMBERS = ("map", "geographic")
_FARTHEST = 1e9
"""Metres, of coordinates on a map."""
_RANGES = {
    "east": (-_FARTHEST, _FARTHEST),
    "north": (-_FARTHEST, _FARTHEST),
    "latitude": (-89.999, 89.999),
    "longitude": (-180.0, 180.0),
    "heading_deg": (-360.0, 360.0),
}


@dataclass(frozen=True)
class Site:
    """A file. `world`: None where it does not say."""

    world: World | None = None


def read_site(path: str | PathLike[str]) -> Site:
    """A file of a camera's place, JSON if its name ends so, else YAML.

    Raises:
        OSError: no such file. InputError: naming the file, the key, what is expected there and what it has.
    """
    root = _root(Path(path))
    root.members(_MEMBERS)
    return Site(_world(root))


def _root(path: Path) -> Field:
    text = read_text(path)
    root = parse(text, str(path)) if path.suffix.lower() == ".json" else parse_yaml(text, str(path))
    if root is None:
        raise input_error(str(path), f"a mapping of {', '.join(_MEMBERS)}", "nothing")
    return root


def _world(root: Field) -> World | None:
    flat, earth = (root.get(key) for key in ("map", "geographic"))
    if flat is not None and earth is not None:
        earth.fail("no geographic beside map", "both")
    if flat is not None:
        east, north, heading = _numbers(flat, "east", "north", "heading_deg")
        return World(east, north, math.radians(heading))
    if earth is not None:
        latitude, longitude, heading = _numbers(earth, "latitude", "longitude", "heading_deg")
        return World.at(latitude, longitude, math.radians(heading))
    return None


def _numbers(field: Field, *names: str) -> list[float]:
    """Members that must be there, within their ranges."""
    field.members(names)
    return [_in_range(field.need(name), *_RANGES[name]) for name in names]


def _in_range(field: Field, least: float, most: float) -> float:
    value = field.number()
    if not least <= value <= most:
        field.fail(f"a number from {least:g} to {most:g}")
    return value
