"""Where the time goes: stages from differences of rows, beside what they cost on paper."""

from __future__ import annotations

import math
from typing import Any

Row = dict[str, Any]
MODES = {"vehicle": 0, "vehicle M = 5": 5, "vehicle M = 10": 10, "cube 50 %": 0}
"""Settings of benches/instructions.rs whose stages are shown, and their shape modes."""

# Floating-point operations on paper: +, -, *, / and square roots count one each.

CORNERS = 4
RESIDUAL_FLOPS = 30
"""Score of one point under one hypothesis: three rows of a projection (18), reciprocal (1), pixel and
difference (4), square (3), truncation, scale, weight and sum (4)."""
SIMPLE_STEP_FLOPS = 141
"""One point in the normal equations of a pose: projection (18), reciprocal and gradients (7), residual,
Tukey's weight, cost (16), two rows of the Jacobian (10), weighed (10), gradient (20), 20 products (60)."""


def p1p_flops() -> int:
    """One keypoint: its ray, two planes with all corners (6 each, 8 a plane), every ordered pair of corners
    with two roots: elimination (14), roots (12), distances (12), feasible (two planes, 3 a corner, 3)."""
    pairs = CORNERS * (CORNERS - 1)
    return 15 + 2 * (8 + 6 * CORNERS) + pairs * (14 + 12 + 12 + 2 * 2 * (3 * CORNERS + 3))


def step_flops(modes: int) -> int:
    """One point in one step: with modes, two rows of `6 + modes` numbers, of which 5 each are the basis's."""
    if modes == 0:
        return SIMPLE_STEP_FLOPS
    size = 6 + modes
    return 60 + 2 * (5 * modes + 2 * size + size * (size + 1))


def solve_flops(modes: int) -> float:
    """Cholesky and two substitutions."""
    size = 6 + modes
    return size**3 / 3 + 2 * size**2


SCORED_BYTES, STEP_BYTES = 48, 48
"""What one point is read of, from the nearest cache: pixel, model point, weight, eight bytes each."""


_WORKS = (
    "p1p of every keypoint",
    "one draw",
    "search",
    "search + gn",
    "search + re",
    "search + hre",
    "search + default",
    "search + default + covariance",
)
_REFINEMENTS = {
    "refinement GN": "search + gn",
    "refinement RE": "search + re",
    "refinement HRE": "search + hre",
    "refinement default (with a second search where needed)": "search + default",
}


_P1P, _SCORES, _COVARIANCE = "P1P of the draws", "scores", "covariance"


def of(rows: list[Row], setting: str) -> list[Row]:
    """Stages of one setting, per object: microseconds, instructions, operations on paper.

    Nothing where a row is missing.
    """
    by_work = {row["work"]: row for row in rows if row["setting"] == setting and row["work"] in _WORKS}
    if set(by_work) != set(_WORKS):
        return []
    times = _split(by_work, {name: row["us per object"] for name, row in by_work.items()})
    counts = _split(by_work, {name: row["instructions"] / row["objects"] for name, row in by_work.items()})
    operations = _operations(by_work, MODES[setting])
    intensity = {name: step_flops(MODES[setting]) / STEP_BYTES for name in (*_REFINEMENTS, _COVARIANCE)}
    intensity[_SCORES] = RESIDUAL_FLOPS / SCORED_BYTES
    return [
        {
            "stage": name,
            "us": times[name],
            "instructions": counts[name],
            "operations": operations.get(name),
            "operations a byte": intensity.get(name),
        }
        for name in times
    ]


def _each(row: Row, what: str) -> float:
    """Of one object."""
    return float(row[what] / row["objects"])


def _split(by_work: dict[str, Row], value: dict[str, float]) -> dict[str, float]:
    """A quantity of every row as one of every stage: a row holds the stages before it too.

    A hypothesis' score is what further draws cost beyond their P1P.
    """
    one, search = by_work["one draw"], by_work["search"]
    draws, hypotheses = _each(search, "draws"), _each(search, "hypotheses")
    p1p = value["p1p of every keypoint"] / _each(search, "keypoints")
    further = value["search"] - value["one draw"] - (draws - _each(one, "draws")) * p1p
    score = further / (hypotheses - _each(one, "hypotheses"))
    stages = {_P1P: draws * p1p, _SCORES: hypotheses * score}
    stages["set-up, test against chance, statistics"] = value["search"] - sum(stages.values())
    stages |= {name: value[work] - value["search"] for name, work in _REFINEMENTS.items()}
    return stages | {_COVARIANCE: value["search + default + covariance"] - value["search + default"]}


def _operations(by_work: dict[str, Row], modes: int) -> dict[str, float]:
    """On paper."""
    search = by_work["search"]
    points, solve = _each(search, "keypoints"), solve_flops(modes)
    # a step linearises, solves, and looks at the cost of where it leads
    step = points * (step_flops(modes) + RESIDUAL_FLOPS) + solve
    return {
        _P1P: _each(search, "draws") * p1p_flops(),
        _SCORES: _each(search, "hypotheses") * points * RESIDUAL_FLOPS,
        **{name: _each(by_work[work], "steps") * step for name, work in _REFINEMENTS.items()},
        _COVARIANCE: points * step_flops(modes) + solve,
    }


def whole(rows: list[Row], setting: str, work: str) -> Row | None:
    """One row, per object."""
    for row in rows:
        if (row["setting"], row["work"]) == (setting, work):
            each = {key: row[key] / row["objects"] for key in ("instructions", "keypoints", "allocations")}
            return each | {"us": row["us per object"]}
    return None


# An automotive Arm core, estimated: Cortex-A78AE.
ARM_GHZ = 2.0
ARM_IPC = (1.5, 3.0)
"""Instructions a cycle that floating-point code reaches on an out-of-order core of four-wide decode."""
ARM_WIDER = (1.0, 2.0)
"""Its vectors hold two numbers where AVX2 holds four: from no instruction doubled to all of them."""


def arm_us(instructions: float) -> tuple[float, float, float]:
    """Least, most and (geometric) middle microseconds on that core."""
    low = 1e-3 * instructions * ARM_WIDER[0] / (ARM_IPC[1] * ARM_GHZ)
    high = 1e-3 * instructions * ARM_WIDER[1] / (ARM_IPC[0] * ARM_GHZ)
    return low, high, math.sqrt(low * high)
