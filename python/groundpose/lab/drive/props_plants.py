"""Meshes of plants beside roads, of unit size as in `props`."""

from __future__ import annotations

import numpy as np

from groundpose.lab.drive.props_shapes import Colour, Mesh, Surface, ball, box, cards, join, tube


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


def tree(rng: np.random.Generator) -> Mesh:
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


def conifer(rng: np.random.Generator) -> Mesh:
    """Height 1; needles around a trunk."""
    pieces = [tube((0, 0, 0), (0, -0.9, 0), (0.02, 0.006), Surface("bark", tint=0.0))]
    height = rng.uniform(0.08, 1.0, size=150) ** 0.8
    turn, r = rng.uniform(0, 2 * np.pi, size=150), (1.02 - height) * 0.5 * rng.uniform(0.5, 1.0, size=150)
    at = np.stack([r * np.cos(turn), -height, r * np.sin(turn)], 1)
    outward = np.stack([np.cos(turn), -0.5 + 0 * turn, np.sin(turn)], 1)
    shade = np.clip(0.3 + 1.2 * r + 0.1 * rng.normal(size=150), 0.1, 1.1)
    core = join([ball((0, -0.35, 0), (0.25, 0.3, 0.25), Surface("hedge", colour=(0.2, 0.2, 0.2)), rng)])
    return join([*pieces, core, cards(at, outward, 0.2 * np.ones(150), shade, "needles", rng)])


def bush(rng: np.random.Generator) -> Mesh:
    """Twigs down to the ground."""
    return join(_crown(rng, 70, (0, -0.45, 0), (0.5, 0.5, 0.5), 0.34, "foliage"))


def hedge(rng: np.random.Generator) -> Mesh:
    """One metre of hedge stretched along z: a body and twigs that break its outline."""
    body = box((-0.45, -0.95, -0.5), (0.45, 0, 0.5), Surface("hedge", 1.6, (0.8, 0.8, 0.8)))
    n = 90
    at = np.stack([rng.choice([-0.45, 0.45], n), -rng.random(n), rng.uniform(-0.5, 0.5, n)], 1)
    top = rng.random(n) < 0.4
    at[top, 0], at[top, 1] = rng.uniform(-0.4, 0.4, top.sum()), -0.95
    outward = np.where(top[:, None], [0.0, -1.0, 0.0], np.sign(at) * [1.0, 0.0, 0.0])
    shade = 0.35 + 0.6 * -at[:, 1] + 0.1 * rng.normal(size=n)
    return join([body, cards(at, outward, 0.17 * np.ones(n), shade, "foliage", rng)])
