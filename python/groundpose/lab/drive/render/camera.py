"""The camera: the window of the frame drawn for a crop, and the effects of lens, sensor and compression.

A table of stages works on linear radiance (H, W, 3), then on display values. Each stage has a generator of
its own; widths are in pixels of the frame and are scaled to the resolution drawn.
"""

from __future__ import annotations

import math

import numpy as np
from PIL import Image as Pillow

from groundpose.lab.drive.render import lens, sensor
from groundpose.lab.drive.render.compression import compress
from groundpose.lab.drive.render.filters import Image, Radiance, as_bytes, curve
from groundpose.lab.drive.render.shot import Shot, Stage
from groundpose.lab.drive.render.view import Window
from groundpose.lab.drive.scene import Scene

Box = tuple[float, float, float, float]

# Amplification of the sensor, by light.
_GAINS = {"night": 3.5, "dusk": 1.8}


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
    return as_bytes(curve(linear * np.float32(exposure), 0.5))


def develop(
    linear: Radiance,
    scene: Scene,
    window: Window,
    rng: np.random.Generator,
    grain: np.random.Generator | None = None,
) -> Image:
    """The picture (H, W, 3) uint8 of radiance (H, W, 3) drawn for a window of the frame; `grain` draws what
    differs between the frames of a video, None: `rng` too."""
    assert scene.camera.image_size is not None
    scale, gain = window.width / (window.right - window.left), _GAINS.get(scene.light.kind, 1.0)
    shot = Shot(scene.light.exposure, window, scene.camera.image_size, scale, rng, gain, grain)
    picture = linear
    for chance, stage in STAGES:
        # Each stage has its own numbers even if it is not used, so that stages do not affect each other.
        shot.rng = np.random.Generator(np.random.PCG64(rng.integers(2**63)))
        if shot.rng.random() < chance:
            picture = stage(picture, shot)
    shot.rng = np.random.Generator(np.random.PCG64(rng.integers(2**63)))
    return compress(as_bytes(picture), shot)


# Probability and stage, in the order of the light's path. Values are linear up to `tone`.
STAGES: tuple[tuple[float, Stage], ...] = (
    (0.05, lens.fog),
    (0.04, lens.rain),
    (1.0, sensor.expose),
    (0.7, lens.glow),
    (0.8, lens.vignette),
    (0.25, lens.motion),
    (0.03, lens.wet_glass),
    (0.75, lens.defocus),
    (0.5, lens.fringe),
    (0.95, sensor.noise),
    (0.4, sensor.mosaic),
    (1.0, sensor.tone),
    (0.6, sensor.sharpen),
    (0.12, sensor.coarse),
)
