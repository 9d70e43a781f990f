"""Small closed bodies about the origin: boxes with rounded edges, ellipsoids, pipes along a path."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.geometry.loft import lathe, tube
from groundpose.lab.bodies.geometry.mesh import Component, unit


def rounded_rectangle(width: float, height: float, radius: float, corner: int = 2) -> FloatArray:
    """Outline (4 (corner + 1), 2) of a rectangle about the origin, from its +x +y corner towards -x."""
    radius = min(radius, 0.5 * width, 0.5 * height)
    angle = np.linspace(0.0, 0.5 * np.pi, corner + 1)
    quarter = np.stack([np.cos(angle), np.sin(angle)], axis=1) * radius
    half = np.array([0.5 * width - radius, 0.5 * height - radius])
    turns = [np.array([[c, s], [-s, c]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    centres = half * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    return np.concatenate([quarter @ turn + centre for turn, centre in zip(turns, centres, strict=True)])


@lru_cache(maxsize=512)  # every body uses the same boxes
def rounded_box(
    width: float, height: float, length: float, radius: float, material: int, corner: int = 2
) -> Component:
    """A box of size x, y, z about the origin with all edges rounded; radius 0 or corner 0 makes it sharp."""
    radius = min(radius, 0.5 * width, 0.5 * height, 0.5 * length)
    if corner == 0 or radius <= 0.0:
        flat = rounded_rectangle(width, height, 0.0, 0)
        ends = np.stack([np.column_stack([flat, np.full(4, z)]) for z in (-0.5 * length, 0.5 * length)])
        return tube(ends, material)
    angle = np.linspace(0.0, 0.5 * np.pi, corner + 1)
    inset = radius * (1.0 - np.sin(angle))
    rise = 0.5 * length - radius * (1.0 - np.cos(angle))
    rings = []
    for shrink, z in [(s, -r) for s, r in zip(inset, rise, strict=True)] + [
        (s, r) for s, r in zip(inset[::-1], rise[::-1], strict=True)
    ]:
        ring = rounded_rectangle(width - 2 * shrink, height - 2 * shrink, max(radius - shrink, 1e-4), corner)
        rings.append(np.column_stack([ring, np.full(len(ring), z)]))
    return tube(np.stack(rings), material, crease_deg=50.0)


@lru_cache(maxsize=512)
def ellipsoid(
    width: float,
    height: float,
    length: float,
    material: int,
    segments: int = 12,
    rings: int = 7,
    power: float = 1.0,
) -> Component:
    """An ellipsoid of size x, y, z; power below 1 makes it boxier (a superellipsoid)."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rings + 2)[1:-1]
    turn = np.arange(segments) * (2.0 * np.pi / segments)
    across = np.abs(np.cos(angle)) ** power
    axial = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** power
    ring = np.stack([_signed(np.cos(turn), power), _signed(np.sin(turn), power)], axis=1)
    points = np.empty((len(angle), segments, 3))
    points[..., :2] = across[:, None, None] * ring
    points[..., 2] = axial[:, None]
    return tube(points * np.array([width, height, length]) * 0.5, material, crease_deg=75.0)


def pipe(
    path: FloatArray, radius: float, material: int, segments: int = 6, closed: bool = False
) -> Component:
    """A round bar along a path (N, 3) with flat ends, or a closed loop."""
    path = np.asarray(path, dtype=np.float64)
    ahead, behind = np.roll(path, -1, axis=0), np.roll(path, 1, axis=0)
    if not closed:
        ahead[-1], behind[0] = path[-1], path[0]
    travel = unit(ahead - behind)
    helper = np.eye(3)[np.argmin(np.abs(travel).max(axis=0))]
    u = unit(np.cross(travel, helper))
    v = np.cross(travel, u)
    angle = np.arange(segments) * (2.0 * np.pi / segments)
    circle = u[:, None] * np.cos(angle)[:, None] + v[:, None] * np.sin(angle)[:, None]
    return tube(path[:, None] + radius * circle, material, crease_deg=60.0, closed=closed)


def disc(radius: float, thickness: float, material: int, segments: int = 16) -> Component:
    """A flat cylinder about the x axis."""
    half = 0.5 * thickness
    return lathe(np.array([[-half, radius], [half, radius]]), segments, material)


def _signed(values: FloatArray, power: float) -> FloatArray:
    return np.asarray(np.sign(values) * np.abs(values) ** power)
