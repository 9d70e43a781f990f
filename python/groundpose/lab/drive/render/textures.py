"""Procedural textures: tileable pictures of asphalt, walls, facades, leaves.

Every picture is 256 x 256 RGBA. The fourth channel is the opacity of leaves, fences and signs, and the
fraction of reflecting glass of facades.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundpose.lab.drive import cache as disk
from groundpose.lab.drive.render import pictures
from groundpose.lab.drive.render.pictures import (
    SIZE,
    Generator,
    Picture,
    coloured,
    noise,
    rgba,
    smooth,
)

_ROW, _COLUMN = np.mgrid[0:SIZE, 0:SIZE] / SIZE


def _asphalt(rng: Generator) -> Picture:
    stones = 1.0 + 0.16 * noise(rng, 0.2, 20) + 0.06 * noise(rng, 1.2)
    return rgba(coloured((0.37, 0.37, 0.38), stones))


def _cracks(rng: Generator) -> Picture:
    """Opacity of cracks and of sealed joints in R, G; large patches in B, stains in A."""
    warp = 0.1 * noise(rng, 1.6)
    fine = 1.0 - smooth(0.0, 0.03, np.abs(noise(rng, 1.7) + warp)) * 1.0
    fine *= smooth(0.2, 0.9, noise(rng, 1.8))
    tar = 1.0 - smooth(0.01, 0.025, np.abs(noise(rng, 2.2)))
    tar *= smooth(0.1, 0.5, noise(rng, 2.0))
    patch = smooth(0.7, 0.74, noise(rng, 2.0))
    stain = smooth(0.0, 2.5, noise(rng, 1.6))
    return np.dstack([fine, tar, patch, stain])


def _blocks(
    rng: Generator, rows: int, columns: int, joint: float, shift: float, vary: float
) -> tuple[Picture, Picture]:
    """Random brightness per block, and the fraction of each pixel covered by a joint."""
    y = _ROW * rows
    row = np.floor(y).astype(int)
    x = _COLUMN * columns + shift * (row % 2)
    column = np.floor(x).astype(int) % columns
    bright = 1.0 + vary * rng.normal(size=(rows, columns))[row, column]
    edge = np.minimum(
        np.minimum(x % 1, 1 - x % 1) * SIZE / columns, np.minimum(y % 1, 1 - y % 1) * SIZE / rows
    )
    return bright, 1.0 - smooth(0.4 * joint, joint, edge)


def _tiles(
    rows: int,
    columns: int,
    joint: float,
    shift: float,
    vary: float,
    colour: tuple[float, float, float],
    joint_colour: float,
) -> Callable[[Generator], Picture]:
    def make(rng: Generator) -> Picture:
        bright, gap = _blocks(rng, rows, columns, joint, shift, vary)
        grain = bright * (1.0 + 0.08 * noise(rng, 0.6) + 0.06 * noise(rng, 1.8))
        rgb = coloured(colour, grain) * (1.0 - gap[..., None]) + joint_colour * gap[..., None]
        return rgba(rgb)

    return make


def _grass(rng: Generator) -> Picture:
    blades = noise(rng, 0.3, 8)
    patches = noise(rng, 1.6)
    green = np.array([0.27, 0.30, 0.17]) * (1.0 + 0.25 * blades + 0.12 * patches)[..., None]
    dry = np.array([0.42, 0.38, 0.22]) * (1.0 + 0.2 * blades)[..., None]
    fraction = smooth(0.3, 2.2, patches)[..., None]
    return rgba(green * (1 - fraction) + dry * fraction)


def _plain(colour: tuple[float, float, float], fine: float, coarse: float) -> Callable[[Generator], Picture]:
    def make(rng: Generator) -> Picture:
        return rgba(coloured(colour, 1.0 + fine * noise(rng, 0.4, 4) + coarse * noise(rng, 1.7)))

    return make


def _planks(rng: Generator) -> Picture:
    bright, gap = _blocks(rng, 1, 12, 2.0, 0.0, 0.14)
    streak = np.repeat(noise(rng, 0.6)[:1], SIZE, axis=0)
    return rgba(coloured((0.40, 0.30, 0.22), bright * (1 + 0.12 * streak)) * (1 - 0.8 * gap[..., None]))


def _railing(rng: Generator) -> Picture:
    bars = np.abs((_COLUMN * 8) % 1 - 0.5) < 0.1
    rails = (np.abs(_ROW - 0.1) < 0.03) | (np.abs(_ROW - 0.85) < 0.03)
    return rgba(coloured((0.25, 0.25, 0.25), np.ones((SIZE, SIZE))), (bars | rails).astype(float))


def _pickets(rng: Generator) -> Picture:
    bars = np.abs((_COLUMN * 12) % 1 - 0.5) < 0.27
    rails = (np.abs(_ROW - 0.12) < 0.025) | (np.abs(_ROW - 0.42) < 0.025)
    colour = (0.62, 0.60, 0.56) * (1.0 + 0.1 * noise(rng, 0.6))[..., None]
    return rgba(colour * (1.0 - 0.25 * (rails & ~bars))[..., None], (bars | rails).astype(float))


def _wire(rng: Generator) -> Picture:
    """A mesh of wires, coarser than real ones, which would be narrower than a pixel everywhere."""
    across = [np.abs(((_COLUMN + sign * _ROW) * 16) % 1 - 0.5) < 0.05 for sign in (-1, 1)]
    wires = across[0] | across[1] | (_COLUMN < 0.02)
    return rgba(coloured((0.45, 0.47, 0.46), np.ones((SIZE, SIZE))), wires.astype(float))


def _leaves(rng: Generator, count: int, length: float, colour: tuple[float, float, float]) -> Picture:
    """Many leaves as ellipses, later ones on top; alpha 0 between them."""
    rgb, alpha = np.zeros((SIZE, SIZE, 3)) + np.array(colour) * 0.5, np.zeros((SIZE, SIZE))
    for _ in range(count):
        radius = 0.46 * np.sqrt(rng.random())
        turn = rng.uniform(0.0, 2 * np.pi)
        x, y = 0.5 + radius * np.cos(turn), 0.5 + radius * np.sin(turn)
        angle = rng.uniform(0.0, np.pi)
        dx, dy = _COLUMN - x, _ROW - y
        along, across = dx * np.cos(angle) + dy * np.sin(angle), dy * np.cos(angle) - dx * np.sin(angle)
        size = length * rng.uniform(0.6, 1.2)
        inside = (along / size) ** 2 + (across / (0.42 * size)) ** 2 < 1.0
        tint = rng.normal(1.0, 0.22) * (1.0 + 0.5 * across[inside] / size)
        rgb[inside] = np.array(colour) * (1.0 + np.array([0.12, 0.0, 0.0]) * rng.normal()) * tint[:, None]
        alpha[inside] = 1.0
    return rgba(rgb, alpha)


def _foliage(rng: Generator) -> Picture:
    return _leaves(rng, 170, 0.055, (0.30, 0.36, 0.15))


def _needles(rng: Generator) -> Picture:
    return _leaves(rng, 260, 0.06, (0.19, 0.26, 0.16))


def _hedge(rng: Generator) -> Picture:
    leaf = noise(rng, 0.5, 10)
    deep = smooth(-0.2, 1.2, noise(rng, 1.1, 4) + 0.6 * leaf)
    return rgba(coloured((0.24, 0.30, 0.12), 0.35 + 0.9 * deep))


def _bark(rng: Generator) -> Picture:
    ridges = np.repeat(noise(rng, 0.8, 4)[::8], 8, axis=0)
    return rgba(coloured((0.27, 0.24, 0.20), 1.0 + 0.3 * ridges + 0.15 * noise(rng, 0.6)))


def _facade(
    wall: tuple[float, float, float],
    window: tuple[float, float, float, float],
    bars: int,
    frame: float,
    sill: bool,
    shutter: bool = False,
) -> Callable[[Generator], Picture]:
    """Two by two bays of 3 m; `window` = left, top, right, bottom as fractions of a bay."""

    def make(rng: Generator) -> Picture:
        rgb = coloured(wall, 1.0 + 0.03 * noise(rng, 0.6) + 0.05 * noise(rng, 2.0))
        glass = np.zeros((SIZE, SIZE))
        left, top, right, bottom = window
        for bay in range(4):
            x, y = _COLUMN * 2 - bay % 2, _ROW * 2 - bay // 2
            hole = (x > left) & (x < right) & (y > top) & (y < bottom)
            rim = (x > left - 0.04) & (x < right + 0.04) & (y > top - 0.04) & (y < bottom + 0.04)
            rgb[rim & ~hole] *= 1.25 if sill else 0.8
            u, v = (x - left) / (right - left), (y - top) / (bottom - top)
            border = np.minimum(np.minimum(u, 1 - u), np.minimum(v, 1 - v))
            bar = (np.abs((u * bars) % 1 - 0.5) > 0.5 - 0.04 * bars) | (np.abs(v - 0.3) < 0.03)
            pane = hole & (border > 0.05) & ~bar
            rgb[hole] = frame
            blind = rng.random() * 0.8 if rng.random() < 0.4 else 0.0
            curtain = rng.uniform(0.08, 0.3)
            rgb[pane] = np.where(v[pane] < blind, 0.55, 0.05 + curtain * (np.abs(u[pane] - 0.5) > 0.33))[
                :, None
            ]
            glass[pane & (v >= blind)] = 1.0
            rgb[hole & (v < 0.07)] *= 0.4  # the shadow of the lintel
            if sill:
                rgb[(x > left - 0.06) & (x < right + 0.06) & (y > bottom) & (y < bottom + 0.035)] = 0.62
                under = (x > left - 0.05) & (x < right + 0.05) & (y > bottom + 0.035) & (y < bottom + 0.07)
                rgb[under] *= 0.7
            if shutter:
                side = ((x > left - 0.2) & (x < left - 0.05)) | ((x > right + 0.05) & (x < right + 0.2))
                rgb[side & (y > top) & (y < bottom)] = (0.25, 0.28, 0.22)
        return rgba(np.clip(rgb, 0.0, 1.0), 1.0 - glass)

    return make


def _sign(kind: str) -> Callable[[Generator], Picture]:
    red, white, blue, yellow, black = (
        (0.75, 0.05, 0.06), (0.92, 0.92, 0.92), (0.05, 0.2, 0.6), (0.95, 0.75, 0.1), (0.05, 0.05, 0.05),
    )  # fmt: skip

    def make(rng: Generator) -> Picture:
        x, y = _COLUMN - 0.5, _ROW - 0.5
        r = np.hypot(x, y)
        rgb, alpha = np.zeros((SIZE, SIZE, 3)), np.zeros((SIZE, SIZE))
        shapes: dict[str, list[tuple[NDArray[np.bool_], tuple[float, float, float]]]] = {
            "limit": [
                (r < 0.48, red),
                (r < 0.37, white),
                ((np.abs(np.abs(x) - 0.11) < 0.07) & (np.abs(y) < 0.18) & (np.abs(np.abs(x) - 0.11) > 0.03)
                 | ((np.abs(np.abs(x) - 0.11) < 0.07) & (np.abs(np.abs(y) - 0.16) < 0.025)), black),
            ],
            "warning": [
                ((y < 0.42) & (y > -0.48 + 1.8 * np.abs(x) * 1.0), red),
                ((y < 0.34) & (y > -0.32 + 1.8 * np.abs(x)), white),
                ((np.abs(x) < 0.03) & (np.abs(y - 0.1) < 0.16), black),
            ],
            "priority": [
                (np.abs(x) + np.abs(y) < 0.48, white), (np.abs(x) + np.abs(y) < 0.36, yellow),
            ],
            "parking": [
                ((np.abs(x) < 0.46) & (np.abs(y) < 0.46), blue),
                ((np.abs(x + 0.1) < 0.05) & (np.abs(y) < 0.32), white),
                ((np.abs(np.hypot(x, y + 0.14) - 0.14) < 0.045) & (x > -0.1), white),
            ],
            "board": [
                ((np.abs(x) < 0.49) & (np.abs(y) < 0.49), white),
                ((np.abs(x) < 0.4) & (np.abs(y) < 0.4) & ((_ROW * 5) % 1 < 0.35)
                 & (noise(rng, 0.9)[np.arange(SIZE) // 51 * 51] > -0.2), black),
                ((np.abs(x) < 0.49) & (np.abs(y + 0.36) < 0.09), yellow),
            ],
        }  # fmt: skip
        for mask, colour in shapes[kind]:
            rgb[mask], alpha[mask] = colour, 1.0
        return rgba(rgb, alpha)

    return make


# The layers of the texture array, in order; walls and hedges are tinted by their prop.
LAYERS: dict[str, Callable[[Generator], Picture]] = {
    "plain": _plain((0.8, 0.8, 0.8), 0.02, 0.03),
    "asphalt": _asphalt,
    "cracks": _cracks,
    "slabs": _tiles(4, 4, 2.0, 0.5, 0.06, (0.47, 0.46, 0.44), 0.25),
    "cobbles": _tiles(16, 16, 3.0, 0.5, 0.12, (0.40, 0.39, 0.38), 0.18),
    "pavers": _tiles(8, 4, 2.0, 0.5, 0.08, (0.46, 0.40, 0.37), 0.25),
    "grass": _grass,
    "soil": _plain((0.33, 0.28, 0.22), 0.2, 0.12),
    "concrete": _plain((0.55, 0.54, 0.52), 0.05, 0.07),
    "plaster": _plain((0.72, 0.71, 0.69), 0.03, 0.06),
    "brick": _tiles(16, 6, 2.0, 0.5, 0.12, (0.47, 0.25, 0.19), 0.45),
    "stone": _tiles(8, 4, 3.0, 0.5, 0.13, (0.48, 0.46, 0.42), 0.22),
    "planks": _planks,
    "railing": _railing,
    "roof": _tiles(16, 16, 2.0, 0.0, 0.14, (0.36, 0.20, 0.16), 0.14),
    "foliage": _foliage,
    "needles": _needles,
    "hedge": _hedge,
    "bark": _bark,
    "house": _facade((0.72, 0.70, 0.66), (0.3, 0.22, 0.7, 0.72), 2, 0.85, True),
    "shuttered": _facade((0.74, 0.69, 0.60), (0.33, 0.2, 0.67, 0.72), 2, 0.75, True, True),
    "office": _facade((0.52, 0.53, 0.54), (0.08, 0.25, 0.92, 0.8), 3, 0.25, False),
    "shop": _facade((0.38, 0.36, 0.34), (0.06, 0.2, 0.94, 0.9), 2, 0.2, False),
    "stone_house": _facade((0.52, 0.45, 0.38), (0.28, 0.15, 0.72, 0.8), 2, 0.7, True),
    "limit": _sign("limit"),
    "warning": _sign("warning"),
    "priority": _sign("priority"),
    "parking": _sign("parking"),
    "board": _sign("board"),
    "pickets": _pickets,
    "wire": _wire,
}


def layer(name: str) -> int:
    """Index of a layer."""
    return list(LAYERS).index(name)


@cache
def layers() -> NDArray[np.uint8]:
    """All layers, (L, 256, 256, 4) uint8, from the cache on disk: painting them takes as long as a frame."""
    version = disk.version_folder("textures", disk.fingerprint((Path(__file__), Path(pictures.__file__))))
    return disk.arrays(f"{version}/layers", frozenset(("layers",)), _painted)["layers"]


def _painted() -> disk.Arrays:
    made = [make(np.random.default_rng([77, i])) for i, make in enumerate(LAYERS.values())]
    return {"layers": np.clip(np.stack(made) * 255.0 + 0.5, 0, 255).astype(np.uint8)}


@cache
def noise_texture() -> NDArray[np.uint8]:
    """Four tileable noises, (256, 256, 4): fine grain, clouds, wide clouds, middle scale; mean 0.5."""
    rng = np.random.default_rng(78)
    channels = [noise(rng, 0.0), noise(rng, 1.4), noise(rng, 2.0), noise(rng, 0.8, 4)]
    return np.clip(np.dstack(channels) * 42.0 + 127.5, 0, 255).astype(np.uint8)
