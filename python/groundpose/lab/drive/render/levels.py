"""Levels of detail of bodies and props: vertices and faces as the renderer's programs take them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.lab.bodies.body import MATERIALS, Body
from groundpose.lab.drive import props
from groundpose.lab.drive.cache import Arrays
from groundpose.lab.drive.render.textures import layer
from groundpose.vehicles.keypoints import keypoint_names

Floats = NDArray[np.float32]
Faces = NDArray[np.int32]
Level = tuple[Floats, Faces, int]  # vertices, faces, number of the first face of the second part

# Levels of detail, fine ones first: drawn pixels per metre from which a level is used, and its parameter.
BODY_LEVELS = (
    (90.0, 0.0),
    (45.0, 0.035),
    (22.0, 0.08),
    (10.0, 0.16),
    (0.0, 0.3),
)  # vertices within this many metres are merged
PROP_LEVELS = ((50.0, 1), (22.0, 3), (10.0, 8), (0.0, 16))  # one of this many twigs is drawn, enlarged
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

COARSE = range(1, len(BODY_LEVELS))
FINEST = range(1)
"""Numbers of the levels that are kept together."""


def level_of(levels: Sequence[tuple[float, float]], pixels_per_metre: float) -> int:
    """Index of the first level made for this resolution."""
    return next(i for i, (least, _) in enumerate(levels) if pixels_per_metre >= least)


def vehicle_levels(body: Body) -> list[Level]:
    """The levels of BODY_LEVELS."""
    fine = finest_level(body)
    return [fine if cell == 0.0 else _clustered(*fine, cell) for _, cell in BODY_LEVELS]


def keys(levels: range) -> frozenset[str]:
    """Names of the arrays of levels with these numbers on disk."""
    return frozenset(f"{what}{i}" for what in ("vertices", "faces", "split") for i in levels)


def packed(levels: Sequence[Level], numbers: range) -> Arrays:
    """Levels with these numbers as arrays to be kept on disk."""
    out: Arrays = {}
    for i, (vertices, faces, split) in zip(numbers, levels, strict=True):
        small = faces.astype(np.min_scalar_type(len(vertices)))
        out |= {f"vertices{i}": vertices, f"faces{i}": small, f"split{i}": np.array(split)}
    return out


def unpacked(kept: Arrays, numbers: range) -> list[Level]:
    """The levels with these numbers from the arrays of `packed`."""
    return [
        (kept[f"vertices{i}"], kept[f"faces{i}"].astype(np.int32), int(kept[f"split{i}"])) for i in numbers
    ]


def coarse_levels(body: Body) -> Arrays:
    """All levels but the finest, to be kept, and the box (2, 3) of the finest."""
    fine, *coarse = vehicle_levels(body)
    points = fine[0][:, :3]
    box = np.stack([points.min(axis=0), points.max(axis=0)]).astype(float)
    return {"box": box, **packed(coarse, COARSE)}


def finest_level(body: Body) -> Level:
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
