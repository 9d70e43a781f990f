"""What lies between the scene and the sensor: fog, rain, stray light, blur, drops on the glass."""

from __future__ import annotations

import math

import numpy as np

from groundpose.lab.drive.render.filters import Radiance, blur, scaled_to, shifted
from groundpose.lab.drive.render.shot import Shot


def fog(x: Radiance, shot: Shot) -> Radiance:
    """A veil of scattered light; the light of the scene decides its brightness."""
    density = np.float32(shot.rng.uniform(0.1, 0.5))
    air = np.float32(shot.rng.uniform(0.8, 1.6)) * x.mean(axis=(0, 1))
    return np.asarray(x * (1 - density) + density * air)


def rain(x: Radiance, shot: Shot) -> Radiance:
    """Streaks of falling drops, slightly inclined."""
    height, width = x.shape[:2]
    length = max(2, round(shot.rng.uniform(6.0, 25.0) * shot.scale))
    drops = shot.grains.random((height + length, width), dtype=np.float32) < shot.rng.uniform(0.0008, 0.004)
    fallen = np.cumsum(drops, axis=0, dtype=np.float32)
    streaks = fallen[length:] - fallen[:-length]
    slanted = np.arange(width) + (shot.rng.normal(0.0, 0.15) * np.arange(height)).astype(int)[:, None]
    streaks = np.take_along_axis(streaks, slanted % width, axis=1)
    light = np.float32(shot.rng.uniform(0.1, 0.35)) * np.minimum(x, 2.0).mean(axis=(0, 1))
    return np.asarray(x + np.minimum(streaks, 1.0)[..., None] * light)


def wet_glass(x: Radiance, shot: Shot) -> Radiance:
    """Drops on the glass before the lens, out of focus: each smears what is behind it."""
    height, width = x.shape[:2]
    smeared = scaled_to(scaled_to(x, (max(2, height // 9), max(2, width // 9))), (height, width))
    v, u = np.ogrid[0:height, 0:width]
    for _ in range(int(shot.rng.integers(1, 6))):
        radius = shot.rng.uniform(0.06, 0.25) * width
        away = np.hypot(u - shot.rng.uniform(0, width), (v - shot.rng.uniform(0, height)) * 0.8)
        covered = np.clip(1.6 * (1.0 - away / radius), 0.0, 1.0).astype(np.float32)[..., None]
        x = x + covered * (smeared * np.float32(shot.rng.uniform(0.7, 1.3)) - x)
    return np.asarray(x)


def glow(x: Radiance, shot: Shot) -> Radiance:
    """Stray light in the lens: a halo around very bright areas, a veil over the whole picture."""
    # a halo is wide, so a quarter of the rows and columns is enough
    bright = scaled_to(np.clip(x - 1.0, 0.0, 11.0), (-(-x.shape[0] // 4), -(-x.shape[1] // 4)))
    wide = scaled_to(blur(bright, 7.0 * shot.scale * 0.25), x.shape[:2])
    veil = shot.rng.uniform(0.0, 0.03) * float(np.minimum(x, 2.0).mean())
    return np.asarray(x + np.float32(min(0.02 + shot.rng.exponential(0.06), 0.5)) * wide + np.float32(veil))


def vignette(x: Radiance, shot: Shot) -> Radiance:
    """Less light in the corners of the frame."""
    w, (width, height) = shot.window, shot.frame
    u = (np.linspace(w.left, w.right, x.shape[1]) - 0.5 * width) / (0.5 * width)
    v = (np.linspace(w.top, w.bottom, x.shape[0]) - 0.5 * height) / (0.5 * width)
    loss = shot.rng.uniform(0.02, 0.3) * (u[None] ** 2 + v[:, None] ** 2)
    return np.asarray(x * (1.0 / (1.0 + loss) ** 2).astype(np.float32)[..., None])


def motion(x: Radiance, shot: Shot) -> Radiance:
    """Motion blur along a random, mostly horizontal direction."""
    length = min(shot.rng.exponential(1.2), 8.0) * shot.scale
    angle = shot.rng.normal(0.0, 0.4)
    taps = int(np.clip(math.ceil(length), 1, 15)) + 1
    out = np.zeros_like(x)
    for k in np.linspace(-0.5, 0.5, taps):
        out += shifted(x, k * length * np.cos(angle), k * length * np.sin(angle))
    return np.asarray(out / np.float32(taps))


def defocus(x: Radiance, shot: Shot) -> Radiance:
    """An imperfect lens or focus."""
    return blur(x, (0.3 + min(shot.rng.exponential(0.3), 1.5)) * shot.scale)


def fringe(x: Radiance, shot: Shot) -> Radiance:
    """Lateral chromatic aberration: red and blue at slightly different scales."""
    w, (width, height) = shot.window, shot.frame
    away = np.array([0.5 * (w.left + w.right - width), 0.5 * (w.top + w.bottom - height)]) / (0.5 * width)
    out: Radiance = x.copy()
    for channel, sign in ((0, 1.0), (2, -1.0)):
        dx, dy = sign * shot.rng.normal(0.0, 1.0) * away * shot.scale
        out[..., channel : channel + 1] = shifted(x[..., channel : channel + 1], dx, dy)
    return out
