"""What is told of the place of a camera: `world.yaml`, or the same as JSON.

One of these says where the camera's ground lies, heading in degrees from north to the east:

    map: {east: 1200.0, north: 3400.0, heading_deg: 90.0}
    geographic: {latitude: 48.137, longitude: 11.575, heading_deg: 90.0}

And what is drawn on the road:

    lines:
      - {name: gate, ground: [[-6, 20], [6, 20]]}
      - {name: stop, pixels: [[310, 402], [980, 398]], directions: [out, in]}
    lanes:
      - {name: right, map: [[1203, 3420], [1203, 3460]], width: 3.5}
      - {name: bay, ground: [[-8, 20], [-5, 20], [-5, 32], [-8, 32]]}

Points are of the `ground`, metres right and forward of the camera; of the `map`, metres east and north;
`geographic`, latitude and longitude; or `pixels` of the picture. A lane with a `width` has the points of its
centre line, in the direction in which it is driven; one without has the corners of a polygon. `directions`
are the words for crossing a line from left to right, as seen from its first point to its second, and back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from groundpose._checks import FloatArray, input_error, read_text
from groundpose.formats.fields import Field, parse
from groundpose.formats.yaml_text import parse_yaml
from groundpose.traffic import Lane, Line
from groundpose.types import View
from groundpose.world import World

_MEMBERS = ("map", "geographic", "lines", "lanes")
_FARTHEST = 1e9
"""Metres, of coordinates on a map."""
_SEEN = 1000.0
"""Metres from the camera up to which its pixels show the road."""
_RANGES = {
    "east": (-_FARTHEST, _FARTHEST),
    "north": (-_FARTHEST, _FARTHEST),
    "latitude": (-89.999, 89.999),
    "longitude": (-180.0, 180.0),
    "heading_deg": (-360.0, 360.0),
}


@dataclass(frozen=True)
class Site:
    """A file.

    Attributes:
        world: None where it does not say.
        lines, lanes: on the ground.
    """

    world: World | None = None
    lines: tuple[Line, ...] = ()
    lanes: tuple[Lane, ...] = ()


def read_site(path: str | PathLike[str], view: View | None = None, world: World | None = None) -> Site:
    """A file of a camera's place, JSON if its name ends so, else YAML.

    Args:
        path: the file.
        view: camera, tilt and height, for points in pixels.
        world: for points on a map, instead of the file's own.

    Raises:
        OSError: no such file. InputError: naming the file, the key, what is expected there and what it has.
    """
    root = _root(Path(path))
    root.members(_MEMBERS)
    own = _world(root)
    points = _Points(view, world or own)
    lines, lanes = (root.get(key) for key in ("lines", "lanes"))
    site = Site(
        own,
        () if lines is None else tuple(_line(item, points) for item in lines.items()),
        () if lanes is None else tuple(_lane(item, points) for item in lanes.items()),
    )
    names = [*(line.name for line in site.lines), *(lane.name for lane in site.lanes)]
    for name in names:
        if names.count(name) > 1:
            raise input_error(str(path), "names of lines and lanes that are all different", f"{name!r} twice")
    return site


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


@dataclass(frozen=True)
class _Points:
    """Where points of each kind lie on the ground."""

    view: View | None
    world: World | None

    def of(self, item: Field) -> FloatArray:
        """(N, 2) of the one list of points of a line or lane."""
        given = [(kind, field) for kind in self.kinds if (field := item.get(kind)) is not None]
        if len(given) != 1:
            item.fail(f"points in one of {', '.join(self.kinds)}", f"{len(given)} of them")
        kind, field = given[0]
        return self.kinds[kind](self, field, np.array(field.rows(2)).reshape(-1, 2))

    def _ground(self, field: Field, points: FloatArray) -> FloatArray:
        return points

    def _map(self, field: Field, points: FloatArray) -> FloatArray:
        if self.world is None or self.world.is_geographic:
            field.fail("the map of the file, or of --world", "none")
        with field.blamed():
            return self.world.ground_of(points)

    def _geographic(self, field: Field, points: FloatArray) -> FloatArray:
        if self.world is None or not self.world.is_geographic:
            field.fail("the file's geographic coordinates, or those of --world", "none")
        with field.blamed():
            return self.world.ground_of_geographic(points)

    def _pixels(self, field: Field, points: FloatArray) -> FloatArray:
        if self.view is None or self.view.height is None:
            field.fail("a camera that stands, whose height is known", "none")
        places = self.view.ground_of(points)
        for k, place in enumerate(places):
            if not np.linalg.norm(place) < _SEEN:
                shown = f"{points[k].tolist()}, which does not show the road"
                field.items()[k].fail(f"a pixel that shows the road within {_SEEN:g} m", shown)
        return places

    kinds = {"ground": _ground, "map": _map, "geographic": _geographic, "pixels": _pixels}  # noqa: RUF012


def _line(item: Field, points: _Points) -> Line:
    item.members(("name", "directions", *points.kinds))
    name, ends, words = str(item.need("name").label()), points.of(item), item.get("directions")
    if len(ends) != 2:
        item.fail("two points", str(len(ends)))
    given = [] if words is None else [word.text() for word in words.items()]
    if words is not None and len(given) != 2:
        words.fail("two words")
    with item.blamed():
        start, end = ends
        return Line(name, start, end, (given[0], given[1])) if given else Line(name, start, end)


def _lane(item: Field, points: _Points) -> Lane:
    item.members(("name", "width", *points.kinds))
    name, corners, width = str(item.need("name").label()), points.of(item), item.get("width")
    across = None if width is None else width.number()
    with item.blamed():
        return Lane(name, corners) if across is None else Lane.along(name, corners, across)
