"""Random surroundings of the traffic: the light of a drive and the things beside its road."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from groundpose._checks import input_error
from groundpose.lab.drive.assets import SKIES, environments, skies
from groundpose.lab.drive.frontages import FRONTAGES, LOTS, MEDIAN_TOP, MEDIANS, Frontage
from groundpose.lab.drive.props import CONCRETE, MAKERS
from groundpose.lab.drive.render.lighting import DAY, KINDS
from groundpose.lab.drive.road import Road
from groundpose.lab.drive.scene import Light, Prop

Generator = np.random.Generator


def light(rng: Generator, split: str = "train") -> Light:
    """Draw a light; its sky is one of the split's.

    Raises:
        InputError: an unknown split.
    """
    if split not in SKIES:
        raise input_error("split", f"one of {', '.join(SKIES)}", repr(split))
    names, fractions = list(KINDS), np.array([kind.fraction for kind in KINDS.values()])
    name = names[rng.choice(len(names), p=fractions / fractions.sum())]
    kind = KINDS[name]
    usable = [i for i in skies(split) if environments()[i].name in (kind.skies or DAY)] or list(skies(split))
    elevation, azimuth = np.radians(rng.uniform(*kind.elevation)), rng.uniform(-np.pi, np.pi)
    if name == "glare":  # the sun is ahead
        azimuth = rng.normal(0.0, 0.45)
    flat = np.cos(elevation)
    return Light(
        kind=name,
        sun_direction=np.array([flat * np.sin(azimuth), -np.sin(elevation), flat * np.cos(azimuth)]),
        sun_strength=float(rng.uniform(*kind.strength)),
        sky=int(rng.choice(usable)),
        exposure=float(np.exp(rng.uniform(*np.log(kind.exposure)))),
        seed=int(rng.integers(2**31)),
    )


# Things in a row on the edge of the pavement: mean distance in metres (0 = none); probability for each side.
ROWS: dict[str, tuple[tuple[str, float, float], ...]] = {
    "street": (
        ("tree", 11.0, 0.4),
        ("pole", 28.0, 0.8),
        ("bollard", 3.0, 0.2),
        ("sign", 30.0, 0.9),
        ("bin", 25.0, 0.5),
    ),
    "avenue": (("tree", 10.0, 0.75), ("pole", 30.0, 0.9), ("sign", 30.0, 0.9), ("bush", 12.0, 0.2)),
    "country": (("tree", 14.0, 0.4), ("bollard", 30.0, 0.8), ("sign", 70.0, 0.7), ("bush", 15.0, 0.4)),
    "motorway": (("pole", 45.0, 0.5), ("sign", 80.0, 0.8), ("bush", 14.0, 0.5), ("bollard", 40.0, 0.7)),
    "yard": (("pole", 25.0, 0.7), ("bush", 12.0, 0.4), ("bin", 30.0, 0.3)),
}
PEOPLE = {"street": 0.035, "avenue": 0.03, "yard": 0.01}  # per metre of one side

RAILS = {"motorway": 0.7, "country": 0.2}  # probability of a crash barrier on one side

# Sizes (width, height, length) in metres: low and high.
_SIZES: dict[str, tuple[tuple[float, float], tuple[float, float], tuple[float, float]]] = {
    "tree": ((3.5, 7.5), (5.0, 12.0), (3.5, 7.5)),
    "bush": ((1.0, 3.0), (0.7, 2.2), (1.0, 3.0)),
    "pole": ((6.0, 9.0), (6.0, 9.0), (6.0, 9.0)),
    "bollard": ((0.1, 0.2), (0.8, 1.1), (0.1, 0.2)),
    "sign": ((2.4, 2.4), (2.3, 3.2), (2.4, 2.4)),
    "bin": ((0.55, 0.7), (0.95, 1.2), (0.55, 0.8)),
    "person": ((1.65, 1.75), (1.55, 1.92), (1.65, 1.75)),
    "cyclist": ((1.75, 1.85), (1.6, 1.85), (1.75, 1.85)),
    "traffic_light": ((3.2, 3.2), (3.2, 3.8), (3.2, 3.2)),
}
_SUNK = 0.3  # depth of things in the ground, metres, because the ground may slope under them


def props(road: Road, rng: Generator) -> tuple[Prop, ...]:
    """Draw the things beside a road: house fronts, walls, hedges, trees, poles, signs, people."""
    out: list[Prop] = []
    for side in (-1, 1):
        edge = road.layout.edge(side)
        back = edge + road.layout.pavement + (0.2 if road.layout.kerb else 1.5)
        out += _fronts(road, rng, side, back)
        for kind, distance, chance in ROWS[road.layout.kind]:
            if rng.random() < chance:
                out += _row(road, rng, side, kind, distance, edge)
        out += _people(road, rng, side, edge)
        if rng.random() < RAILS.get(road.layout.kind, 0.0):
            out += _rails(road, side, edge + rng.uniform(0.5, 1.2))
    if road.junction is not None and road.layout.kind in ("street", "avenue") and rng.random() < 0.6:
        j = road.junction
        for side in (-1, 1):
            s, d = j.s - side * (j.half_width + 1.0), side * (road.layout.edge(side) + 0.6)
            out.append(_thing(road, rng, "traffic_light", s, d, 0.0 if side > 0 else np.pi))
    return (*out, *_median(road, rng))


def _fronts(road: Road, rng: Generator, side: int, back: float) -> list[Prop]:
    """Successive sections of frontage; their weights are drawn once per street."""
    choices, fractions = zip(*FRONTAGES[road.layout.kind], strict=True)
    weights = np.array(fractions) * rng.gamma(0.6, size=len(fractions))
    out: list[Prop] = []
    s = road.start
    while s < road.end:
        length = rng.uniform(9.0, 32.0)
        middle = s + 0.5 * length
        front = choices[rng.choice(len(choices), p=weights / weights.sum())]
        if any(lot.meets(side, s, s + length) for lot in road.lots):
            front = LOTS[rng.integers(len(LOTS))]
        s += length + (rng.uniform(0.0, 5.0) if rng.random() < 0.4 else 0.0)
        if _crossed(road, middle, 0.5 * length):
            continue
        if front.line is not None:
            out += _line(road, rng, front, middle - 0.5 * length, length, side * back)
        if front.behind is not None:
            out += _behind(road, rng, front, middle, length, side, back)
    return out


def _crossed(road: Road, s: float, reach: float) -> bool:
    """Whether a crossing street is in the way."""
    return road.junction is not None and abs(s - road.junction.s) < road.junction.half_width + 2.0 + reach


def _line(road: Road, rng: Generator, front: Frontage, start: float, length: float, d: float) -> list[Prop]:
    """A hedge, wall or fence in pieces that follow the road, or single trees and bushes."""
    kind = front.line
    assert kind is not None
    if kind in ("tree", "bush"):
        n = rng.poisson(length / (5.0 if kind == "tree" else 2.0))
        places = (start + length * rng.random(n)).tolist()
        return [_thing(road, rng, kind, s, d + np.sign(d) * rng.uniform(1.0, 4.0)) for s in places]
    thick, low, high = {
        "hedge": (0.9, 0.9, 2.4), "fence": (0.05, 0.9, 2.0), "wall": (0.3, 0.8, 2.6),
        "barrier": (0.3, 2.0, 4.5),
    }[kind]  # fmt: skip
    height, seed = rng.uniform(low, min(high, front.top)), int(rng.integers(2**31))
    pieces = max(1, round(length / 4.0))
    step = length / pieces
    name = "wall" if kind == "barrier" else kind
    seed = seed - seed % len(MAKERS["wall"]) + CONCRETE if kind == "barrier" else seed
    middles = start + step * (np.arange(pieces) + 0.5)
    return [_placed(road, name, seed, s, d, 0.0, (thick, height, 1.02 * step)) for s in middles.tolist()]


def _behind(
    road: Road, rng: Generator, front: Frontage, s: float, length: float, side: int, back: float
) -> list[Prop]:
    """A house along the street, or trees."""
    setback = rng.uniform(*front.setback)
    if front.behind == "tree":
        n = rng.poisson(length / 4.0)
        places = s + length * (rng.random(n) - 0.5)
        return [
            _thing(road, rng, "tree", at, side * (back + 2.0 + setback + rng.uniform(0.0, 12.0)), scale=1.25)
            for at in places
        ]
    depth, height = rng.uniform(*front.depth), rng.uniform(*front.height)
    d = side * (back + setback + 0.5 * depth)
    house = _placed(road, "building", int(rng.integers(2**31)), s, d, 0.0, (depth, height, length), sunk=0.8)
    return [house]


def _row(road: Road, rng: Generator, side: int, kind: str, distance: float, edge: float) -> list[Prop]:
    """The same thing repeated near the edge of the road."""
    d = side * (edge + (0.7 if road.layout.kerb else 1.8))
    gaps = distance * np.maximum(
        0.3, rng.normal(1.0, 0.25, size=int((road.end - road.start) / (0.6 * distance)) + 1)
    )
    places = road.start + np.cumsum(gaps)
    kept = [float(s) for s in places if s < road.end and not _crossed(road, float(s), 1.5)]
    turn = {"sign": 0.0 if side > 0 else np.pi, "pole": np.pi if side > 0 else 0.0}.get(kind)
    out = [_thing(road, rng, kind, s, d + side * rng.uniform(0.0, 0.4), turn) for s in kept]
    if kind in ("tree", "pole", "bollard") and out:  # the same variant for the whole row
        alike = out[0]
        out = [replace(p, seed=alike.seed, size=alike.size * rng.uniform(0.9, 1.1)) for p in out]
    return out


def _people(road: Road, rng: Generator, side: int, edge: float) -> list[Prop]:
    rate = PEOPLE.get(road.layout.kind, 0.0) * rng.gamma(0.7) / 0.7
    out = []
    for _ in range(rng.poisson(rate * (road.end - road.start))):
        kind = "cyclist" if rng.random() < 0.2 else "person"
        s, d = (
            rng.uniform(road.start, road.end),
            side * (edge + rng.uniform(0.4, max(0.6, road.layout.pavement - 0.3))),
        )
        if not _crossed(road, s, 1.0):
            turn = rng.choice([0.0, np.pi]) + rng.normal(0.0, 0.3)
            out.append(_thing(road, rng, kind, s, d, turn))
    return out


def _median(road: Road, rng: Generator) -> list[Prop]:
    """What separates the two directions, in sections."""
    if road.layout.median == 0.0:
        return []
    kinds = MEDIANS[road.layout.kind]
    kind = str(rng.choice(list(kinds), p=list(kinds.values())))
    if kind == "none":
        return []
    if kind == "rail":
        return [p for side in (-1, 1) for p in _rails(road, side, -0.2)]
    front, length, out = Frontage(kind, None, top=MEDIAN_TOP), 24.0, []
    for s in np.arange(road.start, road.end - length, length).tolist():
        if not _crossed(road, s + 0.5 * length, 0.5 * length):
            out += _line(road, rng, front, s, length, 0.0)
    return out


def _rails(road: Road, side: int, d: float) -> list[Prop]:
    """A crash barrier in pieces of 4 m, its beam towards the road."""
    kept = [s for s in np.arange(road.start + 2.0, road.end, 4.0).tolist() if not _crossed(road, s, 2.0)]
    turn = 0.0 if side > 0 else np.pi
    return [_placed(road, "rail", 0, s, side * d, turn, (0.35, 0.75, 4.02)) for s in kept]


def _thing(
    road: Road, rng: Generator, kind: str, s: float, d: float, turn: float | None = None, scale: float = 1.0
) -> Prop:
    """One thing of random size; poles, people and signs keep their proportions."""
    size = np.array([rng.uniform(*limits) for limits in _SIZES[kind]]) * scale
    if kind in ("pole", "person", "cyclist", "sign", "traffic_light"):
        size[[0, 2]] = size[1]
    if kind == "tree":
        size[[0, 2]] = size[1] * rng.uniform(0.5, 0.85)
    angle = rng.uniform(-np.pi, np.pi) if turn is None else turn
    return _placed(road, kind, int(rng.integers(2**31)), s, d, angle, tuple(size), sunk=0.03)


def _placed(
    road: Road,
    kind: str,
    seed: int,
    s: float,
    d: float,
    turn: float,
    size: tuple[float, ...],
    sunk: float = _SUNK,
) -> Prop:
    """A prop on the ground, rotated relative to the direction of the road."""
    position = road.world(s, d, road.lift(np.array([s]), np.array([d])))[0] + [0.0, sunk, 0.0]
    filled = np.add(size, [0.0, sunk, 0.0])
    return Prop(kind, seed, position, float(road.heading_at(s)[0] + turn), filled)
