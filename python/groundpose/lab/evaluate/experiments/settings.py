"""What is varied: one `Setting` is one point of every curve of one figure."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from groundpose.lab.contenders.objects import Objects
from groundpose.lab.evaluate.scenes import generate

OUTLIERS = ("image", "box")
OUTLIER_RATIOS = tuple(k / 10 for k in range(1, 10))
POINTS = (50, 100, 150, 200, 300, 400, 600, 800, 1000)
PITCH_ERRORS_DEG = (-5.0, -4.0, -3.0, -2.0, -1.5, -1.0, 0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
BBOX_ERRORS_PX = tuple(float(k) for k in range(-5, 6))
BBOX_ERROR_KINDS = ("outward", "shift")


@dataclass(frozen=True)
class Setting:
    """One value of what an experiment varies, with one outlier model. `curve` names the x axis it belongs
    to."""

    curve: str
    """outlier_ratio, n_points, pitch_error_deg, bbox_error outward, bbox_error shift"""
    value: float
    outliers: str
    options: dict[str, Any] = field(compare=False)
    """Arguments of `scenes.generate`."""

    @property
    def key(self) -> str:
        """Its name in stored results."""
        return f"{self.curve} {self.value:g}, outliers {self.outliers}"

    def scenes(self, trials: int, seed: int) -> Objects:
        """Its objects; trial k depends on (seed, k) only."""
        return _generate(tuple(self.options.items()), self.outliers, trials, seed)


@lru_cache(maxsize=2)
def _generate(options: tuple[tuple[str, Any], ...], outliers: str, trials: int, seed: int) -> Objects:
    return generate("cube", trials, seed=seed, outliers=outliers, **dict(options))


def _curve(curve: str, values: tuple[float, ...], argument: str, **fixed: Any) -> list[Setting]:
    return [
        Setting(curve, value, outliers, {argument: value, **fixed})
        for outliers in OUTLIERS
        for value in values
    ]


E1 = _curve("outlier_ratio", OUTLIER_RATIOS, "outlier_ratio")
E2 = _curve("n_points", POINTS, "n_points")
E3 = _curve("pitch_error_deg", PITCH_ERRORS_DEG, "pitch_error_deg")
E4 = [
    setting
    for kind in BBOX_ERROR_KINDS
    for setting in _curve(f"bbox_error {kind}", BBOX_ERRORS_PX, "bbox_error", bbox_error_kind=kind)
]
EXPERIMENTS: dict[str, list[Setting]] = {"E1": E1, "E2": E2, "E3": E3, "E4": E4, "HRE": [*E3, *E4]}
QUICK = [
    *(s for s in E1 if s.value in (0.5, 0.9)),
    *(s for s in E2 if s.value == 50),
    *(s for s in E3 if s.value == 3.0 and s.outliers == "box"),
    *(s for s in E4 if s.value == 3.0 and s.outliers == "box"),
]
"""A few settings that a test can afford; stored as experiment "quick"."""


def settings_of(experiment: str) -> list[Setting]:
    """KeyError for an unknown name."""
    return QUICK if experiment == "quick" else EXPERIMENTS[experiment]
