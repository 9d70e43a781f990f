"""The greenhouse of a car (windscreen, pillars, side and rear windows, roof) as one shell with two faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.car.shape import CarShape
from groundpose.lab.bodies.car.shell import Shell, rear_corner_z
from groundpose.lab.bodies.geometry.loft import along, half_shell
from groundpose.lab.bodies.geometry.mesh import ByteArray, Component, cross, unit
from groundpose.lab.bodies.parts.materials import MATERIAL

# Panes and pillars from the middle of the windscreen round the right side: name and cells.
_PANES = (
    ("screen", 4),
    ("a_pillar", 2),
    ("front_door", 3),
    ("b_pillar", 1),
    ("rear_door", 3),
    ("bar", 1),
    ("quarter", 2),
    ("c_pillar", 4),
    ("rear_window", 4),
)
_CELLS = dict(_PANES)
_STARTS = {name: sum(n for _, n in _PANES[:i]) for i, (name, _) in enumerate(_PANES)}
_COUNT = sum(_CELLS.values()) + 1

# Depth of the lower edge below the body's surface, and thickness of pillars and roof, metres.
_SINK = 0.012
_THICK = 0.022


@dataclass(frozen=True)
class Trim:
    """Trim of the windows: names of materials, and widths in metres."""

    b_pillar: str = "plastic"
    frame: str = "paint"  # above and around the side windows
    belt: str = "plastic"  # moulding under the side windows
    pillars: str = "paint"
    roof: str = "paint"
    quarter: bool = True  # a third side window
    surround: str = "paint"  # beside and above the rear window
    tail_lamps: bool = False  # beside the rear window


@dataclass(eq=False)
class Cabin:
    """The greenhouse: `points` (N, M, 3), the outer right half from the lower edge to the middle of the roof;
    `glass_rows` are the lines where panes start and end."""

    points: FloatArray
    materials: ByteArray
    inside: FloatArray
    glass_rows: tuple[int, int]

    def corner(self, pane: str, end: bool, top: bool) -> FloatArray:
        """A corner (3,) of a pane's glass: its first or last station, its lower or upper edge."""
        station = _STARTS[pane] + (_CELLS[pane] if end else 0)
        return np.asarray(self.points[station, self.glass_rows[int(top)]])

    @property
    def tail_corner(self) -> FloatArray:
        """The point (3,) on the rear pillar's outer edge at the height of the rear window's lower edge."""
        return np.asarray(self.points[_STARTS["rear_window"] - 1, self.glass_rows[0]])

    def pane(self, pane: str) -> FloatArray:
        """Grid (stations, rows, 3) of a pane's outer face."""
        start, (low, high) = _STARTS[pane], self.glass_rows
        return np.asarray(self.points[start : start + _CELLS[pane] + 1, low : high + 1])

    def component(self) -> Component:
        """The closed mesh: outer and inner face joined along the lower edge."""
        rows = np.array([0, self.glass_rows[0], *range(self.glass_rows[1], self.points.shape[1], 2)])
        rows[-1] = self.points.shape[1] - 1
        lines = np.concatenate([self.inside[:, rows[::-1]], self.points], axis=1)
        glass, lining = np.uint8(MATERIAL["glass"]), np.uint8(MATERIAL["interior"])
        inner = np.where(self.materials == glass, glass, lining)[:, rows[:-1]]
        joint = np.full((len(lines) - 1, 1), MATERIAL["rubber"], dtype=np.uint8)
        return half_shell(lines, np.concatenate([inner[:, ::-1], joint, self.materials], axis=1))


def make_cabin(shape: CarShape, shell: Shell, trim: Trim) -> Cabin:
    """Grid and materials of the greenhouse on a shell."""
    base, top = _lower_line(shape, shell), _upper_line(shape)
    fraction = _rows(base, top)
    wall = base[:, None] + (top - base)[:, None] * fraction[..., None]
    wall += (_curvature()[:, None] * 4.0 * fraction * (1.0 - fraction))[..., None] * _outward(base, top)[
        :, None
    ]
    roof = _roof(shape, top)
    knee = _knee(wall[:, -1], top, roof[:, 0])
    points = np.concatenate([wall, knee, roof], axis=1)
    points[[0, -1], :, 0] = 0.0
    points[:, -1, 0] = 0.0
    materials = _materials(points.shape[1] - 1, trim)
    normals = unit(cross(np.gradient(points, axis=1), np.gradient(points, axis=0)))
    inside = points - _THICK * normals
    inside[..., 0] = np.maximum(inside[..., 0], 0.0)
    inside[[0, -1], :, 0] = 0.0
    inside[:, -1, 0] = 0.0
    return Cabin(points, materials, inside, (1, wall.shape[1] - 2))


def _side_z(shape: CarShape) -> tuple[FloatArray, FloatArray]:
    """z of the stations along the side window at the lower and upper edge, A pillar to C pillar."""
    corner, rear = shape.cowl_z - shape.screen_bow, rear_corner_z(shape)
    front_top, rear_top = shape.roof_front_z - 0.3 * shape.screen_bow, shape.roof_rear_z + 0.06
    start, start_top = corner - 0.13, front_top - 0.075
    b = b_pillar_z(shape)
    b_width = 0.09 if not shape.two_door else 0.07
    last, last_top = last_window_z(shape)
    b_top = float(np.clip(b - 0.02, last_top + b_width + 0.12, start_top - 0.25))
    bar = last + (0.22 * (b - last) if not shape.two_door else min(0.10, 0.4 * (b - b_width - last)))
    bar_top = last_top + max(0.30 * (b_top - b_width - last_top), 0.05)
    low = np.concatenate(
        [
            np.linspace(start, b, 4),
            np.linspace(b - b_width, bar, 4),
            np.linspace(bar - 0.035, last, 3),
            np.linspace(last, rear, 4)[1:],
        ]
    )
    high = np.concatenate(
        [
            np.linspace(start_top, b_top, 4),
            np.linspace(b_top - b_width, bar_top, 4),
            np.linspace(bar_top - 0.03, last_top, 3),
            np.linspace(last_top, rear_top, 4)[1:],
        ]
    )
    return low, high


def b_pillar_z(shape: CarShape) -> float:
    """z of the front edge of the B pillar."""
    door = 1.30 if shape.two_door else 1.04
    return shape.outer.front_axle - 0.42 - door


def last_window_z(shape: CarShape) -> tuple[float, float]:
    """z of the rear end of the side windows at the lower and upper edge."""
    rear, rear_top = rear_corner_z(shape), shape.roof_rear_z + 0.06
    gap, gap_top = shape.rear_pillar
    return rear + gap, max(rear_top + gap_top, rear + gap + 0.10)


def _lower_line(shape: CarShape, shell: Shell) -> FloatArray:
    """Lower edge of the greenhouse (N, 3), sunk into the body."""
    side_z = _side_z(shape)[0]
    edge = shell.top_at(side_z)
    side = np.stack([edge[:, 0] - 0.014, -(edge[:, 1] - _SINK), side_z], axis=1)
    corner_z = shape.cowl_z - shape.screen_bow
    corner = shell.top_at(corner_z)
    glass_x = corner[0] - 0.115
    k = np.linspace(0.0, 1.0, _CELLS["screen"] + 1) * glass_x / corner[0]
    height = shape.cowl_height + (corner[1] - shape.cowl_height) * k**2 - _SINK
    screen = np.stack([k * corner[0], -height, shape.cowl_z - shape.screen_bow * k**2], axis=1)
    a_pillar = np.array([[corner[0] - 0.045, -(corner[1] - _SINK), corner_z - 0.045]])
    rear = _rear_line(shape, side[-1], shape.deck_z, shape.deck_height - _SINK, inset=0.09)
    return np.concatenate([screen, a_pillar, side, rear])


def _upper_line(shape: CarShape) -> FloatArray:
    """Edge between sides and roof (N, 3), before it is rounded."""
    side_z = _side_z(shape)[1]
    height, half = shape.outer.height, shape.roof_half_width
    front_z, rear_z = shape.roof_front_z, shape.roof_rear_z
    front_h, rear_h = height - 0.055, height - shape.roof_fall
    way = (side_z - side_z[-1]) / (front_z - side_z[-1])
    x = half * along(np.array([0.90, 0.985, 1.0, 0.955]), np.array([0.0, 0.35, 0.65, 1.0]), way)
    drop = 0.055
    h = (
        along(
            np.array([rear_h - 0.03, height - 0.5 * shape.roof_fall, height - 0.006, front_h - 0.02]),
            np.array([0.0, 0.45, 0.75, 1.0]),
            way,
        )
        - drop * 0.8
    )
    side = np.stack([x, -h, side_z], axis=1)
    glass_x = x[0] - 0.05
    k = np.linspace(0.0, 1.0, _CELLS["screen"] + 1)
    screen_h = front_h + (h[0] - front_h) * k**2
    screen = np.stack([k * glass_x, -screen_h, front_z - 0.3 * shape.screen_bow * k**2], axis=1)
    a_pillar = 0.5 * (screen[-1:] + side[:1]) + np.array([[0.012, -0.004, 0.022]])
    rear = _rear_line(shape, side[-1], rear_z, rear_h, inset=0.07)
    return np.concatenate([screen, a_pillar, side, rear])


def _rear_line(shape: CarShape, corner: FloatArray, z: float, height: float, inset: float) -> FloatArray:
    """Points (n, 3) of the rear window's edge from its corner to the middle plane."""
    k = np.linspace(1.0, 0.0, _CELLS["rear_window"] + 1)
    x = k * (corner[0] - inset)
    reach = (x / corner[0]) ** 2
    line_z = z + (corner[2] - z) * reach
    h = height + (-corner[1] - height) * reach
    return np.stack([x, -h, line_z], axis=1)


def _rows(base: FloatArray, top: FloatArray) -> FloatArray:
    """Fractions (N, R) of the way from the lower to the upper line: edge, glass, frame."""
    length = np.linalg.norm(top - base, axis=1)
    low = (_SINK + 0.022) / length
    frame = np.full(len(base), 0.062)
    frame[: _CELLS["screen"] + 1] = 0.07
    frame[-_CELLS["rear_window"] - 1 :] = 0.075
    high = 1.0 - frame / length
    last = 1.0 - 0.38 * frame / length
    middle = low[:, None] + (high - low)[:, None] * np.array([0.0, 0.34, 0.68, 1.0])
    return np.concatenate([np.zeros((len(base), 1)), middle, last[:, None]], axis=1)


def _curvature() -> FloatArray:
    """Outward bulge of the middle of the wall at each station, metres."""
    amount = dict.fromkeys(_CELLS, 0.018) | {"screen": 0.022, "rear_window": 0.020, "a_pillar": 0.020}
    cells = np.concatenate([np.full(n, amount[name]) for name, n in _PANES])
    return np.asarray(np.concatenate([cells[:1], 0.5 * (cells[1:] + cells[:-1]), cells[-1:]]))


def _outward(base: FloatArray, top: FloatArray) -> FloatArray:
    """Unit normals (N, 3) of the wall."""
    middle = 0.5 * (base + top)
    normal = unit(cross(top - base, np.gradient(middle, axis=0)))
    normal[[0, -1], 0] = 0.0
    return unit(normal)


def _roof(shape: CarShape, top: FloatArray) -> FloatArray:
    """Lines (N, 5, 3) of the roof from near its edge to the middle."""
    front, rear = shape.roof_front_z, shape.roof_rear_z
    side = slice(_STARTS["a_pillar"] + 1, _STARTS["rear_window"])
    way = np.empty(len(top))
    way[: side.start] = 0.045 * np.linspace(0.0, 1.0, side.start)
    way[side.stop :] = 1.0 - 0.045 * np.linspace(1.0, 0.0, len(top) - side.stop)
    z = top[side, 2]
    inner = (z[0] - z) / (z[0] - z[-1])
    way[side] = 0.06 + 0.88 * inner
    middle_z = front + (rear - front) * way
    height = shape.outer.height
    fall = np.array([shape.roof_fall, 0.35 * shape.roof_fall, 0.0, 0.012, 0.055])
    middle_h = height - along(fall, np.array([0.0, 0.4, 0.66, 0.82, 1.0]), 1.0 - way)
    first = 1.0 - 0.055 / np.maximum(top[:, 0], 0.055)
    k = np.stack([first, 0.82 * first, 0.55 * first, 0.28 * first, 0.0 * first], axis=1)
    bow = 1.0 - k**2
    x = top[:, :1] * k
    h = -top[:, 1:2] + (middle_h + top[:, 1])[:, None] * bow
    z_lines = top[:, 2:] + (middle_z[:, None] - top[:, 2:]) * bow
    return np.stack([x, -h, z_lines], axis=-1)


def _knee(wall: FloatArray, top: FloatArray, roof: FloatArray) -> FloatArray:
    """Two points (N, 2, 3) that round the edge `top` between wall and roof."""
    t = np.array([0.33, 0.67])[:, None]
    return np.asarray(wall[:, None] * (1 - t) ** 2 + top[:, None] * 2 * t * (1 - t) + roof[:, None] * t**2)


def _materials(rows: int, trim: Trim) -> ByteArray:
    """Materials (stations - 1, rows) of the outer face."""
    table = np.full((_COUNT - 1, rows), MATERIAL[trim.roof], dtype=np.uint8)
    low, high = 1, 4
    for name, cells in _PANES:
        columns = slice(_STARTS[name], _STARTS[name] + cells)
        pane, sill = {
            "a_pillar": (trim.pillars, trim.pillars),
            "b_pillar": (trim.b_pillar, trim.belt),
            "bar": (trim.b_pillar if trim.quarter else "glass", trim.belt),
            "c_pillar": (trim.pillars, trim.pillars),
        }.get(name, ("glass", trim.belt))
        table[columns, low:high] = MATERIAL[pane]
        table[columns, 0] = MATERIAL[sill]
        table[columns, high : high + 2] = MATERIAL[trim.frame if "window" not in name else trim.roof]
    beside = _STARTS["rear_window"] - 1
    table[beside:, high : high + 1] = MATERIAL[trim.surround]
    table[beside, low:high] = MATERIAL["taillamp" if trim.tail_lamps else trim.surround]
    table[_STARTS["screen"] : _CELLS["screen"], 0] = MATERIAL["plastic"]
    return table
