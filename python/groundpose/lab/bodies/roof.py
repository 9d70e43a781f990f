"""What stands on some roofs: boxes, bars, ladders, taxi signs, beacons. Box and keypoints leave them out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.common import bar, padded
from groundpose.lab.bodies.geometry.mesh import Component, cross
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import keypoint_names

# Fraction of the bodies of each style that carry a thing; one at most.
_FRACTIONS: dict[str, dict[str, float]] = {
    "sedan": {"bars": 0.03, "roof_box": 0.03, "taxi_sign": 0.07},
    "hatchback": {"bars": 0.04, "roof_box": 0.04, "taxi_sign": 0.02},
    "estate": {"bars": 0.08, "roof_box": 0.09, "taxi_sign": 0.06},
    "suv": {"bars": 0.07, "roof_box": 0.08, "taxi_sign": 0.01},
    "van": {"ladder": 0.14, "bars": 0.05, "beacon": 0.04},
    "minibus": {"roof_box": 0.06, "taxi_sign": 0.04},
    "single_cab": {"beacon": 0.10},
    "double_cab": {"beacon": 0.06, "bars": 0.04},
    "cab_gap": {"beacon": 0.06},
    "no_gap": {"beacon": 0.06},
}
# The keypoint at which the roof that carries things ends.
_END = {
    "car": "rear_window_top",
    "van_bus": "roof_rear",
    "pickup": "cab_roof_rear",
    "box_truck": "cab_window",
}
_BAR_RISE = 0.07


@dataclass(frozen=True, eq=False)
class Roof:
    """A roof between z `rear` and `front`; `half`: half its usable width; triangles (F, 3, 3)."""

    triangles: FloatArray
    front: float
    rear: float
    half: float

    @property
    def length(self) -> float:
        """Metres along z."""
        return self.front - self.rear

    def y(self, x: float, z: float) -> float:
        """y of the roof at a place, that of the highest triangle there."""
        a, b, c = (self.triangles[:, i] for i in range(3))
        at = np.array([x, 0.0, z])
        w = np.stack([cross(q - p, at - p)[:, 1] for p, q in ((b, c), (c, a), (a, b))], axis=1)
        area = w.sum(axis=1)
        inside = (np.abs(area) > 1e-9) & ((w * np.sign(area)[:, None]) >= -1e-9).all(axis=1)
        heights = (w[inside] * self.triangles[inside, :, 1]).sum(axis=1) / area[inside]
        return float(heights.min(initial=0.0))


def roof_things(
    class_name: str, style: str, seed: int, shells: Sequence[Component], keypoints_3d: FloatArray
) -> list[Component]:
    """The things on the roof of a body, drawn from a stream of their own; `shells` are its large surfaces."""
    rng = np.random.default_rng([87, seed, CLASSES.index(class_name)])
    chance, fractions = rng.random(), _FRACTIONS.get(style, {})
    for name, fraction in fractions.items():
        if chance < fraction:
            return _MAKERS[name](_roof(class_name, shells, keypoints_3d), rng)
        chance -= fraction
    return []


def _roof(class_name: str, shells: Sequence[Component], keypoints_3d: FloatArray) -> Roof:
    names = keypoint_names(class_name)
    top, end = (keypoints_3d[names.index(f"right_{name}")] for name in ("windscreen_top", _END[class_name]))
    triangles = np.concatenate([part.vertices[part.faces] for part in shells])
    return Roof(triangles, float(top[2]) - 0.15, float(end[2]) + 0.15, 0.75 * float(top[0]))


def _bars(roof: Roof, rng: np.random.Generator) -> list[Component]:
    material = ("plastic", "metal", "chrome")[int(rng.integers(3))]
    return [_bar(roof, roof.rear + fraction * roof.length, material) for fraction in (0.2, 0.8)]


def _bar(roof: Roof, z: float, material: str) -> Component:
    """A bar across the roof on two feet."""
    y = roof.y(0.0, z) - _BAR_RISE
    foot = roof.y(roof.half, z) + 0.01
    path = [(-roof.half, foot), (-0.96 * roof.half, y), (0.96 * roof.half, y), (roof.half, foot)]
    return bar(np.array([[x, h, z] for x, h in path]), 0.016, material)


def _roof_box(roof: Roof, rng: np.random.Generator) -> list[Component]:
    length = min(float(rng.uniform(1.5, 2.2)), 0.95 * roof.length + 0.3)
    width = min(float(rng.uniform(0.55, 0.9)), 1.7 * roof.half)
    height, material = (
        float(rng.uniform(0.28, 0.38)),
        ("plastic", "plastic", "paint_second")[int(rng.integers(3))],
    )
    aside = float(rng.choice([0.0, 0.3])) * (2.0 * roof.half - width)
    z = 0.5 * (roof.front + roof.rear) + 0.1
    y = roof.y(0.0, z) - _BAR_RISE - 0.5 * height
    return [*_bars(roof, rng), padded((width, height, length), 0.12, material, (aside, y, z))]


def _taxi_sign(roof: Roof, rng: np.random.Generator) -> list[Component]:
    z = roof.rear + float(rng.uniform(0.55, 0.85)) * roof.length
    size = rng.uniform([0.32, 0.11, 0.10], [0.55, 0.16, 0.16])
    return [padded(size, 0.03, "reversing_lamp", (0.0, roof.y(0.0, z) - 0.5 * float(size[1]) + 0.02, z))]


def _ladder(roof: Roof, rng: np.random.Generator) -> list[Component]:
    """A ladder along the roof on bars, on one side."""
    bars = _bars(roof, rng)
    x, half = float(rng.uniform(-0.5, 0.5)) * roof.half, 0.19
    y = min(roof.y(0.0, roof.rear + f * roof.length) for f in (0.2, 0.8)) - _BAR_RISE - 0.045
    ends = roof.rear + 0.05, roof.front - 0.1
    rails = [bar(np.array([[x + s * half, y, z] for z in ends]), 0.028, "metal") for s in (-1, 1)]
    rungs = [
        bar(np.array([[x - half, y, z], [x + half, y, z]]), 0.016, "metal", 4)
        for z in np.arange(ends[0] + 0.15, ends[1] - 0.1, 0.3).tolist()
    ]
    return [*bars, *rails, *rungs]


def _beacon(roof: Roof, rng: np.random.Generator) -> list[Component]:
    """One round beacon or a bar of them, amber."""
    z = roof.rear + 0.7 * roof.length
    width = float(rng.choice([0.15, 1.1 * roof.half]))
    y = roof.y(0.0, z)
    return [padded((width, 0.13, 0.15), 0.05, "indicator", (0.0, y - 0.04, z))]


_MAKERS: dict[str, Callable[[Roof, np.random.Generator], list[Component]]] = {
    "bars": _bars,
    "roof_box": _roof_box,
    "taxi_sign": _taxi_sign,
    "ladder": _ladder,
    "beacon": _beacon,
}
