"""Effects of a camera: exposure, lens, noise, sharpening, compression.

A table of stages works on linear radiance (H, W, 3), then on display values. One generator draws all random
numbers; widths are in pixels of the frame and are scaled to the resolution drawn.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow

from groundpose.lab.drive.render.view import Window
from groundpose.lab.drive.scene import Scene

Radiance = NDArray[np.float32]
Image = NDArray[np.uint8]
Box = tuple[float, float, float, float]


def sampled_window(box: Box, size: tuple[int, int]) -> Window:
    """The window to draw for a crop: the frame's own pixels when the crop magnifies (a real crop has no finer
    ones), else pixels a little finer than the crop's."""
    left, top, right, bottom = box
    scale = min(1.0, max(size[0] / (right - left), size[1] / (bottom - top)))
    pitch = 1.0 / min(1.0, 1.1 * scale)
    # Whole pairs of cells of the frame's own grid (three drawn ones make two), one beyond the box on each
    # side for the resampling.
    x0, y0 = (2 * math.floor(((low + 0.5) / pitch - 1) / 2) for low in (left, top))
    x1, y1 = (2 * math.ceil(((high + 0.5) / pitch + 1) / 2) for high in (right, bottom))
    edges = (x0 * pitch - 0.5, y0 * pitch - 0.5, x1 * pitch - 0.5, y1 * pitch - 0.5)
    return Window(*edges, x1 - x0, y1 - y0)


def resample(picture: Image, window: Window, box: Box, size: tuple[int, int]) -> Image:
    """The box of a drawn window at `size`."""
    pitch_x = (window.right - window.left) / window.width
    pitch_y = (window.bottom - window.top) / window.height
    inner = (
        (box[0] - window.left) / pitch_x, (box[1] - window.top) / pitch_y,
        (box[2] - window.left) / pitch_x, (box[3] - window.top) / pitch_y,
    )  # fmt: skip
    return np.asarray(Pillow.fromarray(picture).resize(size, Pillow.Resampling.BILINEAR, box=inner))


def plain(linear: Radiance, exposure: float) -> Image:
    """A clean picture: exposure and the display curve."""
    return _bytes(_curve(linear * np.float32(exposure), 0.5))


@dataclass
class Shot:
    """One exposure: where it lies in the frame, drawn pixels per pixel of the frame, its generator."""

    exposure: float
    window: Window
    frame: tuple[int, int]
    scale: float
    rng: np.random.Generator


Stage = Callable[[Radiance, Shot], Radiance]


def develop(linear: Radiance, scene: Scene, window: Window, rng: np.random.Generator) -> Image:
    """The picture (H, W, 3) uint8 of radiance (H, W, 3) drawn for a window of the frame."""
    assert scene.camera.image_size is not None
    scale = window.width / (window.right - window.left)
    shot = Shot(scene.light.exposure, window, scene.camera.image_size, scale, rng)
    picture = linear
    for chance, stage in STAGES:
        # Each stage draws its numbers even if it is not used, so that stages do not affect each other.
        own = np.random.Generator(np.random.PCG64(rng.integers(2**63)))
        if own.random() < chance:
            shot.rng = own
            picture = stage(picture, shot)
    return _compress(_bytes(picture), rng)


def _expose(x: Radiance, shot: Shot) -> Radiance:
    """Exposure of the scene with the error of a meter, and the colour cast of a white balance."""
    gain = shot.exposure * np.exp(shot.rng.normal(0.0, 0.22))
    cast = np.exp(shot.rng.normal(0.0, 0.045, size=3))
    return np.asarray(x * (gain * cast).astype(np.float32))


def _glow(x: Radiance, shot: Shot) -> Radiance:
    """Stray light in the lens: a halo around very bright areas, a veil over the whole picture."""
    # a halo is wide, so a quarter of the rows and columns is enough
    bright = _scaled_to(np.clip(x - 1.0, 0.0, 11.0), (-(-x.shape[0] // 4), -(-x.shape[1] // 4)))
    wide = _scaled_to(_blur(bright, 7.0 * shot.scale * 0.25), x.shape[:2])
    veil = shot.rng.uniform(0.0, 0.03) * float(np.minimum(x, 2.0).mean())
    return np.asarray(x + np.float32(shot.rng.uniform(0.02, 0.12)) * wide + np.float32(veil))


def _vignette(x: Radiance, shot: Shot) -> Radiance:
    w, (width, height) = shot.window, shot.frame
    u = (np.linspace(w.left, w.right, x.shape[1]) - 0.5 * width) / (0.5 * width)
    v = (np.linspace(w.top, w.bottom, x.shape[0]) - 0.5 * height) / (0.5 * width)
    loss = shot.rng.uniform(0.02, 0.3) * (u[None] ** 2 + v[:, None] ** 2)
    return np.asarray(x * (1.0 / (1.0 + loss) ** 2).astype(np.float32)[..., None])


def _motion(x: Radiance, shot: Shot) -> Radiance:
    """Motion blur along a random, mostly horizontal direction."""
    length = min(shot.rng.exponential(1.6), 8.0) * shot.scale
    angle = shot.rng.normal(0.0, 0.4)
    taps = int(np.clip(math.ceil(length), 1, 15)) + 1
    out = np.zeros_like(x)
    for k in np.linspace(-0.5, 0.5, taps):
        out += _shifted(x, k * length * np.cos(angle), k * length * np.sin(angle))
    return np.asarray(out / np.float32(taps))


def _defocus(x: Radiance, shot: Shot) -> Radiance:
    return _blur(x, (0.3 + min(shot.rng.exponential(0.3), 1.5)) * shot.scale)


def _fringe(x: Radiance, shot: Shot) -> Radiance:
    """Lateral chromatic aberration: red and blue at slightly different scales."""
    w, (width, height) = shot.window, shot.frame
    away = np.array([0.5 * (w.left + w.right - width), 0.5 * (w.top + w.bottom - height)]) / (0.5 * width)
    out: Radiance = x.copy()
    for channel, sign in ((0, 1.0), (2, -1.0)):
        dx, dy = sign * shot.rng.normal(0.0, 1.0) * away * shot.scale
        out[..., channel : channel + 1] = _shifted(x[..., channel : channel + 1], dx, dy)
    return out


def _noise(x: Radiance, shot: Shot) -> Radiance:
    """Shot and read noise; colours correlated over neighbours as demosaicing leaves them."""
    fraction = 1.0 / max(1.0, 1.0 / shot.scale)
    strength = np.exp(shot.rng.normal(-4.5, 0.6)) * fraction
    sigma = strength * np.sqrt(np.maximum(x, 0.0) + 0.02)
    common = shot.rng.standard_normal(x.shape[:2], dtype=np.float32)[..., None]
    half = (x.shape[0] // 2 + 1, x.shape[1] // 2 + 1, 3)
    colour = _scaled_to(shot.rng.standard_normal(half, dtype=np.float32), x.shape[:2]) * np.float32(1.2)
    return np.asarray(x + (sigma * (0.75 * common + shot.rng.uniform(0.3, 1.0) * colour)).astype(np.float32))


def _tone(x: Radiance, shot: Shot) -> Radiance:
    """Black level, clipping and the display curve, with a camera maker's contrast and colour."""
    black = np.float32(0.012 * shot.rng.random() ** 2)
    y = _curve((x - black) / (1 - black), float(shot.rng.uniform(0.0, 1.0)))
    grey = y.mean(axis=2, keepdims=True)
    return np.asarray(np.clip(grey + np.float32(shot.rng.normal(1.05, 0.18)) * (y - grey), 0.0, 1.0))


def _sharpen(x: Radiance, shot: Shot) -> Radiance:
    """An unsharp mask and its halo."""
    halo = x - _blur(x, shot.rng.uniform(0.7, 1.6) * max(shot.scale, 0.5))
    return np.asarray(np.clip(x + np.float32(shot.rng.uniform(0.2, 1.3)) * halo, 0.0, 1.0))


def _coarse(x: Radiance, shot: Shot) -> Radiance:
    """Reduce the resolution and enlarge again."""
    factor = shot.rng.uniform(0.45, 0.85)
    height, width = x.shape[:2]
    small = Pillow.fromarray(_bytes(x)).resize(
        (max(2, round(width * factor)), max(2, round(height * factor))), Pillow.Resampling.BILINEAR
    )
    back = np.asarray(small.resize((width, height), Pillow.Resampling.BICUBIC))
    return np.asarray(back.astype(np.float32) / np.float32(255.0))


# Probability and stage, in the order of the light's path. Values are linear up to `_tone`.
STAGES: tuple[tuple[float, Stage], ...] = (
    (1.0, _expose),
    (0.7, _glow),
    (0.8, _vignette),
    (0.25, _motion),
    (0.75, _defocus),
    (0.5, _fringe),
    (0.95, _noise),
    (1.0, _tone),
    (0.6, _sharpen),
    (0.12, _coarse),
)


def _compress(picture: Image, rng: np.random.Generator) -> Image:
    """JPEG with or without chroma subsampling, with probability 3/4."""
    used, quality, sampling = rng.random() < 0.75, int(rng.integers(55, 97)), int(rng.choice([0, 2, 2]))
    if not used:
        return picture
    with io.BytesIO() as file:
        Pillow.fromarray(picture).save(file, "JPEG", quality=quality, subsampling=sampling)
        return np.array(Pillow.open(file))


def _curve(x: Radiance, contrast: float) -> Radiance:
    """sRGB-like curve; `contrast` 0 to 1 bends it into an S that darkens shadows and brightens highlights."""
    y = np.clip(x, 0.0, 1.0) ** np.float32(1.0 / 2.2)
    return np.asarray(y + np.float32(contrast) * (y * y * (3 - 2 * y) - y))


def _bytes(x: Radiance) -> Image:
    return np.asarray(np.clip(x * 255.0 + 0.5, 0, 255).astype(np.uint8))


def _blur(x: Radiance, sigma: float) -> Radiance:
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
        out = np.zeros_like(x)
        for k, w in enumerate(weights):
            take[axis] = slice(k, k + n)
            out += w * wide[tuple(take)]
        x = out
    return x


def _scaled_to(x: Radiance, shape: tuple[int, int]) -> Radiance:
    """Resampled to (height, width): averaged down, interpolated up."""
    size = shape[1], shape[0]
    channels = [
        Pillow.fromarray(np.ascontiguousarray(x[..., c])).resize(size, Pillow.Resampling.BILINEAR)
        for c in range(x.shape[2])
    ]
    return np.stack([np.asarray(c) for c in channels], axis=2)


def _shifted(x: Radiance, dx: float, dy: float) -> Radiance:
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
