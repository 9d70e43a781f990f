"""What the numbers must show, from a stored run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from groundpose.lab.bench.cases import BATCHES, KEYPOINTS, PERCENTS, TWO_THREADS
from groundpose.lab.bench.contenders import TO_BEAT
from groundpose.lab.evaluate.rows import Check

Cases = dict[str, Any]
NO_VALUE = float("nan")


def line(cases: Cases, case: str, method: str | None = None) -> dict[str, Any]:
    """A contender's line of a race; None: ours. KeyError when it was not measured."""
    lines = cases[case]["lines"]
    found: dict[str, Any] = (
        lines[0] if method is None else next((m for m in lines if m["method"] == method), {})
    )
    if not found:
        raise KeyError(method)
    return found


def _times_ours(case: str, method: str = TO_BEAT) -> Callable[[Cases], float]:
    return lambda cases: float(line(cases, case, method)["times ours"])


def _ours(case: str, key: str) -> Callable[[Cases], float]:
    return lambda cases: float(line(cases, case)[key])


def _us(cases: Cases, case: str) -> float:
    return float(line(cases, case)["us"])


def growth(cases: Cases, group: str, values: tuple[int, ...]) -> float:
    """Exponent of the growth of a call's time between two values: 1 is linear."""
    first, last = values[0], values[-1]
    ratio = _us(cases, f"{group}/{last}") / _us(cases, f"{group}/{first}")
    return math.log(ratio) / math.log(last / first)


def _flat(cases: Cases) -> float:
    times = [_us(cases, f"outliers/{percent}") for percent in PERCENTS if percent <= 70]
    return max(times) / min(times)


def _allocations(cases: Cases) -> float:
    return float(max(row["allocations"] / row["objects"] for row in cases["instructions"]["rows"]))


def _native(cases: Cases) -> float:
    return float(max(s["ratio"] for s in cases["native"]["settings"].values()))


@dataclass(frozen=True)
class Bar:
    """One line of the table of bars."""

    measure: str
    what: str
    value: Callable[[Cases], float]
    limit: float
    sense: str = "at most"
    unit: str = ""
    aim: str = ""

    def check(self, cases: Cases) -> Check:
        """Against a run; what was not measured has no value."""
        try:
            value = self.value(cases)
        except KeyError:
            value = NO_VALUE
        return Check(self.what, value, self.limit, self.sense, self.unit)


_V1 = "V1 vehicles, Python batch call, one thread, default"
_E1 = "E1, 300 keypoints"
_SHAPE = "28 keypoints with shape, M = 5, HRE as the paper's timing"
_OVERHEAD = "Python's part of a batch call"
_GROWTH = "growth of the cost"
LARGE = tuple(n for n in KEYPOINTS if n >= 66)
BARS = (
    Bar(_V1, f"{TO_BEAT} / ours", _times_ours("vehicles"), 5.0, "at least", " x", "8 x"),
    Bar(_V1, "mean e_r", _ours("vehicles", "mean e_r deg"), 2.2, unit=" deg"),
    Bar(_V1, "failures", _ours("vehicles", "failures %"), 1.2, unit=" %"),
    Bar(_E1, f"50 % outliers, {TO_BEAT} / ours", _times_ours("outliers/50"), 5.0, "at least", " x"),
    Bar(_E1, f"90 % outliers, {TO_BEAT} / ours", _times_ours("outliers/90"), 100.0, "at least", " x"),
    Bar(
        _SHAPE,
        f"ours / {TO_BEAT} with the true rigid shape",
        lambda cases: 1.0 / _times_ours("hre/5")(cases),
        0.6,
        unit=" x",
    ),
    Bar(_SHAPE, "an object", _ours("hre/5", "us"), 150.0, unit=" us", aim="20 us (150 us is the paper's)"),
    Bar(_OVERHEAD, "a call", lambda c: float(c["overhead"]["us a call"]["median"]), 20.0, unit=" us"),
    Bar(_OVERHEAD, "an object", lambda c: float(c["overhead"]["us an object"]["median"]), 0.3, unit=" us"),
    Bar(
        "two threads",
        "one thread / two, 10,000 objects",
        lambda cases: 1.0 / _times_ours(f"batch/{BATCHES[-1]}", TWO_THREADS)(cases),
        1.9,
        "at least",
        " x",
    ),
    Bar("allocations", "an object, warm, every refinement", _allocations, 0.0),
    Bar(
        "wheel against native build",
        "installed / target-cpu=native, the worse setting",
        _native,
        1.1,
        unit=" x",
    ),
    Bar(
        _GROWTH,
        f"exponent of keypoints, {LARGE[0]} to {LARGE[-1]}",
        lambda c: growth(c, "keypoints", LARGE),
        1.1,
    ),
    Bar(
        _GROWTH,
        "exponent of objects of a call, 100 to 10,000",
        lambda cases: 1.0 + growth(cases, "batch", BATCHES[2:]),
        1.1,
    ),
    Bar(_GROWTH, "longest / shortest, 10 to 70 % outliers", _flat, 2.0, unit=" x"),
)
"""Bars of speed; those of accuracy are in docs/results.md."""


def table(cases: Cases) -> list[dict[str, Any]]:
    """Lines of a table: value, bar, whether it is met."""
    lines = []
    for bar in BARS:
        check = bar.check(cases)
        known = not math.isnan(check.value)
        lines.append(
            {
                "measure": bar.measure,
                "what": bar.what,
                "value": f"{check.value:.4g}{bar.unit}" if known else "not measured",
                "bar": f"{bar.sense} {bar.limit:g}{bar.unit}" + (f"; aim {bar.aim}" if bar.aim else ""),
                "met": check.met if known else None,
            }
        )
    return lines
