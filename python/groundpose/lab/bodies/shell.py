"""Shells of boxy vehicles: stacked horizontal outlines; each cell of the surface has its material.

A level is a rounded rectangle seen from above, at some height, with any front and rear. A level whose front
is further back than that of the level below makes a sloping windscreen; two levels of nearly the same height
make a bonnet. Columns run round the right half of every level from the middle of the front over the
corner and the side to the middle of the rear, so windows, lamps and doors are rectangles of cells.
Heights are positive upwards here; points come out in the body frame (y down).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lab.bodies.geometry.mesh import CREASE_DEG, Component, component
from groundpose.lab.bodies.outlines import Arch, Columns, Level
from groundpose.lab.bodies.parts.materials import MATERIAL

# Shortest stretched part of a side, metres, however far the front slopes back.
_STRETCH = 0.28

# Lines of the floor before the first level.
_FLOOR = 3


@dataclass(eq=False)
class Shell:
    """A closed shell under construction: `points` (N, M, 3) of the right half, materials of its cells.

    Lines j are the levels with those of the floor before the first and of the roof after the last.
    """

    points: FloatArray
    columns: Columns
    names: tuple[str, ...]
    crease_deg: float = CREASE_DEG
    right: NDArray[np.uint8] = field(init=False)
    left: NDArray[np.uint8] = field(init=False)
    flipped: NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        """Paint on all cells except those of the floor."""
        cells = (self.points.shape[0] - 1, self.points.shape[1] - 1)
        self.right = np.zeros((*cells, 2), dtype=np.uint8)
        self.right[:, :_FLOOR] = MATERIAL["underbody"]
        self.left = self.right.copy()
        self.flipped = np.zeros(cells, dtype=bool)

    def level(self, name: str) -> int:
        """Line j of a level."""
        return _FLOOR + self.names.index(name)

    def point(self, column: int, level: str, side: float = 1.0) -> FloatArray:
        """Point (3,) of a column and level; `side` -1 for the left."""
        return np.asarray(self.points[column, self.level(level)] * [side, 1.0, 1.0])

    def paint(
        self,
        material: str,
        columns: tuple[int, int],
        levels: tuple[str, str] | tuple[int, int],
        cut: str = "",
        sides: str = "both",
    ) -> None:
        """Give the cells between two columns and two levels a material.

        Args:
            material: name.
            columns: first and last, in the order of the outline.
            levels: lower and upper.
            cut: corners to cut off by half a cell, of "f" (front lower), "F" (front upper), "r" and "R".
            sides: "both", "left" or "right".
        """
        i0, i1 = columns
        j0, j1 = (self.level(n) if isinstance(n, str) else n for n in levels)
        if i1 <= i0 or j1 <= j0:
            return
        corners = {"f": (i0, j0, 0, True), "r": (i1 - 1, j0, 0, False), "R": (i1 - 1, j1 - 1, 1, True)}
        corners["F"] = (i0, j1 - 1, 1, False)
        for which, cells in (("right", self.right), ("left", self.left)):
            if sides not in (which, "both"):
                continue
            before = [(corners[c], cells[corners[c][:2]][corners[c][2]]) for c in cut]
            cells[i0:i1, j0:j1] = MATERIAL[material]
            for (i, j, triangle, flip), old in before:
                cells[i, j, triangle] = old
                self.flipped[i, j] = flip

    def component(self) -> Component:
        """The closed surface."""
        n, m = self.points.shape[:2]
        half = self.points.copy()
        half[[0, -1], :, 0] = 0.0
        half[:, [0, -1], 0] = 0.0
        i, j = np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij")
        a = i * m + j
        b, c, d = a + m, a + m + 1, a + 1
        split = np.stack([np.stack([a, c, b], -1), np.stack([a, d, c], -1)], 2)
        other = np.stack([np.stack([a, d, b], -1), np.stack([b, d, c], -1)], 2)
        faces = np.where(self.flipped[:, :, None, None], other, split).reshape(-1, 3)
        right = half.reshape(-1, 3)
        return component(
            np.concatenate([right, right * [-1.0, 1.0, 1.0]]),
            np.concatenate([faces, faces[:, ::-1] + len(right)]),
            np.concatenate([self.right.ravel(), self.left.ravel()]),
            self.crease_deg,
        )


def shell(
    levels: list[Level],
    columns: Columns,
    arches: tuple[Arch, ...] = (),
    arch_level: str = "",
    well: float = 0.0,
    crown: float = 0.0,
    crease_deg: float = CREASE_DEG,
) -> Shell:
    """Points of a shell.

    Args:
        levels: from the bottom up.
        columns: see `Columns`.
        arches: cut into the levels below `arch_level`, the first level that they do not change.
        well: half width of the floor between the wheel arches.
        crown: rise of the roof's middle over its edge; negative for a bed or well.
        crease_deg: see `Component`.
    """
    rows = [_outline(level, columns) for level in levels]
    points = np.stack(rows, axis=1)
    names = tuple(level.name for level in levels)
    base = points[:, 0].copy()
    if arches:
        _cut_arches(points, arches, names.index(arch_level), columns)
    floor = _floor(base, points[:, 0], well)
    roof = _roof(points[:, -1], crown, levels[-1].half_width)
    return Shell(np.concatenate([floor, points, roof], axis=1), columns, names, crease_deg)


def ends(level: Level) -> tuple[float, float]:
    """z of the first and last column of the side."""
    front = level.front - level.front_bow - level.front_corner[1]
    return front, level.rear + level.rear_bow + level.rear_corner[1]


def side_columns(lowest: Level, places: Sequence[FloatArray | Sequence[float]]) -> FloatArray:
    """Columns of the side at all `places` between the ends of the lowest level, decreasing."""
    front, rear = ends(lowest)
    z = np.concatenate([*places, [front, rear]])
    return np.unique(np.round(z[(z <= front) & (z >= rear)], 4))[::-1]


def _outline(level: Level, columns: Columns) -> FloatArray:
    """Points (N, 3) of one level."""
    half, nose = level.half_width, level.half_width * level.nose
    fx, fz, rx, rz = *level.front_corner, *level.rear_corner
    front_end, rear_end = level.front - level.front_bow - fz, level.rear + level.rear_bow + rz
    step = np.linspace(0.0, 0.5 * np.pi, columns.corner + 1)[1:-1]
    side = columns.side
    forward_of = min(columns.front_stretch, front_end - _STRETCH)
    back_of = max(columns.rear_stretch, rear_end + _STRETCH)
    if forward_of < back_of:  # a short roof: both ends divide what is left
        forward_of = back_of = 0.5 * (front_end + rear_end)
    ahead = np.clip((side - forward_of) / (side[0] - forward_of), 0.0, 1.0)
    behind = np.clip((back_of - side) / (back_of - side[-1]), 0.0, 1.0)
    z = np.clip(side, back_of, forward_of)
    z = z + ahead * (front_end - forward_of) + behind * (rear_end - back_of)
    x = half + ahead**2 * (nose - half)
    front = np.stack([columns.front * (nose - fx), level.front - level.front_bow * columns.front**2], axis=1)
    corner = np.stack([nose - fx + fx * np.sin(step), front_end + fz * np.cos(step)], axis=1)
    rear_turn = np.stack([half - rx + rx * np.cos(step), rear_end - rz * np.sin(step)], axis=1)
    rear = np.stack([columns.rear * (half - rx), level.rear + level.rear_bow * columns.rear**2], axis=1)
    plan = np.concatenate([front, corner, np.stack([x, z], axis=1), rear_turn, rear[::-1]])
    front_height = level.height if level.front_height is None else level.front_height
    forward = np.zeros(len(plan))
    forward[: len(front) + len(corner)] = 1.0
    forward[len(front) + len(corner) : len(front) + len(corner) + len(side)] = ahead
    height = level.height + forward * (front_height - level.height)
    return np.stack([plan[:, 0], -height, plan[:, 1]], axis=1)


def _cut_arches(points: FloatArray, arches: tuple[Arch, ...], above: int, columns: Columns) -> None:
    """Raise the lower edge over the wheels and compress the levels between it and line `above`."""
    start = len(columns.front) + columns.corner - 1
    side = points[start : start + len(columns.side)]
    lower, upper = side[:, :1, 1].copy(), side[:, above, None, 1].copy()
    edge = np.max([arch.edge(columns.side) for arch in arches], axis=0)
    # An arch ends 2 cm below the first unchanged level, so that no cell turns inside out.
    lifted = np.maximum(np.minimum(lower, -edge[:, None]), upper + 0.02)
    side[:, :above, 1] = upper + (side[:, :above, 1] - upper) * (upper - lifted) / (upper - lower)


def _floor(base: FloatArray, edge: FloatArray, well: float) -> FloatArray:
    """Lines (N, 3, 3) from the middle plane to the lower edge: flat, then up the arches' inner walls."""
    lines = np.stack([base, base, edge], axis=1)
    lines[:, 0, 0] = 0.0
    lines[:, 1:, 0] = np.minimum(well, 0.97 * base[:, :1])
    return lines


def _roof(edge: FloatArray, crown: float, half_width: float, lines: int = 2) -> FloatArray:
    """Lines (N, lines, 3) from the upper edge to the middle plane."""
    fraction = np.linspace(1.0, 0.0, lines + 1)[1:]
    points = np.repeat(edge[:, None], lines, axis=1)
    points[:, :, 0] *= fraction
    rise = crown * (edge[:, :1] / half_width) ** 2 * (1.0 - fraction**2)
    points[:, :, 1] -= rise
    return points
