"""Pictures in which there is nothing at all: colours, gradients, noise, writing, shapes like walls.

Every function of `PATTERNS` draws floats (height, width, 3), 0 to 255; `pattern` picks one of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from groundpose._checks import FloatArray
from groundpose.keypoints.codec import ByteArray

Draw = Callable[[np.random.Generator, int, int], FloatArray]


def pattern(rng: np.random.Generator, width: int, height: int) -> ByteArray:
    """One of `PATTERNS` (height, width, 3), often blurred or with a little noise, as a camera would add."""
    drawn = PATTERNS[int(rng.integers(len(PATTERNS)))](rng, width, height)
    if rng.random() < 0.3:
        drawn = _blurred(drawn, rng.uniform(0.005, 0.03) * width)
    drawn = drawn + rng.choice([0.0, 1.0, 4.0]) * rng.normal(size=drawn.shape)
    return _bytes(drawn)


def _grey(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    return np.full((height, width, 3), float(rng.integers(256)))


def _colour(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    return np.broadcast_to(_any_colour(rng), (height, width, 3))


def _gradient(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    """From one colour to another in any direction."""
    position = _phase(rng, width, height)
    position = (position - position.min()) / np.ptp(position)
    return _mixed(rng, position ** rng.uniform(0.5, 2.0))


def _checkerboard(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    turn, side = rng.uniform(0, np.pi), rng.uniform(0.03, 0.4)
    x, y = _grid(width, height)
    u, v = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    return _mixed(rng, (np.floor(u / side) + np.floor(v / side)) % 2)


def _stripes(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    """Sharp or soft."""
    wave = np.sin(2 * np.pi * _phase(rng, width, height) / rng.uniform(0.03, 0.6))
    return _mixed(rng, 0.5 + 0.5 * np.clip(wave * rng.choice([1.0, 20.0]), -1.0, 1.0))


def _noise(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    """Amplitudes fall with the frequency to a power of 0 (white) to 2.5 (clouds); grey or in colours."""
    channels = int(rng.choice([1, 3]))
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None])
    frequency[0, 0] = 1.0 / max(width, height)
    spectrum = np.fft.rfft2(rng.normal(size=(height, width, channels)), axes=(0, 1))
    power = float(rng.choice([0.0, 0.5, 1.0, 1.5, 2.0, 2.5]))
    values = np.fft.irfft2(spectrum * frequency[..., None] ** -power, s=(height, width), axes=(0, 1))
    values = values / max(float(values.std()), 1e-9) * rng.uniform(8, 70) + rng.uniform(40, 215)
    return np.broadcast_to(values, (height, width, 3))


def _blocks(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    """A few large cells of random colours, as a strongly compressed picture has, with hard or soft edges."""
    cells = rng.integers(0, 256, (int(rng.integers(2, 16)), int(rng.integers(2, 20)), 3), dtype=np.uint8)
    smooth = Image.Resampling.BICUBIC if rng.random() < 0.4 else Image.Resampling.NEAREST
    return np.asarray(Image.fromarray(cells).resize((width, height), smooth), dtype=float)


def _writing(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    """Lines of short strokes."""
    picture, draw = _canvas(rng, width, height)
    ink, line = _ink(rng), rng.uniform(0.05, 0.25) * height
    for y in np.arange(0.3 * line, height, 1.5 * line):
        x = 0.3 * line
        while x < width:
            if rng.random() < 0.85:
                points = np.array([x, y]) + rng.random((4, 2)) * [0.5 * line, line]
                draw.line([tuple(p) for p in points.tolist()], ink, max(1, round(0.12 * line)))
            x += 0.65 * line
    return np.asarray(picture, dtype=float)


def _blobs(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    """Blurred ellipses."""
    picture, draw = _canvas(rng, width, height)
    for _ in range(int(rng.integers(1, 14))):
        middle, half = rng.random(2) * [width, height], rng.uniform(0.03, 0.35, 2) * width
        draw.ellipse([*(middle - half).tolist(), *(middle + half).tolist()], _ink(rng))
    return _blurred(np.asarray(picture, dtype=float), rng.uniform(0.01, 0.08) * width)


def _facade(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    """Rows of rectangles with frames, and lines across, as windows and cornices are."""
    picture, draw = _canvas(rng, width, height)
    columns, rows = (int(n) for n in rng.integers(1, 8, 2))
    ink, frame, gap = _ink(rng), _ink(rng), rng.uniform(0.1, 0.4, 2)
    for i in range(columns):
        for j in range(rows):
            left, right = ((i + 0.5 + s * (0.5 - 0.5 * gap[0])) * width / columns for s in (-1, 1))
            top, bottom = ((j + 0.5 + s * (0.5 - 0.5 * gap[1])) * height / rows for s in (-1, 1))
            draw.rectangle([left, top, right, bottom], ink, frame, max(1, round(0.01 * width)))
    for _ in range(int(rng.integers(0, 5))):
        y = rng.random() * height
        draw.line([0, y, width, y + rng.normal(0.0, 0.05) * height], _ink(rng), int(rng.integers(1, 5)))
    return np.asarray(picture, dtype=float)


def _lines(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    """Straight lines and rectangles anywhere."""
    picture, draw = _canvas(rng, width, height)
    for _ in range(int(rng.integers(2, 25))):
        a, b = (rng.uniform(-0.1, 1.1, 2) * [width, height] for _ in range(2))
        if rng.random() < 0.4:
            draw.rectangle([*np.minimum(a, b).tolist(), *np.maximum(a, b).tolist()], _ink(rng))
        else:
            draw.line([*a.tolist(), *b.tolist()], _ink(rng), int(rng.integers(1, max(2, width // 15))))
    return np.asarray(picture, dtype=float)


PATTERNS: tuple[Draw, ...] = (
    *(_grey, _colour, _gradient, _checkerboard, _stripes, _noise, _noise, _noise),
    *(_blocks, _writing, _blobs, _facade, _lines),
)
"""All alike often; noise thrice, because it has many spectra."""


def _any_colour(rng: np.random.Generator) -> FloatArray:
    """Often nearly grey, as most of a street is."""
    colour = rng.uniform(0, 255, 3)
    return np.asarray(colour.mean() + rng.choice([0.1, 0.3, 1.0]) * (colour - colour.mean()))


def _mixed(rng: np.random.Generator, weight: FloatArray) -> FloatArray:
    """Two colours by a weight (height, width), 0 to 1."""
    a, b = _any_colour(rng), _any_colour(rng)
    return np.asarray(a + weight[..., None] * (b - a))


def _grid(width: int, height: int) -> tuple[FloatArray, FloatArray]:
    """Coordinates x, y as fractions of the width."""
    y, x = np.mgrid[:height, :width] / width
    return x, y


def _phase(rng: np.random.Generator, width: int, height: int) -> FloatArray:
    """Distance along a random direction, as a fraction of the width."""
    (x, y), turn = _grid(width, height), rng.uniform(0, 2 * np.pi)
    return np.asarray(x * np.cos(turn) + y * np.sin(turn))


def _canvas(rng: np.random.Generator, width: int, height: int) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    picture = Image.fromarray(_bytes(_gradient(rng, width, height)))
    return picture, ImageDraw.Draw(picture)


def _ink(rng: np.random.Generator) -> tuple[int, ...]:
    return tuple(int(c) for c in np.clip(_any_colour(rng), 0, 255))


def _blurred(picture: FloatArray, radius: float) -> FloatArray:
    return np.asarray(Image.fromarray(_bytes(picture)).filter(ImageFilter.GaussianBlur(radius)), dtype=float)


def _bytes(picture: FloatArray) -> ByteArray:
    return np.clip(picture, 0, 255).astype(np.uint8)
