"""The bundled skies: panoramas and their light (CC0, see ATTRIBUTION.md)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

FOLDER = Path(__file__).parent
# Rows kept of the 512 of a panorama: those above the horizon and 11 degrees below it.
KEPT_ROWS = 288

# Environments by split: no sky of the training set is seen in validation or test.
SKIES: dict[str, tuple[str, ...]] = {
    "train": (
        "bl_city",
        "bl_courtyard",
        "bl_forest",
        "bl_night",
        "bl_sunrise",
        "bl_sunset",
        "pm_park",
        "pm_sky",
        "pm_venice",
    ),
    "validation": ("pm_city", "pm_forest", "pm_night"),
    "test": ("pm_dawn", "pm_sunset"),
}


@dataclass(frozen=True, eq=False)
class Environment:
    """One sky.

    Attributes:
        name: of the panorama.
        panorama: (KEPT_ROWS, 1024, 3) uint8 sRGB, zenith first.
        harmonics: (9, 3) irradiance of the sky; level ground receives 1.
        azimuth: radians of the brightest column.
        mean: (3,) linear mean of the upper half.
    """

    name: str
    panorama: NDArray[np.uint8]
    harmonics: NDArray[np.float32]
    azimuth: float
    mean: NDArray[np.float32]


@cache
def environments() -> tuple[Environment, ...]:
    """All skies in the order of `SKIES`; `Light.sky` is the index."""
    with np.load(FOLDER / "environments.npz", allow_pickle=False) as file:
        names, rest = file["names"].tolist(), [file[k] for k in ("harmonics", "azimuths", "means")]
    pictures = [np.asarray(Image.open(FOLDER / f"{name}.jpg").convert("RGB")) for name in names]
    return tuple(
        Environment(name, picture, h, float(a), m)
        for name, picture, h, a, m in zip(names, pictures, *rest, strict=True)
    )


def skies(split: str) -> tuple[int, ...]:
    """Indices of the skies of a split."""
    order = [name for names in SKIES.values() for name in names]
    return tuple(order.index(name) for name in SKIES[split])
