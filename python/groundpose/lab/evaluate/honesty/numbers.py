"""The numbers of one network's answers, by source."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from groundpose.keypoints.certainty import Certainty
from groundpose.lab.evaluate.honesty.answers import Answers, Mask
from groundpose.lab.evaluate.honesty.coverage import WINDOWS, inside, sharpness
from groundpose.lab.evaluate.honesty.label_errors import allowed
from groundpose.lab.evaluate.honesty.probability import AMBIGUITY_EDGES, probability, reliability

FLIP_DEG = 90.0
FEWEST = 10
"""Answers from which a group's numbers are stated."""


def vehicles(answers: Answers, certainty: Certainty, is_vehicle: Mask, real: bool) -> dict[str, Any]:
    """Numbers of a source of vehicles.

    Args:
        is_vehicle: (N,) what the network takes for a vehicle.
        real: whether the truth has errors of its own, as KITTI's labels.
    """
    answers, is_vehicle = answers.only(answers.vehicles), is_vehicle[answers.vehicles]
    p = probability(_known(certainty), answers)
    called = answers.ok & is_vehicle & (p >= (certainty.min_probability or 0.0))
    flipped = answers.yaw_error > FLIP_DEG
    found: dict[str, Any] = {
        "vehicles": len(answers),
        "main": int(answers.main.sum()),
        "right": _percent(answers.right[answers.main]),
        "right_yaw_only": _percent(answers.yaw_error[answers.main] <= 15.0),
        "kept": _percent(called[answers.main & answers.right]),
        "kept_all": _percent(called[answers.right]),
        "right_of_called": _percent(answers.right[called]),
        "probability": reliability(p[answers.ok], answers.right[answers.ok]),
        "ambiguity": reliability(answers.ambiguity[answers.ok], flipped[answers.ok], AMBIGUITY_EDGES)
        | {"flips": int(flipped.sum())},
        "coverage": {},
    }
    groups = {"main": answers.right & answers.main, "more hidden, cut or small": answers.right & ~answers.main}
    for name, rows in groups.items():
        if rows.sum() >= FEWEST:
            found["coverage"][name] = covered(answers.only(rows), certainty)
    if real:
        found["coverage"]["main, labels' errors allowed"] = covered(
            allowed(answers).only(groups["main"]), certainty
        )
    found["coverage"]["main, independent errors"] = covered(answers.only(groups["main"]), Certainty(1.0, np.inf))
    return found


def covered(answers: Answers, certainty: Certainty) -> dict[str, Any]:
    """Percentages inside the regions, the least and the most of each level of `WINDOWS`, and the sharpness."""
    found = inside(answers, certainty.error_factor, certainty.error_dof)
    levels = [f"{100 * level:g}" for level in WINDOWS]
    return {
        "answers": len(answers),
        "inside": found,
        "least": {level: min(by[level] for by in found.values()) for level in levels},
        # the distance may hold more: its error is mostly the size of the vehicle
        "most": {level: max(by[level] for q, by in found.items() if q != "distance") for level in levels},
        "sharpness": sharpness(answers, certainty.error_factor),
    }


def background(answers: Answers, certainty: Certainty, is_vehicle: Mask) -> dict[str, Any]:
    """Percentage called right of places without a vehicle, in all and by what is there."""
    p = probability(_known(certainty), answers)
    called = answers.ok & is_vehicle & (p >= (certainty.min_probability or 0.0))
    kinds = {str(kind): answers.seen["kind"] == kind for kind in np.unique(answers.seen["kind"])}
    numbers: Callable[[Mask], dict[str, Any]] = lambda rows: {  # noqa: E731
        "boxes": int(rows.sum()),
        "solved": _percent(answers.ok[rows]),
        "called_vehicle": _percent((answers.ok & is_vehicle)[rows]),
        "called_right": _percent(called[rows]),
    }
    return numbers(np.ones(len(answers), dtype=bool)) | {"kinds": {k: numbers(rows) for k, rows in kinds.items()}}


def _known(certainty: Certainty) -> tuple[float, ...]:
    assert certainty.probability_coefficients is not None
    return certainty.probability_coefficients


def _percent(values: Mask) -> float | None:
    return float(100.0 * values.mean()) if len(values) else None
