"""What the bundled networks have to reach, each number once, and whether the stored results do."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from groundpose.lab.targets import AT_LEAST, PAPER, Check, Target

Path = tuple[str, ...]


@dataclass(frozen=True)
class Wanted:
    """A target, the network it is of ("" for none) and where in its results the number is.

    `factor`: from the stored number to the target's unit.
    """

    target: Target
    network: str
    path: Path
    factor: float = 1.0

    def check(self, found: dict[str, Any]) -> Check:
        """The stored number against the target; NaN when it was not measured."""
        value: Any = found.get("trained", {}).get(self.network) if self.network else found
        for key in self.path:
            value = value.get(key) if isinstance(value, dict) else None
        return self.target.check(math.nan if value is None else self.factor * value)


_DRIVE = "held-out drive, all vehicles"
_STREETS = "real streets, development cars, one look each"
_LOOKS = "real streets, development cars, 12 looks each"
_YAW = (
    ("yaw above 15 deg", 4.0, " %", "all: yaw above 15 deg %"),
    ("yaw above 30 deg", 1.0, " %", "all: yaw above 30 deg %"),
)
_ERRORS = (
    ("mean e_r", 3.2, " deg", "all: mean e_r deg"),
    ("median e_r", 2.3, " deg", "all: median e_r deg"),
    ("easy median e_r", 1.3, " deg", "easy: median e_r deg"),
)
_SMALL = "small vehicles, square-on"
_NOTHING = "vehicle or nothing"
_ROAD = "road-side cameras, 20 to 35 degrees down"
_LEVEL, _LEVEL_BEFORE = "1.5 m, level", 0.85
# the second, rounded up: what a network reached that knew the drive's own camera only, on these vehicles
_SWEEPS = "sweeps: worst point / that of the drive's camera"
_TIMES = "cost"
_GPU = "a GPU"


def _road_side() -> list[Wanted]:
    rows = []
    for place, limit in (("3 m", 1.0), ("6 m", 1.3), ("8 m", 1.5), (_LEVEL, _LEVEL_BEFORE)):
        error = Target(f"road {place}", _ROAD, f"camera at {place}: median e_r", limit, unit=" deg")
        rows.append(Wanted(error, "default", ("road_side", place, "median_e_r_deg")))
        if place != _LEVEL:
            named = Target(f"road class {place}", _ROAD, f"camera at {place}: class", 98.0, AT_LEAST, " %")
            rows.append(Wanted(named, "default", ("road_side", place, "class_accuracy"), 100))
    return rows


WANTED = (
    Wanted(
        Target("visible", _DRIVE, "visible keypoints within 0.0375 l", 95.5, AT_LEAST, " %"),
        "default",
        ("held_out", "all", "within_visible"),
        100,
    ),
    Wanted(
        Target("class", _DRIVE, "class", 99.2, AT_LEAST, " %"),
        "default",
        ("held_out", "all", "class_accuracy"),
        100,
    ),
    Wanted(
        Target("vertex", _DRIVE, "vertex error", 8.0, unit=" px"), "default", ("held_out", "all", "error_px")
    ),
    Wanted(
        Target("vertex res10", _DRIVE, "vertex error", 10.05, unit=" px", source=PAPER),
        "res10-128x96",
        ("held_out", "all", "error_px"),
    ),
    *(
        Wanted(Target(f"looks {key}", _LOOKS, what, limit, unit=unit), "default", ("looks", key))
        for what, limit, unit, key in (*_YAW, *_ERRORS)
    ),
    *(
        Wanted(Target(f"streets {key}", _STREETS, what, limit, unit=unit), "default", ("streets", key))
        for what, limit, unit, key in _ERRORS
    ),
    Wanted(
        Target("turned", _SMALL, "turned round, and the viewing angle says so", 80.0, AT_LEAST, " %"),
        "default",
        ("square_on", "turned_told"),
        100,
    ),
    Wanted(
        Target("nothing", _NOTHING, "boxes of nothing called a vehicle", 1.0, unit=" %"),
        "default",
        ("nothing", "nothing", "all", "called_vehicle"),
        100,
    ),
    Wanted(
        Target("none", _NOTHING, "vehicles called none", 1.0, unit=" %"),
        "default",
        ("nothing", "vehicles", "called_none"),
        100,
    ),
    *_road_side(),
    *(
        Wanted(
            Target(f"sweep {name}", _SWEEPS, f"{name}, median e_r", 2.0, unit=" x"),
            "default",
            ("sweeps", f"worst {name}"),
        )
        for name in ("focal length", "roll")
    ),
    Wanted(
        Target("crop ms", _TIMES, "one crop on one core", 2.0, unit=" ms"),
        "default",
        ("crop_ms", "network alone, 1 thread"),
    ),
    Wanted(
        Target("crop ms int8", _TIMES, "one crop on one core", 0.8, unit=" ms"),
        "int8",
        ("crop_ms", "network alone, 1 thread"),
    ),
    Wanted(Target("wheel", _TIMES, "wheel", 10.0, unit=" MB"), "", ("wheel_mb",)),
    Wanted(
        Target("gpu rendered", _GPU, "crops rendered per second", 350.0, AT_LEAST),
        "",
        ("gpu", "rendered_per_second"),
    ),
    Wanted(
        Target("gpu trained", _GPU, "crops trained per second, lite48", 20_000.0, AT_LEAST),
        "",
        ("gpu", "trained_per_second"),
    ),
)


def target_table(found: dict[str, Any], rows: tuple[Wanted, ...] = WANTED) -> list[dict[str, Any]]:
    """Lines of the page's first table."""
    lines = []
    for wanted in rows:
        check = wanted.check(found)
        measured = f"{check.value:.3g}{wanted.target.unit}" if check.known else "not measured"
        lines.append({
            "measure": wanted.target.measure,
            "number": wanted.target.what,
            "network": wanted.network or None,
            "measured": measured,
            "target": wanted.target.text(),
            "met": check.met if check.known else None,
        })  # fmt: skip
    return lines
