"""Thin closed plates that follow a curved surface: lamps, grilles, plates, mouldings, seams, bumpers."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.geometry.loft import cells, grid_faces, tube
from groundpose.lab.bodies.geometry.mesh import Component, component, cross, unit


class Surface(Protocol):
    """Points and outward normals at (u, h): u from front to rear on the right side, h upward."""

    def points(self, u: object, h: object) -> FloatArray:
        """Points (..., 3)."""

    def normals(self, u: object, h: object) -> FloatArray:
        """Unit normals (..., 3)."""


def slab(
    surface: Surface,
    u: object,
    low: object,
    high: object,
    material: object,
    thickness: float = 0.004,
    rows: int = 3,
    bevel: float = 0.006,
    sink: float = 0.004,
    crease_deg: float = 38.0,
) -> Component:
    """A plate on the surface between two lines `low(u)` and `high(u)`.

    Args:
        u: (N,) increasing positions along the surface.
        low, high: heights of the lower and upper edge at each u, numbers or (N,).
        material: index, or (N + 1, rows + 1) indices of the cells, bevels included.
        thickness: of the plate above the surface, metres.
        rows: points across between the bevels, 2 or more.
        bevel: width of the sloping border; its outer edge lies `sink` below the surface.
    """
    u = np.asarray(u, dtype=np.float64)
    low, high = (np.broadcast_to(np.asarray(edge, dtype=np.float64), u.shape) for edge in (low, high))
    inner = min(bevel, 0.3 * float(u[-1] - u[0]))
    along_u = np.concatenate([u[:1], [u[0] + inner], u[1:-1], [u[-1] - inner], u[-1:]])
    bottom, top = np.interp(along_u, u, low), np.interp(along_u, u, high)
    border = np.minimum(bevel, 0.3 * (top - bottom))[:, None]
    across = (
        np.linspace(0.0, 1.0, rows) * (top - bottom - 2 * border[:, 0])[:, None] + bottom[:, None] + border
    )
    h = np.concatenate([bottom[:, None], across, top[:, None]], axis=1)
    offset = np.full(h.shape, -sink)
    offset[1:-1, 1:-1] = thickness
    return plate(surface, along_u, h, offset, material, crease_deg)


def plate(
    surface: Surface,
    u: FloatArray,
    h: FloatArray,
    offset: FloatArray,
    material: object,
    crease_deg: float = 38.0,
    depth: float = 0.03,
) -> Component:
    """A closed plate from a grid on the surface: `u` (N,) or (N, M), `h` and `offset` (N, M), metres.

    The back is a fan of triangles from the border to a point `depth` behind the middle of the border.
    """
    u = np.broadcast_to(u[:, None] if u.ndim == 1 else u, h.shape)
    normals = surface.normals(u, h)
    grid = surface.points(u, h) + offset[..., None] * normals
    n, m = h.shape
    index = np.arange(n * m).reshape(n, m)
    border = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    rim = grid.reshape(-1, 3)[border]
    behind = rim.mean(axis=0) - depth * normals.reshape(-1, 3)[border].mean(axis=0)
    fan = np.stack([border, np.roll(border, -1), np.full(len(border), n * m)], axis=1)
    front = grid_faces(n, m)[:, ::-1]
    paint = cells(material, n, m)
    return component(
        np.concatenate([grid.reshape(-1, 3), behind[None]]),
        np.concatenate([front, fan]),
        np.concatenate([paint, np.full(len(fan), paint[0], dtype=np.uint8)]),
        crease_deg,
    )


def ribbon(
    points: FloatArray,
    normals: FloatArray,
    width: float,
    material: int,
    rise: float = 0.0045,
    sink: float = 0.004,
) -> Component:
    """A thin ridge along a line on a surface (a seam, a moulding, a wiper).

    Args:
        points: (N, 3) on the surface; normals: (N, 3) of the surface there.
        width, rise, sink: of the ridge across, above and below the surface, metres.
    """
    points, normals = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
    side = 0.5 * width * unit(cross(np.gradient(points, axis=0), normals))
    low = points - sink * normals
    return tube(np.stack([low - side, points + rise * normals, low + side], axis=1), material, 75.0)
