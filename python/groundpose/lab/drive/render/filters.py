"""Pictures as arrays: blur, shift, resampling, display curve."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow

Radiance = NDArray[np.float32]
Image = NDArray[np.uint8]


def curve(x: Radiance, contrast: float) -> Radiance:
    """sRGB-like curve; `contrast` bends it into an S that darkens shadows and brightens highlights,
    above 1 until both lose all detail."""
    y = np.clip(x, 0.0, 1.0) ** np.float32(1.0 / 2.2)
    return np.asarray(np.clip(y + np.float32(contrast) * (y * y * (3 - 2 * y) - y), 0.0, 1.0))


def mean_of_channels(x: Radiance) -> Radiance:
    """(H, W, 1), to the bit `x.mean(axis=2, keepdims=True)`, which is slow along an axis of three."""
    return np.asarray((x[..., :1] + x[..., 1:2] + x[..., 2:]) / np.float32(3.0))


def as_bytes(x: Radiance) -> Image:
    """0 to 1 as 8 bits."""
    return np.asarray(np.clip(x * 255.0 + 0.5, 0, 255).astype(np.uint8))


def blur(x: Radiance, sigma: float) -> Radiance:
    """Separable Gaussian blur; a wide one as three box filters (Wells, 1986)."""
    if sigma < 0.15:
        return x
    reach = min(math.ceil(2.5 * sigma), 18)
    offsets = np.arange(-reach, reach + 1)
    weights = np.exp(-0.5 * (offsets / sigma) ** 2)
    weights = (weights / weights.sum()).astype(np.float32)
    for axis in (0, 1):
        pad = [(reach, reach) if a == axis else (0, 0) for a in range(3)]
        wide, n = np.pad(x, pad, mode="edge"), x.shape[axis]
        take = [slice(None)] * 3
        out, part = np.zeros_like(x), np.empty_like(x)
        for k, w in enumerate(weights):
            take[axis] = slice(k, k + n)
            out += np.multiply(w, wide[tuple(take)], out=part)
        x = out
    return x


def scaled_to(x: Radiance, shape: tuple[int, int]) -> Radiance:
    """Resampled to (height, width): averaged down, interpolated up."""
    size = shape[1], shape[0]
    channels = [
        Pillow.fromarray(np.ascontiguousarray(x[..., c])).resize(size, Pillow.Resampling.BILINEAR)
        for c in range(x.shape[2])
    ]
    return np.stack([np.asarray(c) for c in channels], axis=2)


def shifted(x: Radiance, dx: float, dy: float) -> Radiance:
    """Shifted by any number of pixels, linear between pixels, edges repeated."""
    for axis, shift in ((1, dx), (0, dy)):
        if abs(shift) < 1e-3:
            continue
        low = math.floor(shift)
        fraction = np.float32(shift - low)
        index = np.arange(x.shape[axis])
        a = np.take(x, np.clip(index - low, 0, x.shape[axis] - 1), axis=axis)
        b = np.take(x, np.clip(index - low - 1, 0, x.shape[axis] - 1), axis=axis)
        x = a * (1 - fraction) + b * fraction
    return x
