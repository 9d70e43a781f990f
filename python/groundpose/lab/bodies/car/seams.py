"""Gaps of a car's doors, bonnet, boot and bumpers."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.car.cabin import b_pillar_z, last_window_z
from groundpose.lab.bodies.car.shape import CarShape
from groundpose.lab.bodies.car.shell import Shell
from groundpose.lab.bodies.car.wall import arch_radius
from groundpose.lab.bodies.geometry.mesh import Component, both_sides, cross, unit
from groundpose.lab.bodies.geometry.slab import ribbon
from groundpose.lab.bodies.parts.materials import MATERIAL

# Width of a gap: a little more than a real one, which would vanish at a low resolution.
_SEAM = 0.007


def seams(shape: CarShape, shell: Shell) -> list[Component]:
    """Gaps of the doors, the bonnet and the boot."""
    sill = shape.outer.clearance + 0.10
    lines = [
        _upright(shell, np.full(6, shape.cowl_z - shape.screen_bow - 0.06), sill, bend=0.02),
        _upright(shell, np.full(6, b_pillar_z(shape) - 0.045), sill),
    ]
    end = rear_door_z(shape)
    if not shape.two_door:
        lines.append(_rear_door(shape, shell, end, sill))
        rear = float(lines[-1][-1, 2])
    else:
        rear = b_pillar_z(shape) - 0.045
    z = np.linspace(shape.cowl_z - shape.screen_bow - 0.06, rear, 8)
    lines.append(shell.wall.points(shell.wall.u_at_z(z), np.full(8, sill)))
    parts = [ribbon(line, _outward(shell, line), _SEAM, MATERIAL["seam"]) for line in lines]
    parts += [_bonnet_seam(shape, shell), *_boot_seams(shape, shell), *_bumper_seams(shape, shell)]
    return both_sides(parts)


def _upright(shell: Shell, z: FloatArray, sill: float, bend: float = 0.0) -> FloatArray:
    """A line (N, 3) from the belt line down to the sill."""
    top = float(shell.top_at(z[0])[1])
    fraction = np.linspace(0.0, 1.0, len(z))
    h = top - 0.004 + (sill - top) * fraction
    return shell.wall.points(shell.wall.u_at_z(z + bend * np.sin(np.pi * fraction)), h)


def rear_door_z(shape: CarShape) -> float:
    """z of the rear edge of the rear door at the belt line."""
    return max(last_window_z(shape)[0] + 0.05, shape.outer.rear_axle + 0.05)


def _rear_door(shape: CarShape, shell: Shell, end: float, sill: float) -> FloatArray:
    """The rear door's rear edge: down from the window, then along the wheel arch."""
    top = float(shell.top_at(end)[1])
    h = np.linspace(top - 0.004, sill, 10)
    reach = arch_radius(shape) + 0.06
    level = h - shape.outer.wheel_radius
    arch = shape.outer.rear_axle + np.sqrt(np.maximum(reach**2 - np.maximum(level, 0.0) ** 2, 0.0))
    z = np.where(level < reach, np.maximum(arch, end), end)
    return shell.wall.points(shell.wall.u_at_z(z), h)


def _outward(shell: Shell, line: FloatArray) -> FloatArray:
    return shell.wall.normals(shell.wall.u_at_z(line[:, 2]), -line[:, 1])


def _bonnet_seam(shape: CarShape, shell: Shell) -> Component:
    """The gap between bonnet and wing."""
    line = shell.points[:, shell.top_row + 2]
    normal = _grid_normals(shell.points)[:, shell.top_row + 2]
    z = shell.top_edge[:, 2]
    keep = (z > shape.cowl_z - shape.screen_bow) & (shell.stations > shell.stations[shell.front_corner - 2])
    return ribbon(line[keep][::2], normal[keep][::2], _SEAM, MATERIAL["seam"])


def _boot_seams(shape: CarShape, shell: Shell) -> list[Component]:
    """The right half of the gap around the boot lid or tailgate."""
    wall = shell.wall
    low = 0.64 if shape.notchback else 0.60
    side = float(wall.u_at_x((0.70 if shape.notchback else 0.80) * shape.half_width, rear=True))
    u = np.concatenate([np.full(5, side), np.linspace(side, wall.length, 5)[1:]])
    h = np.concatenate([np.linspace(float(shell.top_at_u(side)) - 0.01, low, 5), np.full(4, low)])
    parts = [ribbon(wall.points(u, h), wall.normals(u, h), _SEAM, MATERIAL["seam"])]
    if shape.notchback:
        line = shell.points[:, shell.top_row + 2]
        keep = (shell.top_edge[:, 2] < shape.deck_z + 0.10) & (shell.stations <= side + 0.02)
        normal = _grid_normals(shell.points)[:, shell.top_row + 2]
        parts.append(ribbon(line[keep], normal[keep], _SEAM, MATERIAL["seam"]))
    return parts


def _bumper_seams(shape: CarShape, shell: Shell) -> list[Component]:
    """Gaps between bumpers and wings, from the wheel arches forward and back along the right side."""
    wall, d, reach = shell.wall, shape.outer, 0.97 * arch_radius(shape)
    parts = []
    for axle, way, corner, h in (
        (d.front_axle, 1.0, shell.front_corner, shape.bumper_height + 0.04),
        (d.rear_axle, -1.0, shell.rear_corner, 0.60),
    ):
        level = min(h - d.wheel_radius, 0.9 * reach)
        start = float(wall.u_at_z(axle + way * np.sqrt(reach**2 - level**2)))
        u = np.linspace(start, float(shell.stations[corner]), 4)
        line = np.full(4, h)
        parts.append(ribbon(wall.points(u, line), wall.normals(u, line), _SEAM, MATERIAL["seam"]))
    return parts


def _grid_normals(points: FloatArray) -> FloatArray:
    along, up = np.gradient(points, axis=0), np.gradient(points, axis=1)
    return unit(cross(up, along))
