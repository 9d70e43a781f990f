"""Faces of a car: grilles, bumpers, number plates and rear trim."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.car.lamps import tail_lamp
from groundpose.lab.bodies.car.look import Face
from groundpose.lab.bodies.car.shape import CarShape
from groundpose.lab.bodies.car.shell import Shell
from groundpose.lab.bodies.geometry.mesh import Component, both_sides
from groundpose.lab.bodies.geometry.slab import slab
from groundpose.lab.bodies.parts.materials import MATERIAL
from groundpose.lab.bodies.parts.trim import plate, plate_middle, round_patch

# Widths of the grilles as fractions of the room between the headlamps.
_GRILLES = (1.0, 0.72, 0.42, 0.95)
_UPRIGHT = 2  # this one reaches down to the bumper


def front_face(shape: CarShape, shell: Shell, face: Face) -> list[Component]:
    """Grilles, fog lamps and badge of the front."""
    return [*_grille(shape, shell, face), *_intake(shape, shell, face)]


def _grille(shape: CarShape, shell: Shell, face: Face) -> list[Component]:
    """The grille between the headlamps, its frame and slats, and the badge."""
    wall = shell.wall
    inner = face.lamp_inner * shape.half_width - 0.04
    u = _across(wall.u_at_x(inner * _GRILLES[face.grille]), 7)
    drop = 0.02 * np.abs(u / u[-1]) ** 2
    high = shape.bonnet_height - 0.075 - drop
    low = high - face.grille_height - 0.10 * (face.grille == _UPRIGHT)
    slats = np.full((len(u) + 1, 7), MATERIAL["grille"], dtype=np.uint8)
    if face.chrome or face.grille == 0:
        slats[1:-1, [2, 4]] = MATERIAL["chrome" if face.chrome else "plastic"]
    frame = slab(wall, 1.03 * u, low - 0.012, high + 0.012, MATERIAL["chrome"], 0.004)
    middle = len(u) // 2
    return [
        *([frame] if face.chrome else []),
        slab(wall, u, low, high, slats, 0.007, rows=6),
        round_patch(wall, 0.0, float(0.5 * (low + high)[middle]), 0.045, "chrome", 0.018),
    ]


def _intake(shape: CarShape, shell: Shell, face: Face) -> list[Component]:
    """The opening under the bumper and the fog lamps beside it."""
    wall, w = shell.wall, shape.half_width
    u = _across(wall.u_at_x(w * (0.40 + 0.25 * shape.age)), 7)
    low, high = shape.outer.clearance + 0.055, shape.bumper_height - 0.13
    taper = np.linspace(-1.0, 1.0, 7) ** 4 * 0.35 * (high - low)
    opening = slab(wall, u, low, high - taper, MATERIAL["grille"], 0.012)
    if not face.fog:
        return [opening]
    place, level = float(wall.u_at_x(0.78 * w)), 0.5 * (low + high)
    housing = round_patch(wall, place, level, 0.062, "plastic", 0.010, 1.4)
    lamp = round_patch(wall, place, level, 0.042, "headlamp", 0.014)
    return [opening, *both_sides([housing, lamp])]


def rear_face(shape: CarShape, shell: Shell, face: Face) -> list[Component]:
    """Trim of the rear."""
    wall, w = shell.wall, shape.half_width
    bottom = shape.outer.clearance + 0.09
    parts: list[Component] = []
    u = wall.length + _across(wall.length - wall.u_at_x(0.62 * w, rear=True), 7)
    if shape.age > 0.5 and face.bumper_paint == "paint":
        parts.append(slab(wall, u, bottom + 0.01, bottom + 0.12, MATERIAL["plastic"], 0.007))
    lamp = tail_lamp(shape, shell, face)
    if face.tail_band:
        u = wall.length + _across(wall.length - float(lamp.u[0]), 9)
        tall = 0.05 if face.tail_band != "plastic" else 0.7 * float(lamp.high[0] - lamp.low[0])
        top = float(lamp.high[0]) - 0.02
        parts.append(
            slab(wall, u, top - tall, top, MATERIAL[face.tail_band], 0.007, rows=5 if tall > 0.06 else 2)
        )
    middle, height = wall.length, _rear_plate_height(shape, face)
    panel = middle + _across(0.5 * face.plate_width + 0.05, 5)
    parts.append(
        slab(wall, panel, height - 0.085, height + 0.085, MATERIAL["plastic"], 0.004 + _rear_rise(face))
    )
    badge = height + 0.16
    if badge < shape.tail_height - 0.06:
        parts.append(round_patch(wall, middle, badge, 0.04, "chrome", 0.010))
    return parts


def ends(shape: CarShape, shell: Shell, face: Face) -> list[Component]:
    """Bumpers and number plates, the outermost parts at the front and the rear."""
    wall = shell.wall
    front, rear = _plate_height(shape), _rear_plate_height(shape, face)
    return [
        *_bumper(shape, shell, face, front=True),
        *_bumper(shape, shell, face, front=False),
        plate(wall, 0.0, front, face.plate_width, rise=0.014 + face.bumper),
        plate(wall, wall.length, rear, face.plate_width, rise=0.012 + _rear_rise(face)),
    ]


def plate_points(shape: CarShape, shell: Shell, face: Face) -> tuple[FloatArray, FloatArray]:
    """Middles (3,) of the front and rear plate."""
    wall = shell.wall
    return (
        plate_middle(wall, 0.0, _plate_height(shape), 0.014 + face.bumper),
        plate_middle(wall, wall.length, _rear_plate_height(shape, face), 0.012 + _rear_rise(face)),
    )


def _plate_height(shape: CarShape) -> float:
    return shape.bumper_height - 0.06


def _rear_plate_height(shape: CarShape, face: Face) -> float:
    if not face.plate_high:
        return 0.52
    return shape.tail_height - 0.20 if shape.notchback else 0.5 * (shape.tail_height + 0.66)


def _rear_rise(face: Face) -> float:
    return 0.0 if face.plate_high else face.bumper


def _bumper(shape: CarShape, shell: Shell, face: Face, front: bool) -> list[Component]:
    """A separate bumper, a black lower half, or nothing."""
    wall, d = shell.wall, shape.outer
    gap = d.wheel_radius + shape.arch_gap + 0.03
    if front:
        u = _across(wall.u_at_z(d.front_axle + gap), 19)
        top = shape.bumper_height + 0.02
        low = d.clearance + 0.02
    else:
        u = wall.length + _across(wall.length - wall.u_at_z(d.rear_axle - gap), 19)
        top, low = 0.60, d.clearance + 0.10
    material = MATERIAL[face.bumper_paint]
    if face.bumper > 0.0:
        return [slab(wall, u, top - 0.20, top, material, face.bumper, rows=3, bevel=0.022)]
    if face.bumper_paint != "paint":
        return [slab(wall, u, low, low + 0.15, material, 0.008, rows=4)]
    return []


def _across(reach: object, count: int) -> FloatArray:
    """Positions symmetric about the middle plane."""
    return np.linspace(-1.0, 1.0, count) * float(np.asarray(reach))
