"""The values of a stored run that have a target."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from groundpose.lab.bench.cases import BATCHES, KEYPOINTS, PERCENTS, TWO_THREADS
from groundpose.lab.contenders.registry import TO_BEAT
from groundpose.lab.targets import TARGETS, Check

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


def _overhead(of: str) -> Callable[[Cases], float]:
    return lambda cases: float(cases["overhead"][f"us per {of}"]["median"])


def _two_threads(objects: int) -> Callable[[Cases], float]:
    return lambda cases: 1.0 / _times_ours(f"batch/{objects}", TWO_THREADS)(cases)


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


LARGE = tuple(n for n in KEYPOINTS if n >= 66)
VALUES: dict[str, Callable[[Cases], float]] = {
    "v1 time": _times_ours("vehicles"),
    "v1 e_r": _ours("vehicles", "mean e_r deg"),
    "v1 failures": _ours("vehicles", "failures %"),
    "e1 50 time": _times_ours("outliers/50"),
    "e1 90 time": _times_ours("outliers/90"),
    "shape ratio": lambda cases: 1.0 / _times_ours("hre/5")(cases),
    "shape time": _ours("hre/5", "us"),
    "shape default": _ours("shape/5", "us"),
    "overhead call": _overhead("call"),
    "overhead estimator": _overhead("call of an estimator"),
    "overhead object": _overhead("object"),
    "threads": _two_threads(10_000),
    "threads of a call": _two_threads(1_000),
    "allocations": _allocations,
    "native": _native,
    "growth keypoints": lambda cases: growth(cases, "keypoints", LARGE),
    "growth objects": lambda cases: 1.0 + growth(cases, "batch", BATCHES[2:]),
    "growth outliers": _flat,
}
"""How a number is read from a run, by its target; `groundpose evaluate targets` measures the others."""


def check(cases: Cases, target: str) -> Check:
    """Against a run; what was not measured has no value."""
    try:
        value = VALUES[target](cases)
    except KeyError:
        value = NO_VALUE
    return TARGETS[target].check(value)


def table(cases: Cases) -> list[dict[str, Any]]:
    """Lines of a table: value, target, whether it is met."""
    lines = []
    for found in (check(cases, name) for name in VALUES):
        value = f"{found.value:.4g}{found.target.unit}" if found.known else "not measured"
        lines.append(
            {
                "measure": found.target.measure,
                "what": found.what,
                "value": value,
                "target": found.target.text(),
                "met": found.met if found.known else None,
            }
        )
    return lines
