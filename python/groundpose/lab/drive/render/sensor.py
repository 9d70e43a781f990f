"""What the camera's electronics do: exposure, noise, colour mosaic, tone, sharpening."""

from __future__ import annotations

import math

import numpy as np
from PIL import Image as Pillow

from groundpose.lab.drive.render.filters import Radiance, as_bytes, blur, curve, mean_of_channels, scaled_to
from groundpose.lab.drive.render.shot import Shot

# Errors of a light meter: probability; mean and standard deviation of the logarithm of the gain. Most are
# small, some blow out what is in the sun, some drown what is in shade.
_METER = ((0.74, 0.05, 0.25), (0.18, 0.75, 0.3), (0.08, -0.5, 0.3))
# Below this many drawn pixels per pixel of the frame the mosaic is finer than what is drawn.
_MOSAIC_SCALE = 0.95


def expose(x: Radiance, shot: Shot) -> Radiance:
    """Exposure of the scene with the error of a meter, and the colour cast of a white balance."""
    _, mean, std = _METER[shot.rng.choice(len(_METER), p=[fraction for fraction, *_ in _METER])]
    gain = shot.exposure * math.exp(shot.rng.normal(mean, std))
    cast = np.exp(shot.rng.normal(0.0, 0.06, size=3))
    return np.asarray(x * (gain * cast).astype(np.float32))


def noise(x: Radiance, shot: Shot) -> Radiance:
    """Shot and read noise; colours correlated over neighbours as demosaicing leaves them."""
    fraction = 1.0 / max(1.0, 1.0 / shot.scale)
    strength = shot.gain * np.exp(shot.rng.normal(-4.4, 0.75)) * fraction
    sigma = strength * np.sqrt(np.maximum(x, 0.0) + 0.02)
    common = shot.grains.standard_normal(x.shape[:2], dtype=np.float32)[..., None]
    half = (x.shape[0] // 2 + 1, x.shape[1] // 2 + 1, 3)
    colour = scaled_to(shot.grains.standard_normal(half, dtype=np.float32), x.shape[:2]) * np.float32(1.2)
    return np.asarray(x + (sigma * (0.75 * common + shot.rng.uniform(0.3, 1.0) * colour)).astype(np.float32))


def mosaic(x: Radiance, shot: Shot) -> Radiance:
    """One colour per pixel (Bayer's pattern), the other two interpolated: coloured edges and zips."""
    if shot.scale < _MOSAIC_SCALE:
        return x
    # A sensor saturates, and a filter before it takes away the finest details.
    filtered = blur(np.minimum(x, np.float32(1.2)), 0.45)
    wide = np.pad(filtered, ((1, 1), (1, 1), (0, 0)), mode="reflect")  # keeps the pattern's parity
    column, row = np.add(shot.corner(2), shot.rng.integers(2, size=2) + 1)
    red = np.outer((np.arange(len(wide)) + row) % 2, (np.arange(wide.shape[1]) + column) % 2)
    blue = np.roll(red, (1, 1), axis=(0, 1))
    out = np.empty_like(x)
    for channel, sites in ((0, red), (2, blue)):
        seen = wide[..., channel] * sites.astype(np.float32)
        across = seen[:, 1:-1] + 0.5 * (seen[:, :-2] + seen[:, 2:])
        out[..., channel] = across[1:-1] + 0.5 * (across[:-2] + across[2:])
    seen = wide[..., 1] * (1 - red - blue).astype(np.float32)
    around = seen[:-2, 1:-1] + seen[2:, 1:-1] + seen[1:-1, :-2] + seen[1:-1, 2:]
    out[..., 1] = seen[1:-1, 1:-1] + 0.25 * around
    # Most cameras interpolate along edges, which leaves a part of these errors.
    return np.asarray(filtered + np.float32(shot.rng.uniform(0.3, 1.0)) * (out - filtered))


def tone(x: Radiance, shot: Shot) -> Radiance:
    """Black level, clipping and the display curve, with a camera maker's contrast and colour."""
    black = np.float32(0.02 * shot.rng.random() ** 3)
    y = curve((x - black) / (1 - black), float(shot.rng.triangular(0.0, 0.7, 1.3)))
    grey = mean_of_channels(y)
    return np.asarray(np.clip(grey + np.float32(shot.rng.normal(1.12, 0.25)) * (y - grey), 0.0, 1.0))


def sharpen(x: Radiance, shot: Shot) -> Radiance:
    """An unsharp mask and its halo; cheap cameras exaggerate."""
    halo = x - blur(x, shot.rng.uniform(0.7, 1.6) * max(shot.scale, 0.5))
    return np.asarray(np.clip(x + np.float32(0.2 + min(shot.rng.exponential(0.6), 2.8)) * halo, 0.0, 1.0))


def coarse(x: Radiance, shot: Shot) -> Radiance:
    """Reduce the resolution and enlarge again."""
    factor = shot.rng.uniform(0.45, 0.85)
    height, width = x.shape[:2]
    small = Pillow.fromarray(as_bytes(x)).resize(
        (max(2, round(width * factor)), max(2, round(height * factor))), Pillow.Resampling.BILINEAR
    )
    back = np.asarray(small.resize((width, height), Pillow.Resampling.BICUBIC))
    return np.asarray(back.astype(np.float32) / np.float32(255.0))
