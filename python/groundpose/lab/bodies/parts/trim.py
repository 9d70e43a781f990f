"""Small outer parts: mirrors, handles, reflectors, plates, rails, antennas, exhausts."""

from __future__ import annotations

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.geometry.mesh import Component
from groundpose.lab.bodies.geometry.primitives import ellipsoid, pipe, rounded_box
from groundpose.lab.bodies.geometry.slab import Surface, slab
from groundpose.lab.bodies.parts.materials import MATERIAL


def mirror(
    width: float, height: float, depth: float, housing: str = "paint", arm: float = 0.05
) -> list[Component]:
    """The right side mirror; its arm starts at the origin and points to +x, the glass looks to -z.

    The housing is first in the list; its outermost point is at x = arm + width.
    """
    shell = ellipsoid(width, height, depth, MATERIAL[housing], segments=12, rings=5, power=0.62)
    shell = shell.turned("y", -0.12).moved(arm + 0.5 * width, -0.6 * height, 0.0)
    glass = rounded_box(0.84 * width, 0.74 * height, 0.012, 0.006, MATERIAL["mirror"], corner=1)
    glass = glass.turned("y", -0.12).moved(arm + 0.5 * width, -0.6 * height, -0.5 * depth + 0.004)
    foot = rounded_box(arm + 0.45 * width, 0.035, 0.6 * depth, 0.012, MATERIAL["plastic"], corner=1)
    foot = foot.moved(0.5 * (arm + 0.45 * width) - 0.03, -0.16 * height, 0.0)
    return [shell, glass, foot]


def handle(material: str = "paint", length: float = 0.19) -> Component:
    """A door's handle about the origin, along z, standing out 3 cm to +x."""
    return rounded_box(0.05, 0.032, length, 0.015, MATERIAL[material], corner=1).moved(0.006)


def plate(
    surface: Surface,
    middle: float,
    height: float,
    width: float = 0.52,
    tall: float = 0.11,
    rise: float = 0.012,
) -> Component:
    """A number plate on a wall about (u, h); vertex 17 is the middle of its face (see `plate_middle`)."""
    u = middle + 0.5 * width * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    return slab(
        surface, u, height - 0.5 * tall, height + 0.5 * tall, MATERIAL["plate"], rise, bevel=0.004, sink=0.02
    )


def plate_middle(surface: Surface, middle: float, height: float, rise: float = 0.012) -> FloatArray:
    """Middle (3,) of the face of `plate` with the same arguments."""
    return np.asarray(surface.points(middle, height) + rise * surface.normals(middle, height))


def round_patch(
    surface: Surface, u: float, h: float, radius: float, material: str, rise: float, stretch: float = 1.0
) -> Component:
    """A round (or stretched) disc on a wall: a reflector, a fog lamp, a badge."""
    angle = np.linspace(np.pi, 0.0, 7)
    across, half = np.cos(angle) * radius * stretch, np.sin(angle) * radius
    half = np.maximum(half, 0.12 * radius)
    return slab(
        surface, u + across, h - half, h + half, MATERIAL[material], rise, rows=2, bevel=0.25 * radius
    )


def roof_rail(path: FloatArray, material: str = "chrome") -> list[Component]:
    """A bar over a line (N, 3) on the roof with two feet."""
    lifted = path + np.array([0.0, -0.045, 0.0])
    lifted[[0, -1]] = path[[0, -1]]
    return [pipe(lifted, 0.014, MATERIAL[material], segments=5).spared()]


def antenna(point: FloatArray, fin: bool) -> Component:
    """A rod or a fin on the roof at (3,)."""
    if fin:
        return ellipsoid(0.03, 0.08, 0.17, MATERIAL["paint"], 8, 5).moved(*point.tolist())
    path = point + np.array([[0.0, 0.01, 0.0], [0.0, -0.12, -0.07], [0.0, -0.26, -0.16]])
    return pipe(path, 0.004, MATERIAL["plastic"], segments=4)


def exhaust(point: FloatArray, radius: float = 0.025) -> Component:
    """A tail pipe ending at (3,), along z."""
    return pipe(point + np.array([[0.0, 0.0, 0.25], [0.0, 0.0, 0.0]]), radius, MATERIAL["metal"], segments=8)
