"""The numbers that the solver has to reach, each of them once: `groundpose evaluate targets` and `bench`."""

from __future__ import annotations

import math
from dataclasses import dataclass

AT_MOST, AT_LEAST = "at most", "at least"
OWN, PAPER = "our own", "the paper"


@dataclass(frozen=True)
class Target:
    """One row of the table."""

    id: str
    measure: str
    """What it is about: rows of one measure stand together."""
    what: str
    """The number."""
    value: float
    comparison: str = AT_MOST
    unit: str = ""
    source: str = OWN
    aim: str = ""
    """A harder number to work towards, in words."""

    def text(self) -> str:
        """For a table."""
        return f"{self.comparison} {self.value:g}{self.unit}" + (f"; aim {self.aim}" if self.aim else "")

    def check(self, value: float, what: str = "") -> Check:
        """A measured value against it; `what`: the setting that was worst, instead of the table's words."""
        return Check(what or self.what, float(value), self)


@dataclass(frozen=True)
class Check:
    """One number against its target."""

    what: str
    value: float
    target: Target

    @property
    def met(self) -> bool:
        """A value that is not a number meets nothing."""
        if self.target.comparison == AT_LEAST:
            return bool(self.value >= self.target.value)
        return bool(self.value <= self.target.value)

    @property
    def known(self) -> bool:
        """Whether it was measured."""
        return not math.isnan(self.value)

    def shortfall(self) -> str:
        """How far off, in words; empty when met."""
        if self.met:
            return ""
        if not math.isfinite(self.value):
            return f"{self.what}: no value"
        limit, unit = self.target.value, self.target.unit
        gap = abs(self.value - limit)
        relative = f" ({100 * gap / abs(limit):.1f} %)" if limit else ""
        wanted = f"{self.target.comparison} {limit:g}{unit}"
        return f"{self.what}: {self.value:.4g}{unit}, not {wanted}; missed by {gap:.3g}{relative}"


_V1 = "V1 vehicles, Python batch call, one thread, default"
_E1 = "E1, 300 keypoints"
_SHAPE = "28 keypoints with shape, M = 5, HRE as the paper's timing"
_OVERHEAD = "Python's part of a batch call"
_GROWTH = "growth of the cost"
_REAL = "real CNN keypoints, KITTI"
_COVARIANCE = "stated covariances hold the truth"
_CHANCE = "chance is refused"
_FASTER = "PoseLib tuned / ours"
_TABLE = (
    Target("p1p", "exact data", "worst scene, e_r of the best hypothesis", 1e-3, unit=" deg"),
    Target("e1", _E1, "10 to 70 % outliers, mean e_r / oracle", 1.05),
    Target("e1-90", _E1, "90 % outliers, mean e_r / oracle", 1.2),
    Target("e1-90 failures", _E1, "failures, worst outlier model", 0.0),
    Target("e1-tilt", _E1, "tilt prior 0.1 deg, mean e_r / oracle", 1.1),
    Target("flat", "E3 and E4, no priors", "mean e_r at the worst error / at zero", 1.1),
    Target("flat-prior", "E3, default priors", "mean e_r at the worst error / at zero", 1.25),
    Target("real above 15 deg", _REAL, "above 15 deg", 8.0, unit=" %"),
    Target("real median e_r", _REAL, "median e_r", 2.3, unit=" deg"),
    Target("coverage least", _COVARIANCE, "default, least fraction inside", 90.0, AT_LEAST, " %"),
    Target("coverage most", _COVARIANCE, "default, largest fraction inside", 99.0, unit=" %"),
    Target("chance accepted", _CHANCE, "random keypoints called ok", 5.0, unit=" %"),
    Target("chance refused", _CHANCE, "true scenes refused", 1.0, unit=" %"),
    Target("memory", "memory of a batch", "bytes per object beyond inputs and outputs", 1024.0, unit=" B"),
    Target("v1 time", _V1, _FASTER, 8.0, AT_LEAST, " x", aim="10 x"),
    Target("v1 e_r", _V1, "mean e_r", 2.2, unit=" deg"),
    Target("v1 failures", _V1, "failures", 1.2, unit=" %"),
    Target("e1 50 time", _E1, f"50 % outliers, {_FASTER}", 12.0, AT_LEAST, " x"),
    Target("e1 90 time", _E1, f"90 % outliers, {_FASTER}", 220.0, AT_LEAST, " x"),
    Target("shape ratio", _SHAPE, "ours / PoseLib tuned with the true rigid shape", 0.6, unit=" x"),
    Target("shape time", _SHAPE, "per object", 20.0, unit=" us"),
    Target("shape default", "28 keypoints with shape, M = 5, default", "per object", 18.0, unit=" us"),
    Target("overhead call", _OVERHEAD, "per call", 14.0, unit=" us"),
    Target("overhead estimator", _OVERHEAD, "per call of an `Estimator`", 8.0, unit=" us"),
    Target("overhead object", _OVERHEAD, "per object", 0.3, unit=" us"),
    Target("threads", "two threads", "one thread / two, 10,000 objects", 1.9, AT_LEAST, " x"),
    Target("threads of a call", "two threads", "one thread / two, 1,000 objects", 1.8, AT_LEAST, " x"),
    Target("allocations", "allocations", "per object, warm, every refinement", 0.0),
    Target(
        "native",
        "wheel against native build",
        "installed / target-cpu=native, the worse setting",
        1.1,
        unit=" x",
    ),
    Target("growth keypoints", _GROWTH, "exponent of keypoints, 66 to 1000", 1.1),
    Target("growth objects", _GROWTH, "exponent of objects of a call, 100 to 10,000", 1.1),
    Target("growth outliers", _GROWTH, "longest / shortest, 10 to 70 % outliers", 2.0, unit=" x"),
)
TARGETS = {target.id: target for target in _TABLE}
