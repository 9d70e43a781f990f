"""The ground as triangles: strips along the road, with kerbs, markings and the mouth of a side street."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive.road import KERB_HEIGHT, Junction, Layout, Road

MATERIALS = ("asphalt", "marking", "kerb", "pavement", "verge")

_LINE = 0.06  # half the width of a painted line
_KERB_STONE = 0.15
_SPACING = 1.0  # of cross-sections, metres


@dataclass(frozen=True, eq=False)
class Mesh:
    """Ground as triangles: vertices and normals (V, 3) world, uv (V, 2) = (d, s) metres, faces (F, 3) whose
    right-hand normals point up, materials (F,) rows of `MATERIALS`."""

    vertices: FloatArray
    normals: FloatArray
    uv: FloatArray
    faces: np.ndarray[tuple[int, int], np.dtype[np.int32]]
    materials: np.ndarray[tuple[int], np.dtype[np.uint8]]


@dataclass(frozen=True)
class Strip:
    """Ground between two d at two lifts. `dash` = (painted, gap) metres makes a broken line of asphalt and
    marking; equal d make the face of a kerb."""

    d0: float
    d1: float
    material: str
    lift0: float = 0.0
    lift1: float = 0.0
    dash: tuple[float, float] | None = None


def road_mesh(road: Road, s_from: float | None = None, s_to: float | None = None) -> Mesh:
    """The ground between two s as triangles; None: the whole road."""
    s_from, s_to = road.start if s_from is None else s_from, road.end if s_to is None else s_to
    pieces: list[_Piece] = []
    for first, last, strips in _sections(road, s_from, s_to):
        for strip in strips:
            pieces.append(_strip(road, first, last, strip))
    if road.junction is not None:
        pieces += _mouth_faces(road, road.junction, s_from, s_to)
    offsets = np.cumsum([0, *(len(p.vertices) for p in pieces)])
    return Mesh(
        vertices=np.concatenate([p.vertices for p in pieces]),
        normals=np.concatenate([p.normals for p in pieces]),
        uv=np.concatenate([p.uv for p in pieces]),
        faces=np.concatenate([p.faces + o for p, o in zip(pieces, offsets[:-1], strict=True)]).astype(
            np.int32
        ),
        materials=np.concatenate([p.materials for p in pieces]).astype(np.uint8),
    )


_Section = tuple[float, float, list[Strip]]


def _sections(road: Road, s_from: float, s_to: float) -> list[_Section]:
    """Sections of constant cross-section along the road."""
    layout, junction = road.layout, road.junction
    plain = _cross_section(layout)
    if junction is None:
        return [(s_from, s_to, plain)]
    near, far = junction.s - junction.half_width, junction.s + junction.half_width
    mouth = _mouth(layout, junction)
    sections: list[_Section] = [(s_from, near - 4.6, plain)]
    if junction.zebra:
        sections += _crossing(layout, plain, near - 4.6, +1) + _crossing(layout, plain, far, -1)
    else:
        sections += [(near - 4.6, near, _unmarked(layout, plain)), (far, far + 4.6, _unmarked(layout, plain))]
    middle = [
        (near, junction.s - _LINE, mouth),
        (junction.s - _LINE, junction.s + _LINE, _mouth(layout, junction, line=True)),
        (junction.s + _LINE, far, mouth),
    ]
    sections += [*middle, (far + 4.6, s_to, plain)]
    clipped = [(max(a, s_from), min(b, s_to), strips) for a, b, strips in sections]
    return [section for section in clipped if section[1] > section[0] + 1e-9]


def _crossing(layout: Layout, plain: list[Strip], start: float, side: int) -> list[_Section]:
    """A zebra crossing (3 m of bars) and the stop line before it; `side` +1: before the junction."""
    bare = _unmarked(layout, plain)
    bars = _replace_road(layout, plain, _bars(layout))
    stop = _replace_road(layout, plain, _stop_line(layout, side))
    lengths: list[tuple[float, list[Strip]]] = [(0.3, stop), (0.5, bare), (3.0, bars), (0.8, bare)]
    sections, s = [], start
    for length, strips in lengths if side > 0 else lengths[::-1]:
        sections.append((s, s + length, strips))
        s += length
    return sections


def _cross_section(layout: Layout) -> list[Strip]:
    """Strips of the open road from left to right."""
    lines = _lines(layout)
    return _replace_road(layout, _beside(layout), _painted(-layout.left, layout.right, lines, layout.median))


def _unmarked(layout: Layout, plain: list[Strip]) -> list[Strip]:
    return _replace_road(layout, plain, [Strip(-layout.left, layout.right, "asphalt")])


def _replace_road(layout: Layout, strips: list[Strip], road: list[Strip]) -> list[Strip]:
    """The strips beyond the edges with another road between them."""
    return [s for s in strips if s.d1 <= -layout.left or s.d0 >= layout.right] + road


def _beside(layout: Layout) -> list[Strip]:
    """Kerb, pavement and verge on both sides, or the verge alone."""
    strips = []
    for side in (-1, 1):
        d, lift = layout.edge(side), 0.0
        rows = [(layout.extent, "verge")]
        if layout.kerb:
            strips.append(_between(side, d, d, "kerb", 0.0, KERB_HEIGHT))
            lift = KERB_HEIGHT
            rows = [(d + _KERB_STONE, "kerb"), (d + layout.pavement, "pavement"), *rows]
        for outer, material in rows:
            for a, b in _steps(d, outer):
                strips.append(_between(side, a, b, material, lift, lift))
            d = outer
    return strips


def _between(side: int, inner: float, outer: float, material: str, lift_in: float, lift_out: float) -> Strip:
    """A strip given by distances from the centre line on one side."""
    if side > 0:
        return Strip(inner, outer, material, lift_in, lift_out)
    return Strip(-outer, -inner, material, lift_out, lift_in)


def _steps(inner: float, outer: float) -> list[tuple[float, float]]:
    """Wide ground in strips of at most 8 m, because it is not flat across."""
    edges = np.linspace(inner, outer, max(1, round((outer - inner) / 8.0)) + 1)
    return list(itertools.pairwise(edges.tolist()))


def _lines(layout: Layout) -> list[tuple[float, tuple[float, float] | None]]:
    """Painted lines: d and dashes (None: solid)."""
    broken = (6.0, 12.0) if layout.kind == "motorway" else (3.0, 6.0)
    lines: list[tuple[float, tuple[float, float] | None]] = []
    for direction in (-1, 1):
        lanes = sorted((lane for lane in layout.lanes if lane.direction == direction), key=lambda a: abs(a.d))
        for inner, outer in itertools.pairwise(lanes):
            if abs(outer.d - inner.d) < 1.5 * inner.width:  # not another aisle
                lines.append((0.5 * (inner.d + outer.d), broken))
        outer_edge = lanes[-1].d + np.sign(lanes[-1].d) * 0.5 * lanes[-1].width
        if layout.median > 0.0:
            inner_edge = lanes[0].d - np.sign(lanes[0].d) * 0.5 * lanes[0].width
            lines.append((float(inner_edge), None))
        if layout.shoulder > 0.0 or not layout.kerb:
            lines.append((float(outer_edge - np.sign(outer_edge) * 0.15), None))
    if layout.median == 0.0:
        lines.append((0.0, broken))
    return sorted(lines)


def _painted(
    d0: float, d1: float, lines: list[tuple[float, tuple[float, float] | None]], median: float = 0.0
) -> list[Strip]:
    """Asphalt with lines, and the grass strip in the middle."""
    strips, d = [], d0
    marks = [(line - _LINE, line + _LINE, dash, "marking") for line, dash in lines]
    if median > 0.0:
        marks.append((-median, median, None, "verge"))
    for a, b, dash, material in sorted(marks, key=lambda mark: mark[0]):
        strips += [Strip(d, a, "asphalt"), Strip(a, b, material, dash=dash)]
        d = b
    strips.append(Strip(d, d1, "asphalt"))
    wide = [(s, _steps(s.d0, s.d1)) for s in strips]
    return [Strip(a, b, s.material, dash=s.dash) for s, steps in wide for a, b in steps if b > a]


def _bars(layout: Layout) -> list[Strip]:
    """Bars of half a metre along the road, half a metre apart."""
    edges = [*np.arange(-layout.left, layout.right, 0.5).tolist(), layout.right]
    return [Strip(a, b, ("asphalt", "marking")[i % 2]) for i, (a, b) in enumerate(itertools.pairwise(edges))]


def _stop_line(layout: Layout, side: int) -> list[Strip]:
    """Across the lanes that lead to the junction."""
    lanes = [lane for lane in layout.lanes if lane.direction == side]
    low = min(lane.d - 0.5 * lane.width for lane in lanes) + 0.1
    high = max(lane.d + 0.5 * lane.width for lane in lanes) - 0.1
    parts = [(-layout.left, low, "asphalt"), (low, high, "marking"), (high, layout.right, "asphalt")]
    return [Strip(a, b, material) for a, b, material in parts if b > a]


def _mouth(layout: Layout, junction: Junction, line: bool = False) -> list[Strip]:
    """Where the other street crosses: asphalt from side to side; `line`: with its own centre line."""
    strips = [Strip(-layout.left, layout.right, "asphalt")]
    for side in (-1, 1):
        d, beyond = layout.edge(side), layout.edge(side) + 5.0
        rows = [(beyond, "asphalt"), (junction.reach, "marking" if line else "asphalt")]
        for outer, material in [*rows, (layout.extent, "verge")]:
            strips += [_between(side, a, b, material, 0.0, 0.0) for a, b in _steps(d, outer) if b > a]
            d = outer
    return strips


@dataclass(frozen=True)
class _Piece:
    vertices: FloatArray
    normals: FloatArray
    uv: FloatArray
    faces: np.ndarray[tuple[int, int], np.dtype[np.intp]]
    materials: np.ndarray[tuple[int], np.dtype[np.uint8]]


def _strip(road: Road, first: float, last: float, strip: Strip) -> _Piece:
    """Two rows of vertices along s."""
    s = _stations(first, last, strip.dash)
    left = road.world(s, strip.d0, strip.lift0)
    right = road.world(s, strip.d1, strip.lift1)
    if strip.d0 == strip.d1:  # the face of a kerb is turned to the road
        toward = -np.sign(strip.d0) * road.frame(s, strip.d0)[:, :, 0]
        normals = np.concatenate([toward, toward])
    else:
        normals = -np.concatenate([road.frame(s, strip.d0)[:, :, 1], road.frame(s, strip.d1)[:, :, 1]])
    uv = np.concatenate([np.stack([np.full(len(s), d), s], axis=1) for d in (strip.d0, strip.d1)])
    n = len(s)
    i = np.arange(n - 1)
    faces = np.concatenate([np.stack([i, i + n, i + 1], axis=1), np.stack([i + n, i + n + 1, i + 1], axis=1)])
    material = np.full(n - 1, MATERIALS.index(strip.material))
    if strip.dash is not None:
        painted, gap = strip.dash
        bare = np.mod(0.5 * (s[1:] + s[:-1]), painted + gap) > painted
        material[bare] = MATERIALS.index("asphalt")
    return _Piece(np.concatenate([left, right]), normals, uv, faces, np.tile(material, 2).astype(np.uint8))


def _stations(first: float, last: float, dash: tuple[float, float] | None) -> FloatArray:
    """Whole metres between the ends; dashes begin and end on them."""
    inner = np.arange(np.floor(first / _SPACING) + 1.0, np.ceil(last / _SPACING)) * _SPACING
    return np.concatenate([[first], inner, [last]])


def _mouth_faces(road: Road, junction: Junction, s_from: float, s_to: float) -> list[_Piece]:
    """Kerbs of the crossing street: upright faces along d, turned to the street."""
    if not road.layout.kerb:
        return []
    pieces = []
    for sign in (-1, 1):
        s = junction.s + sign * junction.half_width
        if not s_from < s < s_to:
            continue
        for side in (-1, 1):
            d = np.linspace(road.layout.edge(side), road.layout.extent, 12) * side
            low, high = road.world(s, d), road.world(s, d, KERB_HEIGHT)
            toward = -sign * road.frame(np.full(len(d), s), d)[:, :, 2]
            n, i = len(d), np.arange(len(d) - 1)
            quads = [np.stack([i, i + 1, i + n], axis=1), np.stack([i + 1, i + n + 1, i + n], axis=1)]
            faces = np.concatenate(quads)
            if sign * side < 0:  # the other way round for the opposite faces
                faces = faces[:, ::-1]
            uv = np.concatenate([np.stack([d, np.full(n, s)], axis=1)] * 2)
            material = np.full(len(faces), MATERIALS.index("kerb"), dtype=np.uint8)
            vertices = np.concatenate([low, high])
            pieces.append(_Piece(vertices, np.concatenate([toward, toward]), uv, faces, material))
    return pieces
