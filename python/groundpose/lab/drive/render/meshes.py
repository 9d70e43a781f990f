"""Meshes in OpenGL's memory: made once, kept while there is room, drawn many times."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lab.bodies.body import MATERIALS, Body
from groundpose.lab.drive import props
from groundpose.lab.drive.body_cache import body, of_body
from groundpose.lab.drive.cache import Arrays
from groundpose.lab.drive.render.context import context
from groundpose.lab.drive.render.faces import Aim, FaceTable
from groundpose.lab.drive.render.textures import layer
from groundpose.vehicles.keypoints import keypoint_names

Floats = NDArray[np.float32]
Faces = NDArray[np.int32]
Level = tuple[Floats, Faces, int]  # vertices, faces, number of the first face of the second part

# Floats of an instance: three rows of world_from_object, four more vectors.
INSTANCE_FLOATS = 28
_ROWS = "4f 4f 4f 4f 4f 4f 4f/i"

# Levels of detail, fine ones first: drawn pixels per metre from which a level is used, and its parameter.
BODY_LEVELS = (
    (90.0, 0.0),
    (45.0, 0.035),
    (22.0, 0.08),
    (10.0, 0.16),
    (0.0, 0.3),
)  # vertices within this many metres are merged
PROP_LEVELS = ((50.0, 1), (22.0, 3), (10.0, 8), (0.0, 16))  # one of this many twigs is drawn, enlarged
_PIVOT = 10  # column of a vehicle's vertices, see VEHICLE: not 0 where they steer
_LAID_ON = ("seam", "plate")
_LEFT_OUT = {"underbody": 0.03, "seam": 0.08, "plate": 0.3}  # cells from which a material is not seen
# Factor on the cell size for parts that lie behind glass, rotate or are small.
_COARSER = {
    "interior": 4.0,
    "seat": 3.0,
    "skin": 3.0,
    "clothes": 3.0,
    "metal": 2.0,
    "rim": 1.7,
    "tyre": 1.5,
    "chrome": 1.5,
    "plastic": 1.4,
}
# Parts within this distance (metres, across) of a front wheel's middle, and within its radius, steer with it.
_WHEEL_HALF_WIDTH = 0.25
# Faces with longer edges (metres) are cut, so that light computed at vertices does not miss a shadow.
_LONGEST_EDGE = 0.35


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
        kept = of_body("levels", *self._of, _keys(_COARSE) | {"box"}, lambda: _coarse(body(*self._of)))
        self.box = kept["box"]
        self._meshes = {"coarse": GpuMesh(programs, VEHICLE, _unpacked(kept, _COARSE))}

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
            "finest", *self._of, _keys(_FINEST), lambda: _packed([_finest(body(*self._of))], _FINEST)
        )
        return GpuMesh(self._programs, VEHICLE, _unpacked(kept, _FINEST))

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


def level_of(levels: Sequence[tuple[float, float]], pixels_per_metre: float) -> int:
    """Index of the first level made for this resolution."""
    return next(i for i, (least, _) in enumerate(levels) if pixels_per_metre >= least)


def vehicle_levels(body: Body) -> list[Level]:
    """The levels of BODY_LEVELS."""
    fine = _finest(body)
    return [fine if cell == 0.0 else _clustered(*fine, cell) for _, cell in BODY_LEVELS]


_COARSE = range(1, len(BODY_LEVELS))
_FINEST = range(1)


def _keys(levels: range) -> frozenset[str]:
    return frozenset(f"{what}{i}" for what in ("vertices", "faces", "split") for i in levels)


def _packed(levels: Sequence[Level], numbers: range) -> Arrays:
    out: Arrays = {}
    for i, (vertices, faces, split) in zip(numbers, levels, strict=True):
        small = faces.astype(np.min_scalar_type(len(vertices)))
        out |= {f"vertices{i}": vertices, f"faces{i}": small, f"split{i}": np.array(split)}
    return out


def _unpacked(kept: Arrays, numbers: range) -> list[Level]:
    return [
        (kept[f"vertices{i}"], kept[f"faces{i}"].astype(np.int32), int(kept[f"split{i}"])) for i in numbers
    ]


def _coarse(body: Body) -> Arrays:
    """All levels but the finest, to be kept, and the box (2, 3) of the finest."""
    fine, *coarse = vehicle_levels(body)
    points = fine[0][:, :3]
    box = np.stack([points.min(axis=0), points.max(axis=0)]).astype(float)
    return {"box": box, **_packed(coarse, _COARSE)}


def _finest(body: Body) -> Level:
    """Vertices (V, 12): position, normal, place within part, material, pivot; faces with the panes last."""
    parts, materials = body.parts.astype(np.int64), body.materials.astype(np.int64)
    corner = (body.faces.astype(np.int64) * 65536 + parts[:, None]) * 64 + materials[:, None]
    keys, back = np.unique(corner, return_inverse=True)
    vertex, part, material = keys // (64 * 65536), keys // 64 % 65536, keys % 64
    position = body.vertices[vertex]
    low = np.full((parts.max() + 1, 3), np.inf)
    high = -low
    np.minimum.at(low, part, position)
    np.maximum.at(high, part, position)
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), 1e-4)
    local, pivot = (position - middle[part]) / half[part], _pivots(body, low, high)[part]
    data = np.column_stack([position, body.normals[vertex], local, material, pivot])
    vertices, faces = _cut(data.astype(np.float32), back.reshape(-1, 3).astype(np.int32))
    panes = vertices[faces[:, 0], 9] == MATERIALS.index("glass")
    order = np.argsort(panes, kind="stable")
    return vertices, faces[order], int((~panes).sum())


def _pivots(body: Body, low: FloatArray, high: FloatArray) -> FloatArray:
    """x and z (parts, 2) of the vertical axis about which each part steers, from the parts' boxes; 0: none.

    Front wheels turn about the middle of their outer face: that keypoint stays where the labels have it.
    """
    names = keypoint_names(body.class_name)
    pivots = np.zeros((len(low), 2))
    for side in ("right", "left"):
        x, _, z = body.keypoints_3d[names.index(f"{side}_front_wheel")]
        wheel = body.wheels[np.abs(body.wheels[:, [0, 2]] - [x, z]).sum(axis=1).argmin()]
        reach = np.array([_WHEEL_HALF_WIDTH, wheel[3] + 0.01, wheel[3] + 0.01])
        pivots[np.all((low > wheel[:3] - reach) & (high < wheel[:3] + reach), axis=1)] = x, z
    return pivots


def _cut(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    """Halve the longest edge of large faces until all are short; flat faces show no cracks."""
    for _ in range(8):
        corners = vertices[faces, :3]
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = edges.max(axis=1) > _LONGEST_EDGE
        if not long.any():
            break
        a, b, c = (
            np.take_along_axis(faces[long], (edges[long].argmax(axis=1)[:, None] + k) % 3, 1)[:, 0]
            for k in range(3)
        )
        m = len(vertices) + np.arange(len(a), dtype=np.int32)
        vertices = np.concatenate([vertices, 0.5 * (vertices[a] + vertices[b])])
        faces = np.concatenate([faces[~long], np.stack([a, m, c], 1), np.stack([m, b, c], 1)]).astype(
            np.int32
        )
    return vertices, faces


def _clustered(vertices: Floats, faces: Faces, split: int, cell: float) -> Level:
    """Merge vertices in a cell of equal material and similar direction (Rossignac and Borrel, 1993)."""
    times = np.array([_COARSER.get(name, 1.0) for name in MATERIALS])[vertices[:, 9].astype(np.int64)]
    place = np.floor(vertices[:, :3] / (cell * times[:, None])).astype(np.int64) + 1024
    facing = np.rint(vertices[:, 3:6] * 0.8).astype(np.int64) + 1
    spot = (place[:, 0] * 2048 + place[:, 1]) * 2048 + place[:, 2]
    # Thin parts on other parts must not sink into them.
    laid = np.isin(vertices[:, 9], [MATERIALS.index(name) for name in _LAID_ON])
    spot[laid] = -1 - np.arange(laid.sum())
    steers = (vertices[:, 10] != 0.0).astype(np.int64)
    key = ((spot * 27 + facing @ [9, 3, 1]) * 2 + steers) * 32 + vertices[:, 9].astype(np.int64)
    _, first, back = np.unique(key, return_index=True, return_inverse=True)
    merged = vertices[first]
    number = np.bincount(back)
    for axis in range(3):
        merged[:, axis] = np.bincount(back, vertices[:, axis]) / number
    at = spot[faces]
    kept = (at[:, 0] != at[:, 1]) & (at[:, 1] != at[:, 2]) & (at[:, 2] != at[:, 0])
    for name, coarse in _LEFT_OUT.items():
        if cell >= coarse:
            kept &= vertices[faces[:, 0], 9] != MATERIALS.index(name)
    used, rows = np.unique(back[faces[kept]], return_inverse=True)
    return merged[used], rows.reshape(-1, 3).astype(np.int32), int(kept[:split].sum())


def prop_levels(kind: str, variant: int) -> list[Level]:
    """The mesh of a prop, and coarser levels with fewer, larger twigs for greater distances."""
    mesh = props.mesh(kind, variant)
    twigs = np.isin(mesh.vertices[mesh.faces[:, 0], 8], [layer("foliage"), layer("needles")])
    levels: list[Level] = []
    for _, step in PROP_LEVELS:
        first = mesh.faces[twigs][:, 0] // 4  # the four vertices of a twig are consecutive
        kept = ~twigs
        kept[twigs] = first % step == 0
        vertices = mesh.vertices.copy()
        if twigs.any() and step > 1:
            corners = np.unique(mesh.faces[twigs]).reshape(-1, 4)
            middle = vertices[corners, :3].mean(axis=1, keepdims=True)
            vertices[corners, :3] = middle + 0.85 * np.sqrt(step) * (vertices[corners, :3] - middle)
        levels.append((vertices, mesh.faces[kept], int(kept[: mesh.solid].sum())))
    return levels
