"""Closed components and their assembly into one mesh with shading normals.

Faces are counter-clockwise seen from outside. Points of a component within about 0.1 mm are merged (mirror
seams, closed rings, collapsed rows).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray

IntArray = NDArray[np.int32]
ByteArray = NDArray[np.uint8]

# Positions of a component that round to the same multiple of this are one point, metres.
GRAIN = 1e-4

# Edges sharper than this are creases unless a component says otherwise.
CREASE_DEG = 38.0

# Bits of one coordinate in a packed position: +-13.1 m in steps of GRAIN; 9 bits are left for the component.
_BITS = 18


@dataclass(frozen=True, eq=False)
class Component:
    """One closed surface.

    Args:
        vertices: (V, 3) metres; equal positions may occur several times.
        faces: (F, 3) indices, outward; triangles of no area are dropped by `assemble`.
        materials: (F,) index of each face's material.
        crease: radians; an edge whose faces turn by more than this is shaded sharp.
        spare: a body with too many triangles goes without it.
    """

    vertices: FloatArray
    faces: IntArray
    materials: ByteArray
    crease: float = float(np.deg2rad(CREASE_DEG))
    spare: bool = False

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Component:
        """The component shifted by metres."""
        return replace(self, vertices=self.vertices + np.array([x, y, z]))

    def turned(self, axis: str, angle: float) -> Component:
        """The component turned about the axis "x", "y" or "z" through the origin by radians, right-handed."""
        return self.transformed(rotation(axis, angle))

    def scaled(self, x: float, y: float, z: float) -> Component:
        """The component stretched along its axes; negative factors mirror it."""
        return self.transformed(np.diag([x, y, z]))

    def mirrored(self) -> Component:
        """The component mirrored in the plane x = 0."""
        return self.scaled(-1.0, 1.0, 1.0)

    def transformed(self, matrix: FloatArray) -> Component:
        """Every vertex multiplied by a (3, 3) matrix; a mirroring matrix also reverses the faces."""
        faces = self.faces if np.linalg.det(matrix) > 0.0 else self.faces[:, ::-1]
        return replace(self, vertices=self.vertices @ np.asarray(matrix).T, faces=faces)

    def painted(self, material: int) -> Component:
        """The component with one material for all faces."""
        return replace(self, materials=np.full(len(self.faces), material, dtype=np.uint8))

    def spared(self) -> Component:
        """The component, left out where the body would have too many triangles."""
        return replace(self, spare=True)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Components put together: `vertices` (V, 3) and `normals` (V, 3) (doubled at creases), `faces` (F, 3)
    int32, `materials` (F,) uint8, `parts` (F,) uint16 index of the component."""

    vertices: FloatArray
    normals: FloatArray
    faces: IntArray
    materials: ByteArray
    parts: NDArray[np.uint16]


def component(
    vertices: FloatArray, faces: object, material: object, crease_deg: float = CREASE_DEG
) -> Component:
    """A component from arrays; `material` is one index or one per face."""
    triangles: IntArray = np.asarray(faces, dtype=np.int32).reshape(-1, 3)
    paint = np.broadcast_to(np.asarray(material, dtype=np.uint8), len(triangles)).copy()
    return Component(np.asarray(vertices, dtype=np.float64), triangles, paint, float(np.deg2rad(crease_deg)))


def rotation(axis: str, angle: float) -> FloatArray:
    """Rotation matrix (3, 3) about "x", "y" or "z" by radians, right-handed."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    matrix = np.eye(3)
    matrix[j, j] = matrix[k, k] = np.cos(angle)
    matrix[k, j] = np.sin(angle)
    matrix[j, k] = -np.sin(angle)
    return matrix


def both_sides(parts: Iterable[Component]) -> list[Component]:
    """Each component and its mirror image on the left."""
    return [side for part in parts for side in (part, part.mirrored())]


def assemble(components: Sequence[Component]) -> Mesh:
    """One mesh of all components: equal positions of each merged, empty triangles dropped, with normals."""
    counts = [len(c.faces) for c in components]
    starts = np.concatenate([[0], np.cumsum([len(c.vertices) for c in components])])
    owner = np.repeat(np.arange(len(components)), np.diff(starts))
    vertices = np.concatenate([c.vertices for c in components])
    faces = np.concatenate([c.faces + start for c, start in zip(components, starts[:-1], strict=True)])
    materials = np.concatenate([c.materials for c in components])
    parts = np.repeat(np.arange(len(components)), counts)
    vertices, faces = _welded(vertices, faces, owner)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    faces, materials, parts = faces[whole], materials[whole], parts[whole]
    limits = np.cos([c.crease for c in components])[parts]
    vertices, normals, faces = _shaded(vertices, faces, limits)
    return Mesh(vertices, normals, faces.astype(np.int32), materials, parts.astype(np.uint16))


def _welded(vertices: FloatArray, faces: IntArray, owner: NDArray[np.int64]) -> tuple[FloatArray, IntArray]:
    """Equal positions of one component become one vertex."""
    grains = np.round(vertices / GRAIN).astype(np.int64) + (1 << (_BITS - 1))
    packed = (((owner << _BITS | grains[:, 0]) << _BITS | grains[:, 1]) << _BITS) | grains[:, 2]
    _, first, index = np.unique(packed, return_index=True, return_inverse=True)
    return vertices[first], index[faces]


def face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Unit outward normals (F, 3); zero for triangles without area."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    return unit(cross(b - a, c - a))


def _shaded(
    vertices: FloatArray, faces: IntArray, limits: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Vertices, normals and faces, with one vertex per different shading normal.

    The normal of a face's corner is the mean of the faces around the vertex, weighed by their angle there,
    over those that turn away from the face by less than the crease angle (its cosine in `limits`, one per
    face).
    """
    flat = face_normals(vertices, faces)
    owner, face = faces.ravel(), np.repeat(np.arange(len(faces)), 3)
    weighted = flat[face] * _corner_angles(vertices, faces).reshape(-1, 1)
    count = len(vertices)
    mean = unit(np.stack([np.bincount(owner, weighted[:, i], count) for i in range(3)], axis=1))
    # Faces within half the limit of the mean are within the limit of each other.
    away = np.einsum("ij,ij->i", flat[face], mean[owner]) < np.sqrt(0.5 * (1.0 + limits))[face]
    rough = np.zeros(count, dtype=bool)
    rough[owner[away]] = True
    creased = np.flatnonzero(rough[owner])
    normals = _creased(owner[creased], flat[face[creased]], weighted[creased], limits[face[creased]])
    grains = np.round(normals * 500.0).astype(np.int64) + 512
    packed = ((owner[creased].astype(np.int64) << 10 | grains[:, 0]) << 10 | grains[:, 1]) << 10 | grains[
        :, 2
    ]
    _, first, index = np.unique(packed, return_index=True, return_inverse=True)
    smooth = np.flatnonzero(~rough)
    place = np.empty(count, dtype=np.int64)
    place[smooth] = np.arange(len(smooth))
    corner = place[owner]
    corner[creased] = len(smooth) + index
    return (
        np.concatenate([vertices[smooth], vertices[owner[creased[first]]]]),
        np.concatenate([mean[smooth], normals[first]]),
        corner.reshape(-1, 3),
    )


def _creased(owner: IntArray, flat: FloatArray, weighted: FloatArray, limits: FloatArray) -> FloatArray:
    """Normals (C, 3) of corners at vertices `owner`: sums over the corners there that turn little enough."""
    order = np.argsort(owner, kind="stable")
    flat, weighted, limits = flat[order], weighted[order], limits[order]
    _, start, length = np.unique(owner[order], return_index=True, return_counts=True)
    first, valence = np.repeat(start, length), np.repeat(length, length)
    place = np.arange(len(order)) - first
    total = weighted.copy()
    live = np.arange(len(order))
    for step in range(1, int(length.max(initial=1))):
        live = live[valence[live] > step]
        other = first[live] + (place[live] + step) % valence[live]
        close = np.einsum("ij,ij->i", flat[live], flat[other]) > limits[live]
        total[live[close]] += weighted[other[close]]
    normals = np.empty_like(total)
    normals[order] = unit(total)
    return np.asarray(normals)


def _corner_angles(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Angle (F, 3) of each corner, radians."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    ab, bc, ca = unit(b - a), unit(c - b), unit(a - c)
    cosine = -np.stack([np.einsum("ij,ij->i", u, v) for u, v in ((ca, ab), (ab, bc), (bc, ca))], axis=1)
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors of length 1 along the last axis; zero stays zero."""
    length = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product along the last axis (several times as fast as numpy's own)."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)
