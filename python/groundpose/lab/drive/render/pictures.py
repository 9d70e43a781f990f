"""What textures are painted with: noise, colour, opacity, soft steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float64]
Generator = np.random.Generator

SIZE = 256


def noise(rng: Generator, power: float = 1.0, low: int = 1) -> Picture:
    """Tileable noise with spectrum 1/f^power above frequency `low`, mean 0, standard deviation 1."""
    f = np.hypot(*np.meshgrid(np.fft.fftfreq(SIZE, 1 / SIZE), np.fft.fftfreq(SIZE, 1 / SIZE)))
    spectrum = np.where(f < low, 0.0, np.maximum(f, 1.0) ** -power)
    out = np.fft.ifft2(np.fft.fft2(rng.normal(size=(SIZE, SIZE))) * spectrum).real
    return np.asarray((out - out.mean()) / out.std())


def coloured(colour: tuple[float, float, float], shade: Picture) -> Picture:
    """RGB (H, W, 3) of one colour, times a shade (H, W)."""
    return np.asarray(np.array(colour) * shade[..., None])


def rgba(rgb: Picture, alpha: Picture | float = 1.0) -> Picture:
    """RGB and opacity, (H, W, 4)."""
    return np.asarray(np.dstack([rgb, np.broadcast_to(alpha, (SIZE, SIZE))]))


def smooth(low: float, high: float, x: Picture) -> Picture:
    """A step from 0 at `low` to 1 at `high` with a continuous slope."""
    s = np.clip((x - low) / (high - low), 0.0, 1.0)
    return np.asarray(s * s * (3.0 - 2.0 * s))
