"""Headlamps and tail lamps of a car as slabs on its wall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.car.look import Face
from groundpose.lab.bodies.car.shape import CarShape
from groundpose.lab.bodies.car.shell import Shell
from groundpose.lab.bodies.geometry.mesh import Component, both_sides
from groundpose.lab.bodies.geometry.slab import slab
from groundpose.lab.bodies.parts.materials import MATERIAL
from groundpose.lab.bodies.parts.trim import round_patch

_LENS = 0.009  # height of a lamp's lens above the wall, metres
_BEZEL = 0.004
_LEAST_TAIL = 0.12  # length of a tail lamp along the wall, metres
# x of a tail lamp's outer end, as a fraction of the half width, where the wheel leaves no place on the side.
_LEAST_OUTER_END = 0.5


@dataclass(frozen=True)
class Lamp:
    """A lamp's outline on the wall: positions along it, outer end last, and its edges there."""

    u: FloatArray
    low: FloatArray
    high: FloatArray

    def grown(self, by: float) -> Lamp:
        """The outline enlarged by this margin (metres) on all sides."""
        u = self.u.copy()
        u[0] -= by * np.sign(self.u[-1] - self.u[0])
        u[-1] += by * np.sign(self.u[-1] - self.u[0])
        return Lamp(u, self.low - by, self.high + by)

    def part(self, start: float, end: float, low: float = 0.0, high: float = 1.0) -> Lamp:
        """The part between two fractions of the length and two of the height."""
        fraction = np.linspace(start, end, max(4, round(len(self.u) * (end - start)) + 1))
        at = np.linspace(0.0, 1.0, len(self.u))
        u, bottom, top = (np.interp(fraction, at, line) for line in (self.u, self.low, self.high))
        return Lamp(u, bottom + low * (top - bottom), bottom + high * (top - bottom))

    def slab(self, shell: Shell, material: str, thickness: float, rows: int = 3) -> Component:
        """A plate of this outline."""
        order = slice(None) if self.u[-1] > self.u[0] else slice(None, None, -1)
        return slab(
            shell.wall,
            self.u[order],
            self.low[order],
            self.high[order],
            MATERIAL[material],
            thickness,
            rows,
        )

    def outer_end(self, shell: Shell, thickness: float = _LENS, bevel: float = 0.006) -> FloatArray:
        """The point (3,) at the outer end of the slab, at half its height."""
        u = self.u[-1] - np.sign(self.u[-1] - self.u[0]) * bevel
        low, high = (
            np.interp(u, np.sort(self.u), line[np.argsort(self.u)]) for line in (self.low, self.high)
        )
        h = 0.5 * (low + high)
        return np.asarray(shell.wall.points(u, h) + thickness * shell.wall.normals(u, h))


def headlamp(shape: CarShape, shell: Shell, face: Face) -> Lamp:
    """Outline of the right headlamp."""
    wall = shell.wall
    start = float(wall.u_at_x(face.lamp_inner * shape.half_width))
    limit = shape.outer.front_axle + shape.outer.wheel_radius + shape.arch_gap + 0.07
    back = 0.5 * shape.outer.length - shape.nose_bow - 0.12 - 0.5 * shape.nose_corner - face.lamp_reach
    end = float(wall.u_at_z(max(back, limit)))
    u = np.linspace(start, end, 9)
    fraction = np.linspace(0.0, 1.0, 9)
    high = shell.top_at_u(u) - 0.045 - 0.012 * (1.0 - fraction)
    tall = face.lamp_height * (face.lamp_taper + (1.0 - face.lamp_taper) * np.minimum(1.0, 2.0 * fraction))
    if face.lamp_round:
        middle = high - 0.5 * face.lamp_height
        tall = face.lamp_height * np.maximum(np.sqrt(1.0 - (2.0 * fraction - 1.0) ** 2), 0.15)
        return Lamp(u, middle - 0.5 * tall, middle + 0.5 * tall)
    tall *= np.clip((1.06 - fraction) / 0.35, 0.28, 1.0) if shape.age > 0.4 else 1.0
    return Lamp(u, high - tall, high)


def tail_lamp(shape: CarShape, shell: Shell, face: Face) -> Lamp:
    """Outline of the right tail lamp, its outer end on the side of the body."""
    wall = shell.wall
    limit = shape.outer.rear_axle - shape.outer.wheel_radius - shape.arch_gap - 0.06
    end = float(
        wall.u_at_z(min(-0.5 * shape.outer.length + 0.10 + 0.5 * shape.tail_corner + face.tail_reach, limit))
    )
    end = min(end, float(wall.u_at_x(_LEAST_OUTER_END * shape.half_width, rear=True)))
    start = max(float(wall.u_at_x(face.tail_inner * shape.half_width, rear=True)), end + _LEAST_TAIL)
    u = np.linspace(start, end, 8)
    fraction = np.linspace(0.0, 1.0, 8)
    high = shell.top_at_u(u) - 0.050
    tall = face.tail_height * np.clip((1.25 - fraction) / 0.6, 0.45, 1.0)
    return Lamp(u, high - tall, high)


def lamps(shape: CarShape, shell: Shell, face: Face) -> list[Component]:
    """Both headlamps and tail lamps."""
    front, rear = headlamp(shape, shell, face), tail_lamp(shape, shell, face)
    parts = [front.grown(0.010).slab(shell, "plastic", _BEZEL, rows=2), front.slab(shell, "headlamp", _LENS)]
    middle = 0.5 * (front.low + front.high)
    for place in (2, 4) if face.lamp_inner < 0.60 else (3,):
        radius = 0.36 * float(front.high[place] - front.low[place])
        parts.append(
            round_patch(shell.wall, float(front.u[place]), float(middle[place]), radius, "chrome", 0.011)
        )
    if face.amber:
        parts.append(front.part(0.74, 0.98).slab(shell, "indicator", _LENS + 0.003, rows=2))
    parts += [rear.grown(0.008).slab(shell, "plastic", _BEZEL, rows=2), rear.slab(shell, "taillamp", _LENS)]
    pieces = (
        [
            ("indicator", rear.part(0.06, 0.94, 0.44, 0.68)),
            ("reversing_lamp", rear.part(0.06, 0.80, 0.22, 0.40)),
        ],
        [
            ("reversing_lamp", rear.part(0.05, 0.32, 0.12, 0.88)),
            ("indicator", rear.part(0.36, 0.58, 0.12, 0.88)),
        ],
        [("reversing_lamp", rear.part(0.10, 0.45, 0.10, 0.34))],
    )[face.tail_pattern]
    parts += [piece.slab(shell, name, _LENS + 0.006, rows=3) for name, piece in pieces]
    return both_sides(parts)
