"""The solids of a scene for the labels: bodies and things beside the road, each cut into slabs once."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lab.bodies import MATERIALS, Body
from groundpose.lab.bodies.geometry.mesh import cross
from groundpose.lab.drive import props
from groundpose.lab.drive.body_cache import Measures, body, measures, of_body
from groundpose.lab.drive.cache import Arrays
from groundpose.lab.drive.scene import Prop
from groundpose.lab.drive.silhouette import slabs
from groundpose.shape import extent

_BODY_SLABS = 16
# Parts with less surface than this (m^2) do not count for outlines: mirrors, antennas, lamps.
_SMALL_PART = 0.3
# Things with a stem are cut across their height; the others are nearly convex as a whole.
_PROP_SLABS = {"tree": 8, "bush": 3, "sign": 10, "traffic_light": 6, "pole": 8, "person": 8, "cyclist": 6}

# Parts behind glass hide nothing that the glass does not hide already.
_BEHIND_GLASS = ("interior", "seat", "skin", "clothes")


@dataclass(frozen=True, eq=False)
class Solid:
    """A body with the values that labels use repeatedly.

    Args:
        body: the measures of the body.
        slabs: (K, M, 3) for `silhouette.outline`.
        corners: (8, 3) of the box around the mesh, mirrors included.
        vertices: (V, 3), those of the body without duplicates.
        faces: (F, 3) rows of `vertices`, without those behind glass.
        normals: (F, 3) outward, of any length; offsets: (F,) `normal . x` on the face.
    """

    body: Measures
    slabs: FloatArray
    corners: FloatArray
    vertices: FloatArray
    faces: NDArray[np.intp]
    normals: FloatArray
    offsets: FloatArray

    def facing(self, eye: FloatArray) -> NDArray[np.intp]:
        """The faces (F, 3) turned to a point (3,) of the object frame."""
        return np.compress(self.normals @ eye > self.offsets, self.faces, axis=0)


@lru_cache(maxsize=300)
def solid(class_name: str, seed: int) -> Solid:
    """The body `body(class_name, seed)`, prepared; 0.9 MB each."""
    keys = frozenset(("vertices", "faces", "slabs"))
    kept = of_body("solid", class_name, seed, keys, lambda: _parts_of(body(class_name, seed)))
    vertices, faces = kept["vertices"], kept["faces"].astype(np.intp)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = cross(b - a, c - a)
    return Solid(
        body=measures(class_name, seed),
        slabs=kept["slabs"],
        corners=np.array(list(itertools.product(*extent(vertices).T))),
        vertices=vertices,
        faces=faces,
        normals=normals,
        offsets=np.sum(normals * a, axis=1),
    )


def _parts_of(made: Body) -> Arrays:
    """Vertices without duplicates, the faces that are not behind glass, and the slabs."""
    positions = np.ascontiguousarray(made.vertices).view([("", made.vertices.dtype)] * 3).ravel()
    _, first, row = np.unique(positions, return_index=True, return_inverse=True)
    vertices = made.vertices[first]
    inner = [MATERIALS.index(name) for name in _BEHIND_GLASS]
    faces = row[made.faces[~np.isin(made.materials, inner)]]
    cut = slabs(made.vertices, _large(made), 2, _BODY_SLABS)
    return {"vertices": vertices, "faces": faces.astype(np.min_scalar_type(len(vertices))), "slabs": cut}


def _large(made: Body) -> NDArray[np.int32]:
    """Faces of a body without its small parts, because an antenna would make the hull of its slab a tent."""
    a, b, c = (made.vertices[made.faces[:, i]] for i in range(3))
    areas = np.bincount(made.parts, 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
    return made.faces[areas[made.parts] > _SMALL_PART]


@lru_cache(maxsize=256)
def _unit_slabs(kind: str, variant: int) -> FloatArray:
    mesh = props.mesh(kind, variant)
    return slabs(mesh.vertices[:, :3].astype(float), mesh.faces, 1, _PROP_SLABS.get(kind, 1))


def prop_slabs(prop: Prop) -> FloatArray:
    """(K, M, 3) world points of the slabs of a thing."""
    cos, sin = np.cos(prop.yaw), np.sin(prop.yaw)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    unit = _unit_slabs(prop.kind, props.variant(prop.kind, prop.seed))
    return np.asarray((unit * prop.size) @ turn.T + prop.position)


def prop_corners(props_: Sequence[Prop]) -> FloatArray:
    """(N, 8, 3) world corners of boxes around things; their meshes extend a little beyond `size`."""
    yaw = np.array([prop.yaw for prop in props_])
    size = np.array([prop.size for prop in props_])
    signs = np.array([(x, y, z) for x in (-0.7, 0.7) for y in (-1.05, 0.0) for z in (-0.7, 0.7)])
    x, y, z = np.moveaxis(signs * size[:, None], 2, 0)
    cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    turned = np.stack([x * cos + z * sin, y, z * cos - x * sin], axis=2)
    return np.asarray(turned + np.array([prop.position for prop in props_])[:, None])


def cover(prop: Prop) -> float:
    """Fraction of what is behind its outline that a thing hides; below 1 for bars and wires."""
    return props.cover(prop.kind, props.variant(prop.kind, prop.seed))
