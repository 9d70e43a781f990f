"""Random roads of five kinds: street, avenue, country road, motorway and car park."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive.road import STEP, Junction, Lane, Layout, Parking, Road, centre_line

BEHIND = 60.0
"""Metres of road behind the start."""


@dataclass(frozen=True)
class RoadKind:
    """Ranges `(low, high)` of a kind of road; names with std: standard deviations of a random function of s.

    Lanes are counted for one direction; `parking` gives the fraction of rows of each kind ("none" too).
    """

    fraction: float
    lanes: tuple[int, ...]
    lane_width: tuple[float, float]
    speed: tuple[float, float]
    curvature_std: float
    slope_std: float
    bank_std: float
    crown: tuple[float, float]
    roughness: tuple[float, float]
    parking: dict[str, float]
    kerb: bool = True
    pavement: tuple[float, float] = (0.0, 0.0)
    median: tuple[float, float] = (0.0, 0.0)
    shoulder: float = 0.0
    junctions: float = 0.0
    gap: tuple[float, float] = (8.0, 40.0)


# Speeds in m/s; roughness scales the bumps under the wheels; `gap` is the mean distance between vehicles
# of a lane in addition to the distance that their speed requires.
ROAD_KINDS = {
    "street": RoadKind(
        fraction=0.42,
        lanes=(1,),
        lane_width=(2.8, 3.3),
        speed=(3.0, 13.0),
        curvature_std=1 / 250,
        slope_std=0.018,
        bank_std=0.008,
        crown=(0.0, 0.025),
        roughness=(0.7, 1.6),
        parking={"parallel": 0.62, "angled": 0.08, "perpendicular": 0.12, "none": 0.18},
        pavement=(1.8, 4.0),
        junctions=0.6,
        gap=(6.0, 35.0),
    ),
    "avenue": RoadKind(
        fraction=0.22,
        lanes=(2, 2, 3),
        lane_width=(3.0, 3.5),
        speed=(6.0, 17.0),
        curvature_std=1 / 500,
        slope_std=0.014,
        bank_std=0.008,
        crown=(0.0, 0.02),
        roughness=(0.5, 1.2),
        parking={"parallel": 0.4, "angled": 0.1, "perpendicular": 0.1, "none": 0.4},
        pavement=(2.5, 6.0),
        median=(0.0, 2.0),
        junctions=0.65,
        gap=(6.0, 30.0),
    ),
    "country": RoadKind(
        fraction=0.14,
        lanes=(1,),
        lane_width=(3.0, 3.7),
        speed=(14.0, 26.0),
        curvature_std=1 / 260,
        slope_std=0.026,
        bank_std=0.02,
        crown=(0.0, 0.02),
        roughness=(0.6, 1.4),
        parking={"none": 1.0},
        kerb=False,
        gap=(15.0, 60.0),
    ),
    "motorway": RoadKind(
        fraction=0.14,
        lanes=(2, 3, 3, 4),
        lane_width=(3.5, 3.75),
        speed=(22.0, 36.0),
        curvature_std=1 / 1500,
        slope_std=0.014,
        bank_std=0.012,
        crown=(0.0, 0.0),
        roughness=(0.35, 0.8),
        parking={"none": 1.0},
        kerb=False,
        median=(1.0, 2.5),
        shoulder=2.5,
        gap=(10.0, 45.0),
    ),
    "yard": RoadKind(
        fraction=0.08,
        lanes=(1,),
        lane_width=(2.8, 3.2),
        speed=(2.0, 6.0),
        curvature_std=1 / 400,
        slope_std=0.015,
        bank_std=0.01,
        crown=(0.0, 0.01),
        roughness=(0.9, 1.8),
        parking={"perpendicular": 0.75, "angled": 0.25},
        pavement=(1.0, 2.0),
        gap=(15.0, 60.0),
    ),
}

MAST_FRACTIONS = {"street": 0.25, "avenue": 0.25, "country": 0.08, "motorway": 0.2, "yard": 0.22}
"""Fractions of the kinds of roads with a camera on a mast."""

# Of a parking place: angle to the road, depth across it, pitch along it with a margin between cars; metres.
_PARKING = {
    "parallel": (0.0, 2.25, 6.0),
    "angled": (math.radians(60), 5.2, 3.3),
    "perpendicular": (math.pi / 2, 5.1, 2.75),
}

# Duration of a drive, seconds.
_SECONDS = 10.0
# Around a junction the road is straight and plane for the first length; it is free again after the second.
_JUNCTION_FLAT, _JUNCTION_FADE = 28.0, 40.0


def make_road(rng: np.random.Generator, kind: str, length: float, rows: bool = False) -> Road:
    """A random road of `kind` from BEHIND metres before the start to `length` metres after it.

    `rows`: a yard has further aisles and rows of places on both sides.
    """
    made = ROAD_KINDS[kind]
    layout = _layout(rng, kind, made)
    if rows and kind == "yard":
        layout = _with_aisles(rng, layout)
    s = np.arange(-BEHIND, length + STEP, STEP)
    junction = _junction(rng, made, layout, length)
    free = _free(s, junction)
    # most roads are nearly straight, some are winding
    curvature = made.curvature_std * min(rng.gamma(1.5, 0.7), 2.2) * free * wave(rng, s, (90.0, 300.0))
    bank = made.bank_std * wave(rng, s, (60.0, 200.0)) - curvature * rng.uniform(0.0, 6.0)
    slope = rng.normal(0.0, 0.6 * made.slope_std) + np.cumsum(
        free * np.gradient(made.slope_std * rng.uniform(0.3, 1.3) * wave(rng, s, (70.0, 250.0)))
    )
    height = np.cumsum(np.clip(slope, -0.12, 0.12)) * STEP
    centre, heading = centre_line(-BEHIND, curvature)
    return Road(
        layout=layout,
        start=-BEHIND,
        centre=centre,
        heading=heading,
        curvature=curvature,
        height=height - height[round(BEHIND / STEP)],
        bank=free * np.clip(bank, -0.08, 0.08),
        crown=free * rng.uniform(*made.crown),
        junction=junction,
    )


def wave(
    rng: np.random.Generator, s: FloatArray, wavelengths: tuple[float, float], terms: int = 4
) -> FloatArray:
    """A smooth random function of s with variance one: a sum of sines."""
    lengths = np.exp(rng.uniform(math.log(wavelengths[0]), math.log(wavelengths[1]), terms))
    phases = rng.uniform(0.0, 2.0 * np.pi, terms)
    weights = rng.dirichlet(np.ones(terms))
    return np.asarray(np.sqrt(2.0 * weights) @ np.sin(2.0 * np.pi * s / lengths[:, None] + phases[:, None]))


def _layout(rng: np.random.Generator, kind: str, made: RoadKind) -> Layout:
    """Lanes outwards from the middle, then shoulder or parking, then the edge."""
    width = float(rng.uniform(*made.lane_width))
    median = float(rng.uniform(*made.median))
    median = median if median > 0.4 else 0.0
    count, speed = int(rng.choice(made.lanes)), float(rng.uniform(*made.speed))
    lanes, edges, parking = [], [], []
    for side in (-1, 1):
        inner = median + (0.3 if median else 0.0)
        for n in range(count):
            # the lane nearest the middle is the fastest
            lanes.append(
                Lane(side * (inner + (n + 0.5) * width), width, side, speed * 1.08 ** (count - 1 - n))
            )
        edge = inner + count * width + made.shoulder + (0.0 if made.kerb else 0.4)
        row = str(rng.choice(list(made.parking), p=list(made.parking.values())))
        if row != "none":
            angle, depth, pitch = _PARKING[row]
            taken = float(rng.uniform(0.35, 0.95))
            parking.append(Parking(side * (edge + 0.1 + 0.5 * depth), side, pitch, angle, depth, taken))
            edge += depth + 0.1
        edges.append(edge + (0.25 if made.kerb else 0.0))
    return Layout(
        kind=kind,
        lanes=tuple(lanes),
        parking=tuple(parking),
        left=edges[0],
        right=edges[1],
        kerb=made.kerb,
        pavement=float(rng.uniform(*made.pavement)),
        median=median,
        shoulder=made.shoulder,
        extent=max(edges) + 45.0,
    )


def _with_aisles(rng: np.random.Generator, layout: Layout) -> Layout:
    """A car park: beyond the rows of a yard up to two more aisles on each side, each between two rows."""
    angle, depth, pitch = _PARKING["perpendicular"]
    width, speed = layout.lanes[0].width, layout.lanes[0].speed
    lanes, parking, edges = list(layout.lanes), list(layout.parking), []
    for side in (-1, 1):
        edge = layout.edge(side)
        for _ in range(int(rng.integers(0, 3))):
            aisle = edge + depth + 0.1
            beyond = aisle + 2.0 * width + 0.1
            for n, direction in ((0.5, -side), (1.5, side)):
                lanes.append(Lane(side * (aisle + n * width), width, direction, speed))
            for start, toward in ((edge, -side), (beyond, side)):
                taken = float(rng.uniform(0.35, 0.95))
                parking.append(Parking(side * (start + 0.5 * depth), toward, pitch, angle, depth, taken))
            edge = beyond + depth + 0.25
        edges.append(edge)
    return replace(
        layout,
        lanes=tuple(lanes),
        parking=tuple(parking),
        left=edges[0],
        right=edges[1],
        extent=layout.extent + max(edges) - max(layout.left, layout.right),
    )


def _junction(rng: np.random.Generator, made: RoadKind, layout: Layout, length: float) -> Junction | None:
    if rng.random() >= made.junctions:
        return None
    # where the camera, which starts at 0, will approach it
    s = float(np.round(rng.uniform(25.0, min(40.0 + _SECONDS * layout.lanes[0].speed, length - 60.0))))
    half_width = float(rng.uniform(3.2, 5.0))
    return Junction(s, half_width, max(layout.left, layout.right) + 32.0, bool(rng.random() < 0.5))


def _free(s: FloatArray, junction: Junction | None) -> FloatArray:
    """1 away from the junction, 0 near it, smooth between."""
    if junction is None:
        return np.ones(len(s))
    fraction = np.clip((np.abs(s - junction.s) - _JUNCTION_FLAT) / _JUNCTION_FADE, 0.0, 1.0)
    return np.asarray(fraction**2 * (3.0 - 2.0 * fraction))
