"""Fittings common to vans, buses, pickups and trucks; places are points of the object frame (y down)."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.geometry.mesh import Component
from groundpose.lab.bodies.geometry.primitives import pipe, rounded_box
from groundpose.lab.bodies.parts import cabin
from groundpose.lab.bodies.parts.materials import MATERIAL
from groundpose.lab.bodies.parts.wheels import Rim, place_wheels, wheel

PLATE_RISE = 0.012
"""Distance of a number plate's face from the body, metres."""


def moved(point: FloatArray, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> FloatArray:
    """The point (3,) shifted."""
    return np.asarray(point + np.array([x, y, z]))


def block(
    width: float, height: float, length: float, material: str, at: FloatArray | tuple[float, float, float]
) -> Component:
    """A sharp box; `at` is its middle."""
    x, y, z = at
    return rounded_box(width, height, length, 0.0, MATERIAL[material], 0).moved(x, y, z)


def padded(
    size: FloatArray | tuple[float, float, float],
    radius: float,
    material: str,
    at: FloatArray | tuple[float, float, float],
) -> Component:
    """A box with rounded edges; `at` is its middle."""
    x, y, z = at
    return rounded_box(size[0], size[1], size[2], radius, MATERIAL[material], 1).moved(x, y, z)


def bar(path: list[FloatArray] | FloatArray, radius: float, material: str, segments: int = 5) -> Component:
    """A round bar along points."""
    return pipe(np.asarray(path), radius, MATERIAL[material], segments)


def number_plate(point: FloatArray) -> Component:
    """A plate at a point of the front or rear; `plate_middle` is the middle of its face."""
    return block(0.52, 0.115, 2 * PLATE_RISE, "plate", point)


def plate_middle(point: FloatArray, facing: float) -> FloatArray:
    """Middle (3,) of the face of `number_plate` on the front (`facing` 1) or rear (-1)."""
    return moved(point, z=facing * PLATE_RISE)


def badge(point: FloatArray, facing: float) -> Component:
    """The maker's badge."""
    return padded((0.14, 0.09, 0.03), 0.012, "chrome", moved(point, z=0.002 * facing))


def wheel_set(
    centres: FloatArray, width: float, rims: tuple[Rim, Rim], bead: float, cap: str, twin: bool = False
) -> list[Component]:
    """Four wheels at centres (4, 4), front ones first; `twin` adds inner tyres at the rear."""
    radius = float(centres[0, 3])
    front, rear = (
        wheel(radius, width, bead * radius, rim, turn, cap)
        for rim, turn in zip(rims, (0.3, 0.7), strict=True)
    )
    parts = [*place_wheels(centres[:2], front), *place_wheels(centres[2:], rear)]
    if twin:
        inner = centres[2:] - np.sign(centres[2:, :1]) * [width + 0.04, 0.0, 0.0, 0.0]
        parts += place_wheels(inner, rear[:1])
    return parts


def axles(centres: FloatArray, radius: float) -> list[Component]:
    """Bars between the wheels (4, 4)."""
    return [bar(centres[[row, row + 1], :3] * [0.9, 1.0, 1.0], radius, "underbody", 6) for row in (0, 2)]


def side_mirror(
    centre: FloatArray,
    size: FloatArray,
    arms: list[list[FloatArray]],
    housing: str = "plastic",
    thick: float = 0.022,
) -> list[Component]:
    """A right mirror looking back, with arms along the given paths; its housing ends at centre + size / 2."""
    glass = (float(size[0]) - 0.045, float(size[1]) - 0.05, 0.012)
    return [
        padded(size, 0.4 * float(size[2]), housing, centre),
        padded(glass, 0.003, "mirror", moved(centre, z=-0.5 * float(size[2]))),
        *[bar(path, thick, "plastic") for path in arms],
    ]


def driving_place(x: float, cushion: float, z: float, screen: FloatArray, driver: bool) -> list[Component]:
    """Seat, steering wheel and, at random, a driver.

    `cushion` is the height of the seat, `screen` a point at the foot of the windscreen.
    """
    reach = min(0.52, float(screen[2]) - z - 0.12)
    parts = [part.moved(x, -cushion, z) for part in cabin.seat(0.5, 0.6)]
    parts += [part.moved(x, -cushion - 0.3, z + reach) for part in cabin.steering_wheel(0.2)]
    if driver:
        parts += [part.moved(x, -cushion, z + 0.05) for part in cabin.driver()]
    return parts
