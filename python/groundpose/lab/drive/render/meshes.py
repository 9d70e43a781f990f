"""Meshes in OpenGL's memory: made once, kept while there is room, drawn many times."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from groundpose.lab.drive.body_cache import body, of_body
from groundpose.lab.drive.render.context import context
from groundpose.lab.drive.render.faces import Aim, FaceTable
from groundpose.lab.drive.render.levels import (
    COARSE,
    FINEST,
    Floats,
    Level,
    coarse_levels,
    finest_level,
    keys,
    packed,
    unpacked,
)

# Floats of an instance: three rows of world_from_object, four more vectors.
INSTANCE_FLOATS = 28
_ROWS = "4f 4f 4f 4f 4f 4f 4f/i"

_PIVOT = 10  # column of a vehicle's vertices, see VEHICLE: not 0 where they steer


@dataclass(frozen=True)
class Format:
    """Vertex attributes of a program: layout and names of the mesh's, then those of the instance."""

    layout: str
    names: tuple[str, ...]
    instance: tuple[str, ...]


VEHICLE = Format(
    "3f 3f 3f 1f 2f",
    ("in_position", "in_normal", "in_local", "in_material", "in_pivot"),
    ("in_row0", "in_row1", "in_row2", "in_paint", "in_second", "in_state", "in_extra"),
)
PROP = Format(
    "3f 3f 2f 2f 4f",
    ("in_position", "in_normal", "in_uv", "in_layer", "in_colour"),
    ("in_row0", "in_row1", "in_row2", "in_size", "in_tint", "in_spare0", "in_spare1"),
)


class GpuMesh:
    """All levels of detail of one mesh, each in two parts: solid faces, then panes or leaves."""

    def __init__(self, programs: dict[str, Any], kind: Format, levels: Sequence[Level]) -> None:
        """Upload the levels into one buffer, with a vertex array for every program."""
        gl = context()
        vertices = np.concatenate([v for v, _, _ in levels])
        offsets = np.cumsum([0, *(len(v) for v, _, _ in levels)])
        moved = [f + o for (_, f, _), o in zip(levels, offsets[:-1], strict=True)]
        faces = np.concatenate(moved).astype("i4")
        counts = np.cumsum([0, *(n for _, f, split in levels for n in (split, len(f) - split))])
        self._parts: list[int] = (3 * counts).tolist()
        self._faces, self._positions = faces, vertices[:, :3].copy()
        self._turning = vertices[:, _PIVOT] != 0.0
        self._tables: dict[int, FaceTable] = {}
        self.box = np.stack([levels[0][0][:, :3].min(axis=0), levels[0][0][:, :3].max(axis=0)]).astype(float)
        vbo = gl.buffer(np.ascontiguousarray(vertices, dtype="f4"))
        # behind the faces there is room for those of one part that a window sees
        ibo = gl.buffer(reserve=4 * (faces.size + max(np.diff(self._parts), default=0)), dynamic=True)
        ibo.write(faces)
        self._instances = gl.buffer(reserve=4 * INSTANCE_FLOATS, dynamic=True)
        self._buffers = (vbo, ibo, self._instances)
        self._ibo = ibo
        self._arrays = {
            name: gl.vertex_array(
                program,
                [
                    _used(program, vbo, kind.layout, kind.names),
                    _used(program, self._instances, _ROWS, kind.instance),
                ],
                index_buffer=ibo,
            )
            for name, program in programs.items()
        }

    def draw(self, name: str, rows: Floats, level: int, second: bool = False, aim: Aim | None = None) -> None:
        """Draw instances (N, INSTANCE_FLOATS) of the first or the second part of a level; with an `aim` at
        the only instance, of a vehicle, without the faces that it does not see."""
        part = 2 * level + second
        first, last = self._parts[part], self._parts[part + 1]
        if last > first and aim is not None:
            first, last = self._write_seen(part, aim)
        if last == first:
            return
        if rows.nbytes > self._instances.size:
            self._instances.orphan(2 * rows.nbytes)
        self._instances.write(np.ascontiguousarray(rows))
        self._arrays[name].render(vertices=last - first, first=first, instances=len(rows))

    def _write_seen(self, part: int, aim: Aim) -> tuple[int, int]:
        """Upload the indices of a part's seen faces; their first place and the one after the last."""
        if part not in self._tables:
            faces = self._faces[self._parts[part] // 3 : self._parts[part + 1] // 3]
            self._tables[part] = FaceTable(self._positions, faces, self._turning)
        seen = self._tables[part].seen(aim)
        if seen.size:
            self._ibo.write(seen, offset=4 * self._faces.size)
        return self._faces.size, self._faces.size + seen.size

    def release(self) -> None:
        """Release the memory."""
        for item in (*self._arrays.values(), *self._buffers):
            item.release()


class BodyMesh:
    """The levels of detail of a body, from the cache on disk. The finest takes as much memory as all others
    together and is uploaded when a vehicle fills the picture."""

    def __init__(self, programs: dict[str, Any], class_name: str, seed: int) -> None:
        """Upload the coarse levels."""
        self._programs, self._of = programs, (class_name, seed)
        kept = of_body("levels", *self._of, keys(COARSE) | {"box"}, lambda: coarse_levels(body(*self._of)))
        self.box = kept["box"]
        self._meshes = {"coarse": GpuMesh(programs, VEHICLE, unpacked(kept, COARSE))}

    def draw(self, name: str, rows: Floats, level: int, second: bool = False, aim: Aim | None = None) -> None:
        """Draw the instance (1, INSTANCE_FLOATS), see `GpuMesh.draw`."""
        if level > 0:
            self._meshes["coarse"].draw(name, rows, level - 1, second, aim)
            return
        if "finest" not in self._meshes:
            self._meshes["finest"] = self._upload_finest()
        self._meshes["finest"].draw(name, rows, 0, second, aim)

    def _upload_finest(self) -> GpuMesh:
        kept = of_body(
            "finest", *self._of, keys(FINEST), lambda: packed([finest_level(body(*self._of))], FINEST)
        )
        return GpuMesh(self._programs, VEHICLE, unpacked(kept, FINEST))

    def release(self) -> None:
        """Release the memory."""
        for mesh in self._meshes.values():
            mesh.release()


def _used(program: Any, buffer: Any, layout: str, names: tuple[str, ...]) -> tuple[Any, ...]:
    """The attributes that the compiler kept; the others become padding."""
    suffix = "/i" if layout.endswith("/i") else ""
    parts = layout.removesuffix("/i").split()
    kept = [p if n in program else f"{4 * int(p[:-1])}x" for p, n in zip(parts, names, strict=True)]
    return (buffer, " ".join(kept) + suffix, *[n for n in names if n in program])


Drawable = TypeVar("Drawable", GpuMesh, BodyMesh)


class Pool(Generic[Drawable]):
    """The most recently used meshes; the others are released."""

    def __init__(self, size: int) -> None:
        """Keep at most `size` meshes."""
        self._size = size
        self._meshes: OrderedDict[Hashable, Drawable] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Drawable]) -> Drawable:
        """The mesh of `key`, made if it is missing."""
        found = self._meshes.get(key)
        if found is None:
            found = self._meshes[key] = make()
        self._meshes.move_to_end(key)
        return found

    def trim(self) -> None:
        """Release the longest unused meshes beyond the size; call when none is waiting to be drawn."""
        while len(self._meshes) > self._size:
            self._meshes.popitem(last=False)[1].release()
