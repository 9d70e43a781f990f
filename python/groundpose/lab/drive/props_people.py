"""Meshes of people on foot and on bicycles, of unit size as in `props`."""

from __future__ import annotations

import itertools

import numpy as np

from groundpose.lab.drive.props_shapes import Mesh, Surface, ball, join, tube


def person(rng: np.random.Generator) -> Mesh:
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


def cyclist(rng: np.random.Generator) -> Mesh:
    """A person of three quarters of the height on two wheels, riding along z."""
    rider = person(rng)
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
