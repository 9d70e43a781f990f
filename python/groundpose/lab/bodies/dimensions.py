"""Distributions of the measures of vehicles on the road, from which bodies are drawn.

Means and standard deviations are rounded from makers' data sheets of common vehicles in Europe, at the mean
age; `regions` changes them by region and age. Widths are without mirrors. Labels of benchmarks to compare,
length x height x width: KITTI (Karlsruhe 2011) car 3.89 x 1.51 x 1.62, van 4.92 x 2.14 x 1.90, truck 9.35 x
3.32 x 2.53 m; Rope3D (China) car 4.59 x 1.69 x 1.96 m. New cars of the European Union, 2013 to 2023, are
4.42 to 4.53 m long and 1.80 to 1.84 m wide, kei cars at most 3.40 x 2.00 x 1.48 m.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from groundpose.lab.bodies.regions import draw_age, draw_region, growth, scale
from groundpose.vehicles.classes import CLASSES


class Spread(NamedTuple):
    """A normal distribution cut off at two limits; `slope`: change of the mean per metre of length."""

    mean: float
    std: float
    low: float
    high: float
    slope: float = 0.0

    def draw(self, rng: np.random.Generator, longer: float = 0.0) -> float:
        """One number for a vehicle `longer` metres longer than the mean, redrawn until inside the limits."""
        mean = min(max(self.mean + self.slope * longer, self.low), self.high)
        while True:
            value = float(rng.normal(mean, self.std))
            if self.low <= value <= self.high:
                return value


class _Row(NamedTuple):
    length: Spread
    height: Spread
    width: Spread
    wheelbase: Spread  # fraction of the length
    front_overhang: Spread  # front axle behind the front end, m
    wheel_radius: Spread
    clearance: Spread  # lower edge of the body


@dataclass(frozen=True)
class Dimensions:
    """Outer measures of one vehicle, metres; `front_axle` and `rear_axle` are z of the object frame."""

    length: float
    height: float
    width: float
    front_axle: float
    rear_axle: float
    wheel_radius: float
    clearance: float
    region: str
    age: float  # of the design: 0 is about 1990, 1 is today


_TABLE: dict[tuple[str, str], _Row] = {
    ("car", "sedan"): _Row(
        Spread(4.47, 0.20, 4.00, 5.00),
        Spread(1.45, 0.030, 1.38, 1.54),
        Spread(1.75, 0.045, 1.62, 1.92, 0.10),
        Spread(0.585, 0.010, 0.56, 0.61),
        Spread(0.89, 0.05, 0.76, 1.02, 0.06),
        Spread(0.315, 0.012, 0.285, 0.345, 0.03),
        Spread(0.19, 0.015, 0.15, 0.22),
    ),
    ("car", "hatchback"): _Row(
        Spread(3.97, 0.22, 3.50, 4.45),
        Spread(1.485, 0.040, 1.39, 1.60),
        Spread(1.70, 0.045, 1.56, 1.86, 0.13),
        Spread(0.622, 0.014, 0.59, 0.66),
        Spread(0.82, 0.04, 0.70, 0.94, 0.15),
        Spread(0.305, 0.012, 0.275, 0.335, 0.04),
        Spread(0.19, 0.015, 0.15, 0.22),
    ),
    ("car", "estate"): _Row(
        Spread(4.58, 0.17, 4.15, 5.00),
        Spread(1.49, 0.030, 1.42, 1.58),
        Spread(1.75, 0.045, 1.64, 1.92, 0.12),
        Spread(0.580, 0.010, 0.555, 0.60),
        Spread(0.90, 0.05, 0.78, 1.02, 0.06),
        Spread(0.315, 0.012, 0.285, 0.345, 0.03),
        Spread(0.19, 0.015, 0.15, 0.22),
    ),
    ("car", "suv"): _Row(
        Spread(4.30, 0.27, 3.70, 5.00),
        Spread(1.65, 0.055, 1.52, 1.88, 0.13),
        Spread(1.81, 0.050, 1.66, 2.00, 0.13),
        Spread(0.592, 0.012, 0.56, 0.625),
        Spread(0.90, 0.05, 0.78, 1.02, 0.08),
        Spread(0.355, 0.014, 0.32, 0.395, 0.03),
        Spread(0.23, 0.020, 0.18, 0.28),
    ),
    ("car", "coupe"): _Row(
        Spread(4.42, 0.20, 3.90, 4.85),
        Spread(1.35, 0.035, 1.26, 1.43),
        Spread(1.80, 0.040, 1.68, 1.94, 0.10),
        Spread(0.585, 0.014, 0.55, 0.62),
        Spread(0.88, 0.06, 0.74, 1.02, 0.08),
        Spread(0.320, 0.013, 0.29, 0.35, 0.03),
        Spread(0.17, 0.015, 0.13, 0.20),
    ),
    ("car", "city_car"): _Row(
        Spread(3.56, 0.12, 3.30, 3.80),
        Spread(1.485, 0.035, 1.41, 1.60),
        Spread(1.625, 0.035, 1.54, 1.72, 0.10),
        Spread(0.655, 0.010, 0.63, 0.68),
        Spread(0.71, 0.03, 0.64, 0.79, 0.10),
        Spread(0.285, 0.010, 0.265, 0.31, 0.04),
        Spread(0.18, 0.012, 0.15, 0.21),
    ),
    ("car", "kei_car"): _Row(
        Spread(3.34, 0.03, 3.24, 3.38),
        Spread(1.68, 0.110, 1.48, 1.86),
        Spread(1.465, 0.010, 1.43, 1.48),
        Spread(0.672, 0.006, 0.66, 0.685),  # real ones reach 0.74: the body must end behind its wheel arch
        Spread(0.62, 0.015, 0.58, 0.66),
        Spread(0.277, 0.008, 0.26, 0.295),
        Spread(0.17, 0.010, 0.15, 0.20),
    ),
    ("car", "mpv"): _Row(
        Spread(4.32, 0.24, 3.90, 4.90),
        Spread(1.65, 0.050, 1.55, 1.80, 0.10),
        Spread(1.79, 0.045, 1.66, 1.94, 0.13),
        Spread(0.612, 0.012, 0.585, 0.64),
        Spread(0.87, 0.04, 0.77, 0.98, 0.10),
        Spread(0.315, 0.012, 0.285, 0.345, 0.03),
        Spread(0.18, 0.015, 0.15, 0.22),
    ),
    ("van_bus", "van"): _Row(
        Spread(5.15, 0.42, 4.45, 6.60),
        Spread(2.13, 0.170, 1.85, 2.80, 0.36),
        Spread(1.91, 0.040, 1.74, 2.05, 0.12),
        Spread(0.610, 0.015, 0.57, 0.64),
        Spread(0.90, 0.05, 0.78, 1.02),
        Spread(0.335, 0.012, 0.30, 0.365, 0.01),
        Spread(0.20, 0.015, 0.16, 0.24),
    ),
    ("van_bus", "minibus"): _Row(
        Spread(5.55, 0.65, 4.75, 7.30),
        Spread(2.28, 0.150, 1.90, 2.85, 0.26),
        Spread(1.96, 0.035, 1.86, 2.08, 0.05),
        Spread(0.600, 0.018, 0.56, 0.64),
        Spread(0.95, 0.05, 0.84, 1.08),
        Spread(0.340, 0.012, 0.31, 0.37),
        Spread(0.21, 0.015, 0.17, 0.25),
    ),
    ("van_bus", "city_bus"): _Row(
        Spread(11.70, 0.80, 8.80, 12.60),
        Spread(3.02, 0.080, 2.85, 3.25),
        Spread(2.53, 0.025, 2.42, 2.55, 0.02),
        Spread(0.492, 0.008, 0.47, 0.515),
        Spread(2.68, 0.07, 2.50, 2.85),
        Spread(0.480, 0.012, 0.45, 0.51),
        Spread(0.30, 0.025, 0.24, 0.36),
    ),
    ("van_bus", "coach"): _Row(
        Spread(12.20, 0.60, 10.40, 13.50),
        Spread(3.58, 0.140, 3.25, 3.90),
        Spread(2.54, 0.010, 2.50, 2.55),
        Spread(0.510, 0.012, 0.48, 0.54),
        Spread(2.65, 0.07, 2.48, 2.82),
        Spread(0.500, 0.012, 0.47, 0.53),
        Spread(0.32, 0.025, 0.26, 0.38),
    ),
    ("van_bus", "small_van"): _Row(
        Spread(4.34, 0.18, 3.95, 4.80),
        Spread(1.84, 0.035, 1.76, 1.94, 0.05),
        Spread(1.77, 0.040, 1.66, 1.87, 0.10),
        Spread(0.628, 0.012, 0.60, 0.65),
        Spread(0.84, 0.03, 0.76, 0.92, 0.10),
        Spread(0.312, 0.010, 0.285, 0.335, 0.02),
        Spread(0.18, 0.012, 0.15, 0.21),
    ),
    ("pickup", "single_cab"): _Row(
        Spread(5.22, 0.22, 4.80, 5.80),
        Spread(1.74, 0.045, 1.62, 1.92, 0.05),
        Spread(1.80, 0.045, 1.69, 2.00, 0.12),
        Spread(0.590, 0.012, 0.565, 0.62),
        Spread(0.89, 0.04, 0.78, 1.00),
        Spread(0.365, 0.015, 0.33, 0.41),
        Spread(0.27, 0.025, 0.22, 0.34),
    ),
    ("pickup", "double_cab"): _Row(
        Spread(5.35, 0.20, 4.95, 5.95),
        Spread(1.80, 0.045, 1.69, 1.98, 0.10),
        Spread(1.86, 0.045, 1.74, 2.05, 0.14),
        Spread(0.595, 0.012, 0.57, 0.625),
        Spread(0.92, 0.04, 0.80, 1.02),
        Spread(0.380, 0.015, 0.34, 0.42),
        Spread(0.28, 0.025, 0.22, 0.34),
    ),
    ("box_truck", "cab_gap"): _Row(
        Spread(9.30, 1.40, 6.00, 12.00),
        Spread(3.42, 0.190, 2.70, 3.98, 0.14),
        Spread(2.45, 0.060, 2.05, 2.58, 0.06),
        Spread(0.560, 0.018, 0.52, 0.60),
        Spread(1.28, 0.07, 1.10, 1.45, 0.03),
        Spread(0.455, 0.020, 0.38, 0.52, 0.02),
        Spread(0.36, 0.030, 0.28, 0.44),
    ),
    ("box_truck", "no_gap"): _Row(
        Spread(7.20, 0.90, 5.60, 9.90),
        Spread(3.05, 0.160, 2.60, 3.80, 0.16),
        Spread(2.24, 0.070, 2.00, 2.55, 0.09),
        Spread(0.575, 0.018, 0.53, 0.61),
        Spread(1.10, 0.07, 0.95, 1.35, 0.06),
        Spread(0.395, 0.020, 0.34, 0.48, 0.03),
        Spread(0.32, 0.030, 0.25, 0.40),
    ),
}


def random_stream(class_name: str, style: str, seed: int) -> np.random.Generator:
    """Random generator of one body; it depends on class, style and seed only."""
    styles = [row for row in _TABLE if row[0] == class_name]
    words = (seed, CLASSES.index(class_name), 1 + styles.index((class_name, style)))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))


def draw_dimensions(class_name: str, style: str, rng: np.random.Generator) -> Dimensions:
    """Region, age and outer measures of a vehicle of this style, the first draws of its `random_stream`."""
    row = _TABLE[class_name, style]
    region = draw_region(class_name, style, rng)
    age = draw_age(rng)
    times, grown = scale(region, style), growth(style, age)
    reference = row.length.draw(rng)
    height, width, fraction, overhang, radius, clearance = (
        spread.draw(rng, reference - row.length.mean) for spread in row[1:]
    )
    length = reference * times.length + grown.length
    front_axle = 0.5 * length - overhang * times.length
    return Dimensions(
        length=length,
        height=height * times.height + grown.height,
        width=width * times.width + grown.width,
        front_axle=front_axle,
        rear_axle=front_axle - fraction * length,
        wheel_radius=radius * times.width + 0.3 * grown.width,
        clearance=clearance - 0.2 * grown.width,
        region=region,
        age=age,
    )
