"""Parts of the things beside roads: boxes, bars, balls, textured cards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from groundpose.lab.drive.render.textures import layer

Floats = NDArray[np.float32]
Colour = tuple[float, float, float]
WHITE: Colour = (1.0, 1.0, 1.0)

# Columns of a vertex: position 3, normal 3, picture coordinates 2, layer, tile, colour 3, fraction of tint.
# tile: metres a picture covers when laid on by position; 0: by its coordinates; -1: the vertex shines.
COLUMNS = 14


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices (V, COLUMNS) and faces (F, 3), seen from both sides. The first `solid` faces are large and
    whole; the others are small or have pictures with holes."""

    vertices: Floats
    faces: NDArray[np.int32]
    solid: int


@dataclass(frozen=True)
class Surface:
    """How a piece of a mesh looks."""

    layer: str = "plain"
    tile: float = 0.0
    colour: Colour = WHITE
    tint: float = 1.0


def _mesh(position: ArrayLike, normal: ArrayLike, uv: ArrayLike, faces: ArrayLike, surface: Surface) -> Mesh:
    p = np.asarray(position, dtype=np.float32)
    out = np.empty((len(p), COLUMNS), dtype=np.float32)
    out[:, :3], out[:, 3:6], out[:, 6:8] = p, np.asarray(normal), np.asarray(uv)
    out[:, 8], out[:, 9], out[:, 10:13] = layer(surface.layer), surface.tile, surface.colour
    out[:, 13] = surface.tint
    made = np.asarray(faces, dtype=np.int32)
    return Mesh(out, made, len(made) if surface.tile > 0.0 else 0)


def join(pieces: Sequence[Mesh]) -> Mesh:
    """One mesh of many."""
    offsets = np.cumsum([0] + [len(p.vertices) for p in pieces[:-1]])
    placed = list(zip(pieces, offsets, strict=True))
    faces = [p.faces[: p.solid] + o for p, o in placed] + [p.faces[p.solid :] + o for p, o in placed]
    vertices = np.concatenate([p.vertices for p in pieces])
    return Mesh(vertices, np.concatenate(faces).astype(np.int32), sum(p.solid for p in pieces))


def box(low: Colour, high: Colour, surface: Surface, top: Surface | None = None) -> Mesh:
    """An upright box without a bottom; low and high corner, y down."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    sides = [
        ([(x0, y1, z0), (x1, y1, z0), (x1, y0, z0), (x0, y0, z0)], (0, 0, -1)),
        ([(x1, y1, z1), (x0, y1, z1), (x0, y0, z1), (x1, y0, z1)], (0, 0, 1)),
        ([(x0, y1, z1), (x0, y1, z0), (x0, y0, z0), (x0, y0, z1)], (-1, 0, 0)),
        ([(x1, y1, z0), (x1, y1, z1), (x1, y0, z1), (x1, y0, z0)], (1, 0, 0)),
        ([(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)], (0, -1, 0)),
    ]
    looks = [surface] * 4 + [top or surface]
    return join([quad(corners, n, s) for (corners, n), s in zip(sides, looks, strict=True)])


def with_holes(mesh: Mesh) -> Mesh:
    """The mesh with the holes of its pictures."""
    return replace(mesh, solid=0)


def quad(corners: ArrayLike, normal: ArrayLike, surface: Surface) -> Mesh:
    """Four corners: lower left, lower right, upper right, upper left of the picture."""
    uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0)])
    return _mesh(
        corners, np.tile(np.asarray(normal, dtype=float), (4, 1)), uv, [(0, 1, 2), (0, 2, 3)], surface
    )


def tube(a: Colour, b: Colour, radius: tuple[float, float], surface: Surface, sides: int = 6) -> Mesh:
    """A round bar from a to b."""
    start, end = np.array(a), np.array(b)
    along = (end - start) / np.linalg.norm(end - start)
    side = np.cross(along, [0.31, 0.22, 0.92])
    side /= np.linalg.norm(side)
    angle = np.linspace(0.0, 2 * np.pi, sides + 1)[:, None]
    out = np.cos(angle) * side + np.sin(angle) * np.cross(along, side)
    ring = np.concatenate([start + radius[0] * out, end + radius[1] * out])
    u = np.tile(angle[:, 0] / np.pi, 2)
    v = np.repeat([1.0, 0.0], sides + 1) * np.linalg.norm(end - start) * 4.0
    i = np.arange(sides)
    faces = np.concatenate(
        [np.stack([i, i + 1, i + sides + 2], 1), np.stack([i, i + sides + 2, i + sides + 1], 1)]
    )
    return _mesh(ring, np.tile(out, (2, 1)), np.stack([u, v], 1), faces, surface)


def ball(
    centre: Colour, radius: Colour, surface: Surface, rng: np.random.Generator | None = None, n: int = 8
) -> Mesh:
    """An ellipsoid, lumpy when a generator is given; darker below."""
    polar, azimuth = np.meshgrid(np.linspace(0, np.pi, n), np.linspace(0, 2 * np.pi, n + 3), indexing="ij")
    out = np.stack([np.sin(polar) * np.cos(azimuth), -np.cos(polar), np.sin(polar) * np.sin(azimuth)], -1)
    lump = np.ones(out.shape[:2])
    if rng is not None:
        lump += 0.12 * rng.normal(size=lump.shape)
        lump[:, -1] = lump[:, 0]
    points = np.array(centre) + out * np.array(radius) * lump[..., None]
    m = n + 3
    i = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + m], 1), np.stack([i + 1, i + m + 1, i + m], 1)])
    uv = np.stack([azimuth, polar], -1) / np.pi
    return _mesh(points.reshape(-1, 3), out.reshape(-1, 3), uv.reshape(-1, 2), faces, surface)


def cards(
    centres: NDArray[np.float64], outward: NDArray[np.float64], size: NDArray[np.float64],
    shade: NDArray[np.float64], name: str, rng: np.random.Generator,
) -> Mesh:  # fmt: skip
    """Square pictures of twigs in random attitudes, lit as if they were the surface of a crown."""
    n = len(centres)
    a = rng.normal(size=(n, 3))
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(a, rng.normal(size=(n, 3)))
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    points = centres[:, None] + 0.5 * size[:, None, None] * (
        corners[None, :, :1] * a[:, None] + corners[None, :, 1:] * b[:, None]
    )
    first = 4 * np.arange(n)[:, None]
    faces = np.concatenate([first + corner for corner in np.array([(0, 1, 2), (0, 2, 3)])])
    mesh = _mesh(
        points.reshape(-1, 3), np.repeat(outward, 4, axis=0), np.tile((corners + 1) / 2, (n, 1)), faces,
        Surface(name),
    )  # fmt: skip
    mesh.vertices[:, 10:13] = np.repeat(shade, 4)[:, None]
    return mesh
