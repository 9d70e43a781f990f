"""One exposure of the camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from groundpose.lab.drive.render.filters import Radiance
from groundpose.lab.drive.render.view import Window


@dataclass
class Shot:
    """One exposure: where it lies in the frame, drawn pixels per pixel of the frame, its generator, the
    amplification of the sensor (1 by day), in a video a generator for each frame."""

    exposure: float
    window: Window
    frame: tuple[int, int]
    scale: float
    rng: np.random.Generator
    gain: float = 1.0
    grain: np.random.Generator | None = None

    @property
    def grains(self) -> np.random.Generator:
        """Draws noise and drops, which are new in each frame of a video."""
        return self.rng if self.grain is None else self.grain

    def corner(self, cell: int) -> tuple[int, int]:
        """Column and row of the window's first pixel within its cell of `cell` x `cell` pixels of the frame;
        exact where the frame's own pixels are drawn."""
        return round(self.window.left + 0.5) % cell, round(self.window.top + 0.5) % cell


Stage = Callable[[Radiance, Shot], Radiance]
