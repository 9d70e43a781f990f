"""Meshes of things beside roads: trees, hedges, houses, walls, poles, signs, people.

Each has unit size in the object frame (x right, y down, z forward, standing on y = 0) and is stretched to the
size of its `Prop`. The texture of walls and facades repeats every metre, whatever the size.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from groundpose.lab.drive.props_shapes import (
    WHITE,
    Colour,
    Mesh,
    Surface,
    ball,
    box,
    cards,
    join,
    quad,
    tube,
    with_holes,
)  # fmt: skip
from groundpose.lab.drive.render import textures


def _crown(
    rng: np.random.Generator, count: int, centre: Colour, radius: Colour, card: float, name: str
) -> list[Mesh]:
    """Twigs in clumps on an ellipsoid around a dark core."""
    clumps = rng.normal(size=(max(6, count // 14), 3))
    clumps /= np.linalg.norm(clumps, axis=1, keepdims=True)
    clumps *= rng.uniform(0.45, 0.85, size=(len(clumps), 1))
    at = clumps[rng.integers(len(clumps), size=count)] + 0.22 * rng.normal(size=(count, 3))
    length = np.linalg.norm(at, axis=1)
    at *= np.minimum(1.0, 1.05 / length)[:, None]
    outward = at / np.linalg.norm(at, axis=1, keepdims=True) + 0.3 * rng.normal(size=(count, 3))
    # The inside and the underside are dark, because the crown shades itself.
    shade = np.clip(0.22 + 0.6 * length**2 - 0.3 * at[:, 1] + 0.12 * rng.normal(size=count), 0.12, 1.15)
    size = card * rng.uniform(0.7, 1.3, size=count)
    core = ball(
        centre, (0.55 * radius[0], 0.6 * radius[1], 0.55 * radius[2]),
        Surface("hedge", colour=(0.25, 0.25, 0.25)), rng,
    )  # fmt: skip
    points = np.array(centre) + at * np.array(radius)
    return [core, cards(points, outward, size, shade, name, rng)]


def _tree(rng: np.random.Generator) -> Mesh:
    """Height 1; the trunk ends in the crown."""
    bark = Surface("bark", tint=0.0)
    bare = rng.uniform(0.18, 0.36)
    lean = 0.03 * rng.normal(size=2)
    top = (float(lean[0]), -0.7, float(lean[1]))
    pieces = [tube((0, 0, 0), top, (0.022, 0.012), bark)]
    for _ in range(4):
        turn, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0.12, 0.3)
        end = (reach * np.cos(turn), -rng.uniform(bare + 0.15, 0.8), reach * np.sin(turn))
        pieces.append(tube((0, -bare, 0), end, (0.012, 0.004), bark, 4))
    middle = -0.5 * (1.0 + bare)
    return join(pieces + _crown(rng, 190, (0, middle, 0), (0.5, 0.5 * (1 - bare), 0.5), 0.16, "foliage"))


def _conifer(rng: np.random.Generator) -> Mesh:
    pieces = [tube((0, 0, 0), (0, -0.9, 0), (0.02, 0.006), Surface("bark", tint=0.0))]
    height = rng.uniform(0.08, 1.0, size=150) ** 0.8
    turn, r = rng.uniform(0, 2 * np.pi, size=150), (1.02 - height) * 0.5 * rng.uniform(0.5, 1.0, size=150)
    at = np.stack([r * np.cos(turn), -height, r * np.sin(turn)], 1)
    outward = np.stack([np.cos(turn), -0.5 + 0 * turn, np.sin(turn)], 1)
    shade = np.clip(0.3 + 1.2 * r + 0.1 * rng.normal(size=150), 0.1, 1.1)
    core = join([ball((0, -0.35, 0), (0.25, 0.3, 0.25), Surface("hedge", colour=(0.2, 0.2, 0.2)), rng)])
    return join([*pieces, core, cards(at, outward, 0.2 * np.ones(150), shade, "needles", rng)])


def _bush(rng: np.random.Generator) -> Mesh:
    return join(_crown(rng, 70, (0, -0.45, 0), (0.5, 0.5, 0.5), 0.34, "foliage"))


def _hedge(rng: np.random.Generator) -> Mesh:
    """One metre of hedge stretched along z: a body and twigs that break its outline."""
    body = box((-0.45, -0.95, -0.5), (0.45, 0, 0.5), Surface("hedge", 1.6, (0.8, 0.8, 0.8)))
    n = 90
    at = np.stack([rng.choice([-0.45, 0.45], n), -rng.random(n), rng.uniform(-0.5, 0.5, n)], 1)
    top = rng.random(n) < 0.4
    at[top, 0], at[top, 1] = rng.uniform(-0.4, 0.4, top.sum()), -0.95
    outward = np.where(top[:, None], [0.0, -1.0, 0.0], np.sign(at) * [1.0, 0.0, 0.0])
    shade = 0.35 + 0.6 * -at[:, 1] + 0.1 * rng.normal(size=n)
    return join([body, cards(at, outward, 0.17 * np.ones(n), shade, "foliage", rng)])


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


def _person(rng: np.random.Generator) -> Mesh:
    """Height 1; the upper clothes take the tint."""
    skin = Surface("plain", colour=tuple(np.array([0.55, 0.36, 0.27]) * rng.uniform(0.5, 1.3)), tint=0.0)
    trousers = Surface(
        "plain", colour=tuple(rng.choice([0.03, 0.06, 0.15]) * np.array([0.9, 1.0, 1.4])), tint=0.0
    )
    hair = Surface("plain", colour=tuple(rng.choice([0.03, 0.08, 0.3]) * np.array([1.2, 1.0, 0.8])), tint=0.0)
    shirt = Surface("plain")
    step = rng.uniform(0.0, 0.12)
    pieces = [
        ball((0, -0.935, 0), (0.045, 0.062, 0.052), skin),
        ball((0, -0.962, -0.012), (0.046, 0.042, 0.052), hair),
        ball((0, -0.66, 0), (0.105, 0.19, 0.07), shirt), ball((0, -0.5, 0), (0.09, 0.08, 0.07), trousers),
        tube((0, -0.82, 0), (0, -0.9, 0), (0.03, 0.03), skin),
    ]  # fmt: skip
    for s in (-1.0, 1.0):
        hip, knee, foot = (
            (0.05 * s, -0.5, 0.0),
            (0.055 * s, -0.27, 0.6 * s * step),
            (0.05 * s, -0.02, s * step),
        )
        hand = (0.14 * s, -0.46, -s * step)
        pieces += [
            tube(hip, knee, (0.055, 0.042), trousers), tube(knee, foot, (0.042, 0.03), trousers),
            ball((0.05 * s, -0.02, s * step + 0.03), (0.025, 0.022, 0.07), hair),
            tube((0.105 * s, -0.8, 0), hand, (0.036, 0.026), shirt), ball(hand, (0.022, 0.035, 0.025), skin),
        ]  # fmt: skip
    return join(pieces)


def _cyclist(rng: np.random.Generator) -> Mesh:
    """A person of three quarters of the height on two wheels, riding along z."""
    rider = _person(rng)
    rider.vertices[:, 1] = 0.86 * rider.vertices[:, 1] - 0.16
    rider.vertices[:, 2] += 0.25 * np.maximum(-rider.vertices[:, 1] - 0.6, 0.0)
    dark = Surface("plain", colour=(0.03, 0.03, 0.03), tint=0.0)
    pieces = [rider]
    angle = np.linspace(0, 2 * np.pi, 13)
    for z in (-0.3, 0.32):
        ring = [(0.0, -0.19 + 0.18 * float(np.sin(a)), z + 0.18 * float(np.cos(a))) for a in angle]
        pieces += [tube(a, b, (0.01, 0.01), dark, 4) for a, b in itertools.pairwise(ring)]
    frame = Surface("plain", tint=1.0)
    lines = [((0, -0.19, -0.3), (0, -0.45, -0.08)), ((0, -0.45, -0.08), (0, -0.45, 0.22)),
             ((0, -0.2, 0.02), (0, -0.45, 0.22)), ((0, -0.55, 0.24), (0, -0.19, 0.32))]  # fmt: skip
    return join(pieces + [tube(a, b, (0.012, 0.012), frame, 4) for a, b in lines])


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
    "tree": (_tree,) * 9 + (_conifer,),
    "bush": (_bush,) * 4,
    "hedge": (_hedge,) * 2,
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
    "person": (_person,) * 6,
    "cyclist": (_cyclist,) * 3,
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
