"""Where vehicles drive: regions of the world, what is driven in each, how sizes differ there and with age.

The fractions are estimates, not statistics: cars by registered vehicles (about a third in Europe with
Russia and Turkey), with somewhat more of Europe and Japan, from where many road pictures come; kei cars are
over a third of Japan's. Sizes are rounded from common vehicles, which are named. What counts is the spread
and the mean: the mean car is 4.22 x 1.55 x 1.75 m (length x height x width), between the labels of KITTI
and new cars.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundpose._checks import FloatArray

REGIONS: tuple[str, ...] = ("europe", "north_america", "china", "japan", "elsewhere")
"""Regions; `elsewhere` is mostly India, South-East Asia, Latin America and Africa."""

# Fraction of each region among the vehicles of a class.
_FRACTIONS: dict[str, tuple[float, ...]] = {
    "car": (0.38, 0.12, 0.16, 0.12, 0.22),
    "van_bus": (0.40, 0.14, 0.16, 0.12, 0.18),
    "pickup": (0.15, 0.38, 0.12, 0.00, 0.35),
    "box_truck": (0.40, 0.16, 0.18, 0.12, 0.14),
}

# Fraction of each style in each region, in the order of `REGIONS`.
_STYLES: dict[str, dict[str, tuple[float, ...]]] = {
    "car": {
        "sedan": (0.14, 0.38, 0.48, 0.12, 0.30),
        "hatchback": (0.39, 0.08, 0.09, 0.24, 0.32),
        "estate": (0.13, 0.02, 0.00, 0.04, 0.00),
        "suv": (0.13, 0.42, 0.35, 0.08, 0.15),
        "coupe": (0.03, 0.05, 0.00, 0.01, 0.00),
        "city_car": (0.11, 0.00, 0.02, 0.00, 0.17),
        "kei_car": (0.00, 0.00, 0.00, 0.36, 0.00),
        "mpv": (0.07, 0.05, 0.06, 0.15, 0.06),
    },
    "van_bus": {
        "van": (0.35, 0.40, 0.26, 0.26, 0.28),
        "minibus": (0.15, 0.22, 0.20, 0.16, 0.28),
        "city_bus": (0.16, 0.16, 0.24, 0.14, 0.16),
        "coach": (0.12, 0.14, 0.14, 0.12, 0.14),
        "small_van": (0.22, 0.08, 0.16, 0.32, 0.14),
    },
    "pickup": {
        "single_cab": (0.25, 0.22, 0.40, 0.00, 0.52),
        "double_cab": (0.75, 0.78, 0.60, 0.00, 0.48),
    },
    "box_truck": {
        "cab_gap": (0.68, 0.62, 0.70, 0.50, 0.66),
        "no_gap": (0.32, 0.38, 0.30, 0.50, 0.34),
    },
}

STYLES: dict[str, tuple[str, ...]] = {class_name: tuple(rows) for class_name, rows in _STYLES.items()}
"""Styles of each class."""


class Scale(NamedTuple):
    """Length, height and width as multiples of Europe's."""

    length: float = 1.0
    height: float = 1.0
    width: float = 1.0


_SCALES: dict[tuple[str, str], Scale] = {
    # Camry, Accord, Malibu; Civic; Equinox, Explorer, Tahoe; Odyssey, Sienna
    ("north_america", "sedan"): Scale(1.055, 1.00, 1.025),
    ("north_america", "hatchback"): Scale(1.05, 1.00, 1.02),
    ("north_america", "suv"): Scale(1.06, 1.04, 1.035),
    ("north_america", "coupe"): Scale(1.05, 1.00, 1.03),
    ("north_america", "mpv"): Scale(1.14, 1.05, 1.08),
    # Lavida, Sylphy, Qin; Haval H6, Song; GL8, Hongguang
    ("china", "sedan"): Scale(1.015, 1.02, 1.005),
    ("china", "suv"): Scale(1.035, 1.01, 1.015),
    ("china", "mpv"): Scale(1.06, 1.03, 1.0),
    # Corolla Axio; Fit, Vitz; Noah, Serena, Sienta: 1.695 m is the limit of the class of small cars
    ("japan", "sedan"): Scale(0.985, 1.01, 0.97),
    ("japan", "hatchback"): Scale(0.985, 1.015, 0.985),
    ("japan", "estate"): Scale(0.97, 1.00, 0.965),
    ("japan", "suv"): Scale(0.97, 1.00, 0.975),
    ("japan", "mpv"): Scale(1.01, 1.05, 0.945),
    # Dzire, Logan, Vios; Swift, Gol; Creta, Brezza; Wagon R, Alto; Ertiga, Avanza
    ("elsewhere", "sedan"): Scale(0.95, 1.03, 0.97),
    ("elsewhere", "hatchback"): Scale(0.96, 1.02, 0.975),
    ("elsewhere", "suv"): Scale(0.97, 1.01, 0.98),
    ("elsewhere", "city_car"): Scale(0.99, 1.04, 0.975),
    ("elsewhere", "mpv"): Scale(0.98, 1.02, 0.96),
    # Transit, ProMaster; Wuling Sunshine; Hiace, Every (a kei van)
    ("north_america", "van"): Scale(1.08, 1.08, 1.04),
    ("north_america", "small_van"): Scale(1.05, 1.0, 1.02),
    ("china", "small_van"): Scale(0.90, 1.02, 0.93),
    ("japan", "van"): Scale(0.93, 0.95, 0.90),
    ("japan", "small_van"): Scale(0.79, 1.03, 0.845),
    ("elsewhere", "van"): Scale(0.96, 0.97, 0.95),
    ("elsewhere", "small_van"): Scale(0.92, 1.02, 0.93),
    ("north_america", "city_bus"): Scale(1.03, 1.02, 1.02),
    ("japan", "city_bus"): Scale(0.90, 1.00, 0.985),
    ("china", "city_bus"): Scale(0.94, 1.02, 0.99),
    ("elsewhere", "city_bus"): Scale(0.95, 1.02, 0.99),
    ("north_america", "coach"): Scale(1.10, 1.00, 1.02),
    ("japan", "coach"): Scale(0.97, 0.98, 0.98),
    # F-150, Silverado beside Tacoma and Ranger; elsewhere Hilux, D-Max, Navara, as in Europe
    ("north_america", "single_cab"): Scale(1.07, 1.07, 1.06),
    ("north_america", "double_cab"): Scale(1.08, 1.06, 1.06),
    # Isuzu, Freightliner; Canter and Elf; FAW
    ("north_america", "cab_gap"): Scale(0.98, 1.05, 1.01),
    ("north_america", "no_gap"): Scale(1.04, 1.05, 1.02),
    ("china", "cab_gap"): Scale(0.92, 0.97, 0.98),
    ("china", "no_gap"): Scale(0.88, 0.97, 0.96),
    ("japan", "cab_gap"): Scale(0.90, 0.97, 0.94),
    ("japan", "no_gap"): Scale(0.86, 0.95, 0.92),
    ("elsewhere", "cab_gap"): Scale(0.92, 0.97, 0.98),
}


class Growth(NamedTuple):
    """How much longer, higher and wider vehicles of a style are today than in 1990, metres."""

    length: float = 0.0
    height: float = 0.0
    width: float = 0.0


_CAR, _VAN, _PICKUP = Growth(0.30, 0.05, 0.13), Growth(0.25, 0.05, 0.09), Growth(0.35, 0.08, 0.14)
# Golf II to VIII: 3.99 x 1.42 x 1.67 to 4.28 x 1.49 x 1.79 m; a law of 1998 let kei cars grow.
_GROWTH: dict[str, Growth] = {
    **dict.fromkeys(("sedan", "hatchback", "estate", "suv", "coupe", "mpv"), _CAR),
    "city_car": Growth(0.20, 0.04, 0.12),
    "kei_car": Growth(0.04, 0.08, 0.03),
    **dict.fromkeys(("van", "small_van", "minibus"), _VAN),
    **dict.fromkeys(("single_cab", "double_cab"), _PICKUP),
}

_AGE = 1.8, 1.5  # of the beta distribution
_MEAN_AGE = _AGE[0] / sum(_AGE)


def style_fractions(class_name: str) -> list[float]:
    """Fraction of each of `STYLES[class_name]` in the world."""
    return [float(row.sum()) for row in _joint(class_name)]


def draw_region(class_name: str, style: str, rng: np.random.Generator) -> str:
    """The region of a vehicle of this style."""
    row = _joint(class_name)[STYLES[class_name].index(style)]
    return REGIONS[int(rng.choice(len(REGIONS), p=row / row.sum()))]


def draw_age(rng: np.random.Generator) -> float:
    """Age of the design: 0 is about 1990, 1 is today."""
    return float(rng.beta(*_AGE))


def scale(region: str, style: str) -> Scale:
    """Sizes of a style in a region as multiples of Europe's."""
    return _SCALES.get((region, style), Scale())


def growth(style: str, age: float) -> Growth:
    """What `age` adds to the size of a vehicle of mean age, metres."""
    since = _GROWTH.get(style, Growth())
    return Growth(*((age - _MEAN_AGE) * metres for metres in since))


def _joint(class_name: str) -> FloatArray:
    """Fraction (styles, regions) of each style and region among all vehicles of a class."""
    styles = np.array(list(_STYLES[class_name].values()), dtype=np.float64)
    joint = styles * np.array(_FRACTIONS[class_name])
    return np.asarray(joint / joint.sum())
