"""Lines and lanes as a user draws them on the ground."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from groundpose._checks import FloatArray, finite, input_error, number, shaped, text, type_error
from groundpose._value import Value

_LEAST = 0.1
"""Metres, of a line or of a lane across."""
_SHARPEST = 2.0
"""Half widths by which a corner of a lane is away from its centre line at most."""


@dataclass(frozen=True, eq=False)
class Line(Value):
    """A straight line on the ground that vehicles cross.

    Args:
        name: as files have it.
        start, end: (2,) metres right and forward of the camera, as `Tracks.place`.
        directions: what a crossing from left to right is called, as seen by somebody who looks from start to
            end, and one from right to left.

    Raises:
        InputError: a name of no letters, numbers that cannot be, a line of less than 10 cm.
        TypeError: something else.
    """

    name: str
    start: FloatArray
    end: FloatArray
    directions: tuple[str, str] = ("left_to_right", "right_to_left")

    def __post_init__(self) -> None:
        """Check the numbers."""
        ends = {key: _points(key, getattr(self, key), (2,)) for key in ("start", "end")}
        if not np.linalg.norm(ends["end"] - ends["start"]) >= _LEAST:
            raise input_error("end", f"a point {_LEAST:g} m or more from start", ends["end"].tolist())
        words = tuple(text("directions", word) for word in self.directions)
        if len(words) != 2 or words[0] == words[1]:
            raise input_error("directions", "two different words", words)
        self._set(name=_name(self.name), directions=words, **ends)

    @property
    def length(self) -> float:
        """Metres."""
        return float(np.linalg.norm(self.end - self.start))

    def along_and_across(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N,) metres of places (N, 2) along the line from its start, and to the right of it."""
        along = (self.end - self.start) / self.length
        away = places - self.start
        return away @ along, away @ np.array([along[1], -along[0]])


@dataclass(frozen=True, eq=False)
class Lane(Value):
    """A part of the road.

    Args:
        name: as files have it.
        polygon: (N, 2) corners in order, metres right and forward of the camera.
        section: where its vehicles are counted; None: across the middle of the polygon. Crossings of it are
            "forward" or "backward"; forward is away from the camera.

    Raises:
        InputError: a name of no letters, fewer than three corners, a polygon without area, numbers that
            cannot be. TypeError: something else.
    """

    name: str
    polygon: FloatArray
    section: Line = field(default=None)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        """Check the numbers, lay the section."""
        polygon = _points("polygon", self.polygon, ("N", 2))
        if len(polygon) < 3 or _area_and_middle(polygon)[0] < _LEAST**2:
            raise input_error("polygon", "three corners or more around an area", polygon.tolist())
        name = _name(self.name)
        section = _middle_section(name, polygon) if self.section is None else self.section
        if not isinstance(section, Line):
            raise type_error("section", "a Line", section)
        self._set(name=name, polygon=polygon, section=section)

    @classmethod
    def along(cls, name: str, centre: ArrayLike, width: float) -> Lane:
        """A lane along a centre line (N, 2), in the direction in which it is driven, `width` metres across.
        Its vehicles are counted in the middle of it. Raises as the class does."""
        points = _points("centre", centre, ("N", 2))
        half = 0.5 * number("width", width)
        if not _LEAST <= 2.0 * half <= 1000.0:
            raise input_error("width", f"metres from {_LEAST:g} to 1000", width)
        steps = np.diff(points, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        if len(points) < 2 or not (lengths >= _LEAST).all():
            expected = f"two points or more, {_LEAST:g} m or more from one to the next"
            raise input_error("centre", expected, points.tolist())
        directions = steps / lengths[:, None]
        rights = _right_of(directions)
        corners = np.stack([rights[[0, *range(len(rights))]], rights[[*range(len(rights)), -1]]])
        sums = corners.sum(axis=0)
        shift = sums / np.maximum((sums * corners[0]).sum(axis=1), 1.0 / _SHARPEST)[:, None]
        polygon = np.concatenate([points + half * shift, (points - half * shift)[::-1]])
        done = np.concatenate([[0.0], np.cumsum(lengths)])
        k = int(np.searchsorted(done, 0.5 * done[-1], side="right")) - 1
        middle = points[k] + (0.5 * done[-1] - done[k]) * directions[k]
        across = half * rights[k]
        return cls(name, polygon, _section(name, middle + across, middle - across))

    def contains(self, places: ArrayLike) -> NDArray[np.bool_]:
        """(N,) whether places (N, 2) are in it."""
        points = shaped("places", places, ("N", 2))
        a, b = self.polygon, np.roll(self.polygon, -1, axis=0)
        between = (a[:, 1] > points[:, None, 1]) != (b[:, 1] > points[:, None, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            at = a[:, 0] + (points[:, None, 1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
        return np.asarray((between & (points[:, None, 0] < at)).sum(axis=1) % 2 == 1)


def _name(value: object) -> str:
    name = text("name", value).strip()
    if not name:
        raise input_error("name", "a name", repr(value))
    return name


def _points(argument: str, value: ArrayLike, shape: tuple[int | str, ...]) -> FloatArray:
    points = np.array(finite(argument, shaped(argument, value, shape)))
    points.setflags(write=False)
    return points


def _right_of(directions: FloatArray) -> FloatArray:
    return np.asarray(np.stack([directions[..., 1], -directions[..., 0]], axis=-1))


def _section(name: str, right: FloatArray, left: FloatArray) -> Line:
    """Across a lane: somebody who looks from its right to its left sees those who drive forward come from the
    left."""
    return Line(name, right, left, ("forward", "backward"))


def _area_and_middle(polygon: FloatArray) -> tuple[float, FloatArray]:
    """Square metres, and the centroid."""
    a, b = polygon - polygon[0], np.roll(polygon, -1, axis=0) - polygon[0]
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    area = 0.5 * float(cross.sum())
    if area == 0.0:
        return 0.0, polygon.mean(axis=0)
    return abs(area), polygon[0] + ((a + b) * cross[:, None]).sum(axis=0) / (6.0 * area)


def _middle_section(name: str, polygon: FloatArray) -> Line:
    """Across the polygon through its centroid, along the shorter of its main axes."""
    middle = _area_and_middle(polygon)[1]
    sides = np.roll(polygon, -1, axis=0) - polygon
    # points along the outline weigh as long as its sides are
    outline = np.concatenate([polygon + f * sides for f in (np.arange(16) + 0.5) / 16])
    weights = np.tile(np.linalg.norm(sides, axis=1), 16)
    away = outline - middle
    forward = np.linalg.eigh((away * weights[:, None]).T @ away)[1][:, 1]
    if forward[1] < 0.0 or (forward[1] == 0.0 and forward[0] < 0.0):
        forward = -forward
    right = _right_of(forward)
    a, b = (polygon - middle) @ forward, (np.roll(polygon, -1, axis=0) - middle) @ forward
    meets = (a > 0.0) != (b > 0.0)
    share = a[meets] / (a[meets] - b[meets])
    across = (polygon[meets] + share[:, None] * sides[meets] - middle) @ right
    ends = across[across > 0.0].min(initial=np.inf), across[across < 0.0].max(initial=-np.inf)
    if not np.isfinite(ends).all():  # the centroid is outside
        ends = float(across.max()), float(across.min())
    return _section(name, middle + ends[0] * right, middle + ends[1] * right)
