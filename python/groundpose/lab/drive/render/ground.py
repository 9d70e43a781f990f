"""The ground in OpenGL's memory, and its materials."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose.lab.drive.render import textures
from groundpose.lab.drive.render.context import context
from groundpose.lab.drive.render.view import box_corners, in_view
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.road_mesh import MATERIALS, road_mesh
from groundpose.lab.drive.scene import Scene

PROGRAMS = ("ground", "wet_ground")  # dry, wet
_CELL = 12.0  # metres

# By material of the road: layers to choose from, metres a texture covers, brightness, 1 asphalt 2 marking.
_SURFACES: dict[str, tuple[tuple[str, ...], float, float, float]] = {
    "asphalt": (("asphalt",), 2.4, 0.85, 1.0),
    "marking": (("asphalt",), 2.4, 0.85, 2.0),
    "kerb": (("concrete", "slabs"), 1.0, 0.9, 0.0),
    "pavement": (("slabs", "pavers", "cobbles", "asphalt"), 2.0, 0.85, 0.0),
    "verge": (("grass", "grass", "grass", "soil"), 3.0, 0.7, 0.0),
}
# Other surfaces by kind of road, and their probability.
_PAVED: dict[str, tuple[tuple[str, ...], float]] = {
    "street": (("cobbles", "cobbles", "concrete"), 0.12),
    "yard": (("cobbles", "pavers", "concrete"), 0.4),
    "motorway": (("concrete",), 0.2),
}


class Ground:
    """The triangles of a road in square cells, so that a crop draws only the visible ones."""

    def __init__(self, programs: dict[str, Any], road: Road) -> None:
        """Sort the faces into cells."""
        mesh = road_mesh(road)
        corners = mesh.vertices[mesh.faces]
        cell = np.floor(corners.mean(axis=1)[:, [0, 2]] / _CELL).astype(np.int64) @ [100003, 1]
        order = np.argsort(cell, kind="stable")
        _, self._first, self._count = np.unique(cell[order], return_index=True, return_counts=True)
        corners = corners[order]
        low = np.minimum.reduceat(corners.min(axis=1), self._first)
        high = np.maximum.reduceat(corners.max(axis=1), self._first)
        self._corners = box_corners(np.stack([low, high], axis=1))
        flat = mesh.faces[order].ravel()
        material = np.repeat(mesh.materials[order], 3).astype(float)
        data = np.column_stack([mesh.vertices[flat], mesh.normals[flat], material])
        self._buffer = context().buffer(np.ascontiguousarray(data, dtype="f4"))
        content = (self._buffer, "3f 3f 1f", "in_position", "in_normal", "in_material")
        self._arrays = {name: context().vertex_array(programs[name], [content]) for name in PROGRAMS}

    def draw(self, clip: NDArray[np.float64], wet: bool) -> None:
        """Draw the cells in view; cells that are adjacent in memory are drawn in one call."""
        array = self._arrays[PROGRAMS[wet]]
        seen = np.flatnonzero(in_view(clip, self._corners))
        if len(seen) == 0:
            return
        breaks = np.flatnonzero(np.diff(seen) > 1)
        for a, b in zip(seen[np.r_[0, breaks + 1]], seen[np.r_[breaks, len(seen) - 1]], strict=True):
            first, last = self._first[a], self._first[b] + self._count[b]
            array.render(vertices=int(3 * (last - first)), first=int(3 * first))

    def release(self) -> None:
        """Release the memory."""
        for item in (*self._arrays.values(), self._buffer):
            item.release()


def surfaces(scene: Scene) -> NDArray[np.float32]:
    """The uniform of ground.frag: the materials of the road, drawn from the light's seed."""
    rng = np.random.default_rng([86, scene.light.seed])
    out = np.zeros((8, 4), "f4")
    for i, name in enumerate(MATERIALS):
        choice, tile, bright, kind = _SURFACES[name]
        picked = choice[rng.integers(len(choice))]
        out[i] = textures.layer(picked), tile, bright * rng.uniform(0.8, 1.2), kind
    paved, fraction = _PAVED.get(scene.road.layout.kind, (("asphalt",), 0.0))
    if rng.random() < fraction:
        name = paved[rng.integers(len(paved))]
        out[0, 0] = textures.layer(name)
        out[0, 2] *= 0.55 if name == "concrete" else 1.0  # tyres darken a concrete road
    out[1, :3] = out[0, :3]  # markings lie on the same ground
    return out
