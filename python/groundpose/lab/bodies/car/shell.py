"""The lower body of a car: wall, wheel arches, bonnet, boot lid and the open tub of the cabin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lab.bodies.car.shape import CarShape
from groundpose.lab.bodies.car.wall import TopEdge, arch_radius, lower_edge, make_wall, top_radius
from groundpose.lab.bodies.geometry.loft import along, half_shell
from groundpose.lab.bodies.geometry.mesh import Component
from groundpose.lab.bodies.geometry.wall import Wall
from groundpose.lab.bodies.parts.materials import MATERIAL

# Rows of the wall: fractions of the distance from its lower edge to the crease, the crease, the rounded top.
_ROWS = np.array([0.0, 0.05, 0.20, 0.42, 0.64, 0.85])
_CREASE = np.array([-0.014, 0.014])
_ROUND = np.deg2rad([0.0, 45.0, 90.0])

# Lines of the bonnet and boot lid, fractions of the half width from the edge to the middle.
_LID = np.array([0.95, 0.82, 0.58, 0.30, 0.0])

# Height of the tub's floor above the lower edge of the body.
_FLOOR = 0.16

# Distance of the tub's wall inside the edge of the body.
SHELF = 0.125


@dataclass(eq=False)
class Shell:
    """The lower body. `points` (N, M, 3) is its right half: stations from front to rear, lines bottom up;
    `first_row` and `top_row` are the lines of the wall's lower and upper edge."""

    wall: Wall
    stations: FloatArray
    points: FloatArray
    materials: FloatArray
    first_row: int
    top_row: int
    front_corner: int
    rear_corner: int

    @property
    def top_edge(self) -> FloatArray:
        """Upper edge of the wall (N, 3)."""
        return np.asarray(self.points[:, self.top_row])

    def top_at(self, z: object) -> FloatArray:
        """Upper edge `[x, height]` (..., 2) at z."""
        edge, z = self.top_edge, np.asarray(z, dtype=np.float64)
        return np.stack(
            [np.interp(-z, -edge[:, 2], edge[:, 0]), np.interp(-z, -edge[:, 2], -edge[:, 1])], axis=-1
        )

    def top_at_u(self, u: object) -> FloatArray:
        """Height of the upper edge at u on the right side."""
        return np.interp(np.asarray(u, dtype=np.float64), self.stations, -self.top_edge[:, 1])

    def component(self) -> Component:
        """The closed mesh."""
        return half_shell(self.points, self.materials)


def _stations(shape: CarShape, wall: Wall) -> tuple[FloatArray, int, int]:
    """u of the stations, and the stations of the front and rear corner (outline at 45 degrees)."""
    d, radius = shape.outer, arch_radius(shape)
    angles = np.deg2rad(np.array([0, 20, 45, 68, 90, 112, 135, 160, 180]))
    arches = [
        np.concatenate([[axle + radius + 0.004], axle + radius * np.cos(angles), [axle - radius - 0.004]])
        for axle in (d.front_axle, d.rear_axle)
    ]
    front_end, rear_end = wall.u_at_z(arches[0][0]), wall.u_at_z(arches[1][-1])
    corners = _corner(wall, 0.0, float(front_end)), _corner(wall, float(rear_end), wall.length)
    cabin = cabin_ends(shape)
    inside = np.linspace(arches[0][-1], arches[1][0], 7)[1:-1]
    z = np.concatenate([*arches, inside])
    u = np.concatenate(
        [
            np.linspace(0.0, corners[0], 6)[:-1],
            np.linspace(corners[0], front_end, 5)[:-1],
            wall.u_at_z(z),
            np.linspace(rear_end, corners[1], 5)[1:-1],
            np.linspace(corners[1], wall.length, 6),
        ]
    )
    ends = wall.u_at_z([cabin[0], cabin[0] - 0.01, cabin[1] + 0.01, cabin[1]])
    u = np.unique(np.concatenate([u[np.abs(u[:, None] - ends).min(axis=1) > 0.006], ends]))
    return u, int(np.argmin(np.abs(u - corners[0]))), int(np.argmin(np.abs(u - corners[1])))


def _corner(wall: Wall, start: float, end: float) -> float:
    """u where the outline turns through 45 degrees."""
    u = np.linspace(start, end, 200)
    normal = wall.normals(u, np.full(200, 0.5))
    return float(u[np.argmin(np.abs(np.abs(normal[:, 0]) - np.abs(normal[:, 2])))])


def cabin_ends(shape: CarShape) -> tuple[float, float]:
    """z of the tub's front and rear end at the side."""
    return shape.cowl_z - shape.screen_bow - 0.03, rear_corner_z(shape) + 0.03


def rear_corner_z(shape: CarShape) -> float:
    """z of the corner where the rear window's pillar stands."""
    return shape.deck_z + (0.16 if shape.notchback else 0.14)


def make_shell(shape: CarShape) -> Shell:
    """Grid and materials of the lower body."""
    wall, top = make_wall(shape), TopEdge(shape)
    u, front_corner, rear_corner = _stations(shape, wall)
    plan_z = wall.z_at_u(u)
    low, high = lower_edge(shape, plan_z), top(plan_z)
    radius = top_radius(shape)
    crease = (high - shape.crease)[:, None] + _CREASE
    rows = np.concatenate([low[:, None] + _ROWS * (crease[:, :1] - low[:, None]), crease], axis=1)
    round_ = high[:, None] - radius * (1.0 - np.sin(_ROUND))
    h = np.concatenate([rows, round_], axis=1)
    side = wall.points(u[:, None], h)
    floor = _underside(shape, side[:, 0], low)
    lid, cabin = _lid(shape, wall, u, side[:, -1], low)
    points = np.concatenate([floor, side, lid], axis=1)
    first, last = floor.shape[1], floor.shape[1] + h.shape[1] - 1
    materials = np.full((len(u) - 1, points.shape[1] - 1), MATERIAL["paint"], dtype=np.uint8)
    materials[:, :first] = MATERIAL["underbody"]
    materials[cabin, last + 1 :] = MATERIAL["interior"]
    return Shell(wall, u, points, materials, first, last, front_corner, rear_corner)


def _underside(shape: CarShape, edge: FloatArray, low: FloatArray) -> FloatArray:
    """Lines (N, 4, 3) from the middle of the underside to the wall's lower edge; over a wheel: the well."""
    floor = shape.outer.clearance + 0.035
    inner = _well_x(shape, edge)
    lip = np.minimum(0.03, 0.1 * edge[:, 0])
    x = np.stack([0.0 * inner, inner, inner, edge[:, 0] - lip], axis=1)
    level = np.maximum(np.full_like(low, floor), np.where(low > 0.3 + floor, floor, low + 0.02))
    y = -np.stack([level, level, low, low], axis=1)
    return np.stack([x, y, np.repeat(edge[:, 2:3], 4, axis=1)], axis=-1)


def _well_x(shape: CarShape, edge: FloatArray) -> FloatArray:
    """x of the wheel wells' inner wall at each station."""
    return np.minimum(shape.half_width - shape.tyre_width - 0.13, 0.9 * edge[:, 0])


def _lid(
    shape: CarShape, wall: Wall, u: FloatArray, edge: FloatArray, low: FloatArray
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Lines (N, 5, 3) from the wall's upper edge to the middle plane, and which cells lie in the cabin."""
    ends = cabin_ends(shape)
    front, rear = wall.u_at_z(ends[0]), wall.u_at_z(ends[1])
    nose, tail = edge[0, 2], edge[-1, 2]
    cowl, deck = shape.cowl_z - 0.03, shape.deck_z + 0.03
    fraction = u / front
    middle_z = np.where(u <= front, nose + (cowl - nose) * fraction**1.25, 0.0)
    way = np.clip((u - front) / (rear - front), 0.0, 1.0)
    middle_z = np.where((u > front) & (u < rear), cowl + (deck - cowl) * way, middle_z)
    back = np.clip((wall.length - u) / (wall.length - rear), 0.0, 1.0)
    middle_z = np.where(u >= rear, tail + (deck - tail) * back**1.25, middle_z)
    middle_h = lid_height(shape, middle_z, float(-edge[0, 1]), float(nose), float(-edge[-1, 1]), float(tail))
    k = _LID
    bow = 1.0 - k**2
    x = edge[:, :1] * k
    z = edge[:, 2:] + (middle_z[:, None] - edge[:, 2:]) * bow
    h = -edge[:, 1:2] + (middle_h + edge[:, 1])[:, None] * bow
    lines = np.stack([x, -h, z], axis=-1)
    tub = (u > front + 1e-9) & (u < rear - 1e-9)
    lines[tub] = _tub(shape, edge[tub], lines[tub, -1, 2], low[tub])
    cabin = np.flatnonzero(tub[1:] | tub[:-1])
    return lines, cabin


def _tub(shape: CarShape, edge: FloatArray, middle_z: FloatArray, low: FloatArray) -> FloatArray:
    """Lines (n, 5, 3) of the open cabin: shelf under the windows, inner wall, wheel housings, floor."""
    floor = np.full(len(edge), shape.outer.clearance + _FLOOR)
    ledge = np.maximum(floor, low + 0.03)
    inner = np.minimum(_well_x(shape, edge) - 0.02, edge[:, 0] - SHELF - 0.02)
    x = np.stack([*[edge[:, 0] - SHELF] * 2, inner, inner, 0.0 * inner], axis=1)
    sill = -edge[:, 1] - 0.004
    h = np.stack([sill, ledge, ledge, floor, floor], axis=1)
    k = x / edge[:, :1]
    z = edge[:, 2:] + (middle_z[:, None] - edge[:, 2:]) * (1.0 - k**2)
    return np.stack([x, -h, z], axis=-1)


def lid_height(
    shape: CarShape, z: FloatArray, nose_height: float, nose: float, tail_height: float, tail: float
) -> FloatArray:
    """Height of bonnet and boot lid on the middle plane at z; undefined between them."""
    cowl, edge, deck = shape.cowl_height, shape.bonnet_height, shape.deck_height
    length = nose - shape.cowl_z
    bonnet = along(
        np.array([cowl, edge + 0.62 * (cowl - edge), edge + 0.30 * (cowl - edge), nose_height]),
        np.array([shape.cowl_z, nose - 0.55 * length, nose - 0.18 * length, nose]),
        z,
    )
    boot = np.interp(z, [tail, tail + 0.06, shape.deck_z + 0.05], [tail_height, tail_height + 0.02, deck])
    return np.asarray(np.where(z > 0.5 * (shape.cowl_z + shape.deck_z), bonnet, boot))
