"""Paint, dirt and plates of a vehicle, and the surfaces of its parts."""

from __future__ import annotations

import string
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from groundpose.lab.bodies.body import MATERIALS
from groundpose.lab.drive.render.context import pattern

Colour = tuple[float, float, float]

# Paints of European streets: linear colour, fraction of flakes, fraction of cars. Greys dominate.
PAINTS: tuple[tuple[Colour, float, float], ...] = (
    ((0.004, 0.004, 0.005), 0.0, 12.0),  # black
    ((0.009, 0.009, 0.010), 0.6, 10.0),  # black metallic
    ((0.035, 0.036, 0.040), 0.7, 10.0),  # anthracite
    ((0.110, 0.112, 0.115), 0.75, 9.0),  # grey metallic
    ((0.300, 0.305, 0.310), 0.85, 13.0),  # silver
    ((0.700, 0.700, 0.690), 0.0, 17.0),  # white
    ((0.550, 0.550, 0.520), 0.3, 3.0),  # pearl
    ((0.010, 0.018, 0.055), 0.6, 7.0),  # dark blue
    ((0.020, 0.075, 0.240), 0.5, 5.0),  # blue
    ((0.120, 0.190, 0.280), 0.7, 2.0),  # light blue
    ((0.280, 0.010, 0.010), 0.0, 4.5),  # red
    ((0.110, 0.008, 0.012), 0.6, 2.5),  # dark red
    ((0.015, 0.040, 0.022), 0.6, 1.5),  # dark green
    ((0.090, 0.140, 0.060), 0.5, 0.7),  # green
    ((0.240, 0.190, 0.120), 0.7, 2.0),  # beige
    ((0.075, 0.045, 0.025), 0.6, 1.5),  # brown
    ((0.600, 0.360, 0.020), 0.0, 1.3),  # yellow
    ((0.480, 0.120, 0.015), 0.3, 1.0),  # orange
)
# Work vehicles are white, silver, blue, red, yellow.
_WORK_FREQUENCIES = (2, 2, 3, 3, 9, 50, 2, 3, 8, 2, 8, 1, 2, 3, 1, 0, 6, 4)
# Vehicles whose random number is above this have not been washed all winter.
_FILTHY = 0.96
_BOX_PANELS: tuple[Colour, ...] = (
    (0.70, 0.70, 0.68), (0.62, 0.62, 0.60), (0.50, 0.51, 0.52), (0.05, 0.10, 0.28), (0.30, 0.02, 0.02),
    (0.55, 0.38, 0.04), (0.06, 0.16, 0.08), (0.10, 0.10, 0.11),
)  # fmt: skip

# By material: albedo, roughness, metal, coat, pattern of vehicle.glsl, paint taken (1, 2).
SURFACES: dict[str, tuple[Colour, float, float, float, str, float]] = {
    "paint": ((0.5, 0.5, 0.5), 0.03, 0.0, 1.0, "", 1.0),
    "paint_second": ((0.5, 0.5, 0.5), 0.12, 0.0, 0.7, "", 2.0),
    "glass": ((0.01, 0.01, 0.01), 0.03, 0.0, 1.0, "", 0.0),
    "chrome": ((0.55, 0.55, 0.55), 0.08, 1.0, 1.0, "", 0.0),
    "plastic": ((0.018, 0.018, 0.019), 0.45, 0.0, 0.6, "", 0.0),
    "rubber": ((0.012, 0.012, 0.012), 0.7, 0.0, 0.2, "", 0.0),
    "tyre": ((0.018, 0.018, 0.018), 0.8, 0.0, 0.15, "", 0.0),
    "rim": ((0.30, 0.30, 0.31), 0.25, 0.85, 0.6, "", 0.0),
    "headlamp": ((0.42, 0.43, 0.45), 0.06, 0.5, 1.0, "HEADLAMP", 0.0),
    "taillamp": ((0.22, 0.006, 0.008), 0.05, 0.0, 1.0, "TAILLAMP", 0.0),
    "indicator": ((0.42, 0.13, 0.01), 0.05, 0.0, 1.0, "INDICATOR", 0.0),
    "plate": ((0.7, 0.7, 0.66), 0.4, 0.0, 0.4, "PLATE", 0.0),
    "grille": ((0.020, 0.020, 0.021), 0.35, 0.2, 0.7, "GRILLE", 0.0),
    "interior": ((0.022, 0.021, 0.020), 0.8, 0.0, 0.0, "CABIN", 0.0),
    "seat": ((0.045, 0.043, 0.042), 0.9, 0.0, 0.0, "CABIN", 0.0),
    "skin": ((0.28, 0.16, 0.11), 0.6, 0.0, 0.0, "CABIN", 0.0),
    "clothes": ((0.16, 0.16, 0.19), 0.9, 0.0, 0.0, "CABIN", 0.0),
    "underbody": ((0.007, 0.007, 0.007), 0.9, 0.0, 0.0, "", 0.0),
    "metal": ((0.09, 0.09, 0.09), 0.5, 0.6, 0.3, "", 0.0),
    "seam": ((0.004, 0.004, 0.004), 0.8, 0.0, 0.0, "", 0.0),
    "mirror": ((0.6, 0.6, 0.62), 0.02, 1.0, 1.0, "", 0.0),
    "reversing_lamp": ((0.45, 0.45, 0.44), 0.06, 0.2, 1.0, "", 0.0),
    "display": ((0.01, 0.01, 0.01), 0.1, 0.0, 1.0, "DISPLAY", 0.0),
}


@cache
def surface_tables() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The uniforms `base` and `layer` of vehicle.vert, (32, 4) each, in the order of MATERIALS."""
    base, layer = np.zeros((32, 4), np.float32), np.zeros((32, 4), np.float32)
    for i, name in enumerate(MATERIALS):
        albedo, rough, metal, coat, drawn, fraction = SURFACES[name]
        base[i], layer[i] = (*albedo, rough), (metal, coat, pattern(drawn), fraction)
    return base, layer


@dataclass(frozen=True)
class Look:
    """The look that `look_seed` decides: linear colours, dirt 0 to 1.7, plate a row of `plates`."""

    paint: Colour
    flakes: float
    coat_roughness: float
    second: Colour
    dirt: float
    plate: int
    glass: float
    random: float


PLATES = 32


def look(class_name: str, seed: int) -> Look:
    """The look of a vehicle of class `class_name`."""
    rng = np.random.default_rng([81, seed])
    fractions = np.array(
        [fraction for *_, fraction in PAINTS] if class_name == "car" else _WORK_FREQUENCIES, dtype=float
    )
    colour, flakes, _ = PAINTS[rng.choice(len(PAINTS), p=fractions / fractions.sum())]
    shade = rng.normal(1.0, 0.12)
    tone = rng.normal(1.0, 0.05, size=3)
    paint = np.clip(np.array(colour) * max(shade, 0.6) * tone, 0.0, 0.8)
    panel = _BOX_PANELS[rng.choice(len(_BOX_PANELS), p=[0.4, 0.15, 0.12, 0.09, 0.08, 0.06, 0.05, 0.05])]
    same = class_name == "car" and rng.random() < 0.6
    matt = rng.random() < 0.04
    dirty = rng.random()
    return Look(
        paint=(float(paint[0]), float(paint[1]), float(paint[2])),
        flakes=flakes,
        coat_roughness=0.5 if matt else float(rng.uniform(0.01, 0.07)),
        second=(float(paint[0]), float(paint[1]), float(paint[2])) if same else panel,
        dirt=float(0.9 * dirty**3 + 0.8 * (dirty > _FILTHY)),
        plate=int(rng.integers(PLATES)),
        glass=float(rng.choice([0.62, 0.5, 0.3, 0.15], p=[0.4, 0.33, 0.19, 0.08])),
        random=float(rng.random()),
    )


@cache
def plates() -> NDArray[np.uint8]:
    """Number plates stacked vertically, (PLATES * 64, 256, 3)."""
    rng = np.random.default_rng(82)
    rows = []
    for i in range(PLATES):
        yellow = i % 8 == 7
        picture = Image.new("RGB", (256, 64), (225, 185, 40) if yellow else (222, 222, 216))
        draw = ImageDraw.Draw(picture)
        letters = "".join(rng.choice(list(string.ascii_uppercase), 4))
        written = f"{letters[: rng.integers(1, 4)]} {letters[2:]} {rng.integers(10, 9999)}"
        font = ImageFont.load_default(48)
        font = ImageFont.load_default(48 * min(1.0, 205 / font.getlength(written)))
        draw.text((140, 32), written, fill=(20, 20, 22), font=font, stroke_width=1, anchor="mm")
        draw.rectangle((0, 0, 255, 63), outline=(30, 30, 30), width=3)
        if i % 4:
            draw.rectangle((0, 0, 22, 63), fill=(20, 50, 150))
        rows.append(np.asarray(picture))
    return np.concatenate(rows)
