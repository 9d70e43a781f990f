"""Meshes of things beside roads: trees, hedges, houses, walls, poles, signs, people.

Each has unit size in the object frame (x right, y down, z forward, standing on y = 0) and is stretched to the
size of its `Prop`. The texture of walls and facades repeats every metre, whatever the size.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from groundpose.lab.drive.props_people import cyclist, person
from groundpose.lab.drive.props_plants import bush, conifer, hedge, tree
from groundpose.lab.drive.props_shapes import (
    WHITE,
    Colour,
    Mesh,
    Surface,
    ball,
    box,
    join,
    quad,
    tube,
    with_holes,
)  # fmt: skip
from groundpose.lab.drive.render import textures


def _house(facade: str, roof: bool, ground: str | None) -> Callable[[np.random.Generator], Mesh]:
    """The length is along z; the roof takes the upper quarter."""

    def make(rng: np.random.Generator) -> Mesh:
        eaves = -0.72 if roof else -0.97
        wall, plain = Surface(facade, 6.0), Surface("plaster", 4.0)
        pieces = [box((-0.5, eaves, -0.5), (0.5, 0, 0.5), wall, plain)]
        grey: Colour = (0.35, 0.34, 0.33)
        pieces.append(box((-0.504, -0.06, -0.502), (0.504, 0, 0.502), Surface("concrete", 3.0, grey, 0.0)))
        if ground is not None:
            low = -0.30 if roof else -0.22
            pieces.append(box((-0.506, low, -0.503), (0.506, 0, 0.503), Surface(ground, 6.0, WHITE, 0.3)))
        if not roof:
            pieces.append(box((-0.51, -1, -0.51), (0.51, eaves, 0.51), Surface("concrete", 3.0, grey, 0.0)))
            return join(pieces)
        shade = float(rng.uniform(0.5, 1.1))
        tiles = Surface("roof", 4.0, (shade, shade, shade), 0.0)
        for s in (-1.0, 1.0):
            corners = [
                (0.56 * s, eaves + 0.03, -0.53),
                (0.56 * s, eaves + 0.03, 0.53),
                (0, -1, 0.53),
                (0, -1, -0.53),
            ]
            pieces.append(quad(corners, (0.45 * s, -0.9, 0), tiles))
            gable = [(-0.5, eaves, 0.5 * s), (0.5, eaves, 0.5 * s), (0, -1, 0.5 * s), (0, -1, 0.5 * s)]
            pieces.append(quad(gable, (0, 0, s), plain))
        pieces.append(box((0.15, -0.99, 0.2), (0.22, -0.8, 0.26), Surface("brick", 3.0, grey, 0.0)))
        return join(pieces)

    return make


def _wall(name: str) -> Callable[[np.random.Generator], Mesh]:
    def make(rng: np.random.Generator) -> Mesh:
        cap = Surface("concrete", 2.0, (0.7, 0.7, 0.7), 0.0)
        return join([
            box((-0.5, -0.95, -0.5), (0.5, 0, 0.5), Surface(name, 2.2)),
            box((-0.65, -1, -0.5), (0.65, -0.95, 0.5), cap),
        ])  # fmt: skip

    return make


def _fence(name: str) -> Callable[[np.random.Generator], Mesh]:
    def make(rng: np.random.Generator) -> Mesh:
        corners = [(0, 0, -0.5), (0, 0, 0.5), (0, -1, 0.5), (0, -1, -0.5)]
        made = quad(corners, (1, 0, 0), Surface(name, 1.8))
        return with_holes(made) if _opacity(name) < 1.0 else made

    return make


@cache
def _opacity(name: str) -> float:
    """Mean opacity of a picture."""
    return float(textures.layers()[textures.layer(name), ..., 3].mean()) / 255.0


FENCES = ("planks", "railing", "planks", "pickets", "wire", "railing")


METAL: Colour = (0.30, 0.31, 0.31)


def _rail(rng: np.random.Generator) -> Mesh:
    """A crash barrier along z: a beam of sheet metal at the top, a post in the middle."""
    zinc = Surface("concrete", 1.5, (0.6, 0.62, 0.64), 0.0)
    beam = [
        box((-0.5, -1.0, -0.5), (0.1, -0.78, 0.5), zinc),
        box((-0.5, -0.72, -0.5), (0.1, -0.5, 0.5), zinc),
    ]
    dark = Surface("concrete", 1.5, (0.25, 0.26, 0.27), 0.0)
    back = box((-0.35, -0.95, -0.5), (-0.1, -0.55, 0.5), dark)
    return join([*beam, back, box((-0.1, -0.9, -0.02), (0.5, 0, 0.02), zinc)])


def _pole(rng: np.random.Generator) -> Mesh:
    """A street lamp: height 1, its arm reaches 0.15 towards +x."""
    metal = Surface("plain", colour=METAL, tint=0.3)
    head = box((0.12, -1.0, -0.012), (0.22, -0.985, 0.012), Surface("plain", -1.0, (0.5, 0.5, 0.45), 0.0))
    return join([
        tube((0, 0, 0), (0, -0.98, 0), (0.012, 0.007), metal, 8),
        tube((0, -0.98, 0), (0.2, -1.0, 0), (0.006, 0.005), metal, 4), head,
    ])  # fmt: skip


def _post(rng: np.random.Generator) -> Mesh:
    return tube((0, 0, 0), (0, -1, 0), (0.5, 0.4), Surface("plain", colour=METAL, tint=0.5), 8)


def _sign(name: str) -> Callable[[np.random.Generator], Mesh]:
    """Post of height 1; the plate faces -z (towards a driver who drives along +z)."""

    def make(rng: np.random.Generator) -> Mesh:
        metal = Surface("plain", colour=METAL, tint=0.0)
        size = 0.45 if name == "board" else 0.26
        low, width = -1.0 + size, 0.5 * size * (1.3 if name == "board" else 1.0)
        face = [(-width, low, -0.03), (width, low, -0.03), (width, -1, -0.03), (-width, -1, -0.03)]
        back = [(x, y, -0.02) for x, y, _ in face]
        return join([
            tube((0, 0, 0), (0, -1.0, 0), (0.015, 0.015), metal),
            quad(face, (0, 0, -1), Surface(name, tint=0.0)),
            quad(back, (0, 0, 1), Surface(name, colour=(0.25, 0.25, 0.25), tint=0.0)),
        ])  # fmt: skip

    return make


def _traffic_light(rng: np.random.Generator) -> Mesh:
    dark = Surface("plain", colour=(0.06, 0.07, 0.06), tint=0.0)
    pieces = [tube((0, 0, 0), (0, -0.98, 0), (0.02, 0.017), Surface("plain", colour=METAL, tint=0.0), 8)]
    pieces.append(box((-0.045, -1.0, -0.09), (0.045, -0.74, -0.03), dark))
    lit = rng.integers(3)
    lamps: list[Colour] = [(3.0, 0.12, 0.05), (2.5, 1.1, 0.1), (0.2, 2.5, 0.9)]
    for i, colour in enumerate(lamps):
        off: Colour = (0.03, 0.03, 0.03)
        look = Surface("plain", -1.0, colour if i == lit else off, 0.0)
        y = -0.96 + 0.085 * i
        pieces.append(ball((0, y, -0.09), (0.03, 0.03, 0.012), look, n=6))
    return join(pieces)


def _bin(rng: np.random.Generator) -> Mesh:
    dark = Surface("plain")
    lid = Surface("plain", colour=(0.6, 0.6, 0.6))
    return join(
        [box((-0.45, -0.92, -0.45), (0.45, 0, 0.45), dark), box((-0.5, -1, -0.5), (0.5, -0.92, 0.5), lid)]
    )


def _kerb(rng: np.random.Generator) -> Mesh:
    return box((-0.5, -1, -0.5), (0.5, 0, 0.5), Surface("concrete", 1.0))


WALL_KINDS = ("plaster", "brick", "stone", "concrete")
CONCRETE = WALL_KINDS.index("concrete")
# Functions that make each kind; `Prop.seed` picks one of the variants.
MAKERS: dict[str, tuple[Callable[[np.random.Generator], Mesh], ...]] = {
    "tree": (tree,) * 9 + (conifer,),
    "bush": (bush,) * 4,
    "hedge": (hedge,) * 2,
    "building": (
        _house("house", True, None), _house("shuttered", True, None), _house("house", True, "shop"),
        _house("stone_house", True, "shop"), _house("house", False, "shop"), _house("office", False, None),
        _house("office", False, "shop"), _house("stone_house", False, None),
        _house("shuttered", False, "shop"),
    ),
    "wall": tuple(_wall(name) for name in WALL_KINDS),
    "fence": tuple(_fence(name) for name in FENCES),
    "rail": (_rail,),
    "pole": (_pole,),
    "bollard": (_post,),
    "sign": tuple(_sign(name) for name in ("limit", "warning", "priority", "parking", "board")),
    "traffic_light": (_traffic_light,) * 3,
    "person": (person,) * 6,
    "cyclist": (cyclist,) * 3,
    "bin": (_bin,),
    "kerb": (_kerb,),
}  # fmt: skip

WALLS = np.array([(0.95, 0.92, 0.85), (1.1, 1.1, 1.1), (0.8, 0.8, 0.82), (0.95, 0.82, 0.55),
                  (0.85, 0.62, 0.5),
                  (0.75, 0.55, 0.5), (0.6, 0.62, 0.6), (0.9, 0.75, 0.68)])  # fmt: skip
GREENS = np.array([(1.0, 1.0, 1.0), (0.8, 0.95, 0.8), (1.15, 1.05, 0.7), (0.7, 0.8, 0.7), (1.3, 1.0, 0.6),
                   (1.0, 1.1, 0.9)])  # fmt: skip
CLOTHES = np.array([(0.05, 0.05, 0.06), (0.6, 0.6, 0.6), (0.08, 0.1, 0.2), (0.45, 0.05, 0.05),
                    (0.15, 0.2, 0.3),
                    (0.7, 0.65, 0.55), (0.1, 0.2, 0.12)])  # fmt: skip
GREYS = np.array([(1.0, 1.0, 1.0), (0.7, 0.7, 0.7), (0.5, 0.52, 0.5), (1.2, 1.2, 1.2)])
BINS = np.array([(0.05, 0.05, 0.05), (0.03, 0.07, 0.04), (0.1, 0.06, 0.03), (0.03, 0.05, 0.12)])

# Tints of each kind.
TINTS: dict[str, NDArray[np.float64]] = {
    "tree": GREENS, "bush": GREENS, "hedge": GREENS, "building": WALLS, "wall": WALLS, "person": CLOTHES,
    "cyclist": CLOTHES, "bin": BINS,
}  # fmt: skip


@cache
def mesh(kind: str, variant: int) -> Mesh:
    """The mesh of variant `variant` of a kind."""
    makers = MAKERS[kind]
    return makers[variant](np.random.default_rng([79, list(MAKERS).index(kind), variant]))


def variant(kind: str, seed: int) -> int:
    """Which mesh a prop's seed picks."""
    return seed % len(MAKERS[kind])


def cover(kind: str, variant: int) -> float:
    """Fraction of a thing's outline that is not seen through: below 1 for fences of bars and wires."""
    return _opacity(FENCES[variant]) if kind == "fence" else 1.0


def tint(kind: str, seed: int) -> NDArray[np.float64]:
    """Colour (3,) that multiplies the mesh's own."""
    table = TINTS.get(kind, GREYS)
    mixed = seed * 2654435761 % 2**32  # a pseudo-random number without the cost of a generator
    return np.asarray(table[mixed // 997 % len(table)] * (0.8 + 0.35 * (mixed / 2**32)))
