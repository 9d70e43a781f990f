"""The numbers of one network's answers, by source."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from groundpose.keypoints.certainty import Certainty
from groundpose.lab.evaluate.honesty.answers import Answers, Mask
from groundpose.lab.evaluate.honesty.coverage import covered
from groundpose.lab.evaluate.honesty.label_errors import allowed
from groundpose.lab.evaluate.honesty.probability import AMBIGUITY_EDGES, probability, reliability

MAIN, ALLOWED = "main", "main, labels' errors allowed"
"""Groups of right answers whose coverage is stated."""
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
    called = _called(answers, certainty, is_vehicle)
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
    main, others = answers.right & answers.main, answers.right & ~answers.main
    cases = {
        MAIN: (answers.only(main), certainty),
        "more hidden, cut or small": (answers.only(others), certainty),
        "main, if keypoint errors were independent": (answers.only(main), Certainty(1.0, math.inf)),
    }
    if real:
        cases[ALLOWED] = (allowed(answers).only(main), certainty)
    for name, (some, numbers) in cases.items():
        if len(some) >= FEWEST:
            found["coverage"][name] = covered(some.stated(numbers.error_factor), numbers.error_dof)
    return found


def background(answers: Answers, certainty: Certainty, is_vehicle: Mask) -> dict[str, Any]:
    """Percentage called right of places without a vehicle, in all and by what is there."""
    called = _called(answers, certainty, is_vehicle)

    def rates(rows: Mask) -> dict[str, Any]:
        return {
            "boxes": int(rows.sum()),
            "solved": _percent(answers.ok[rows]),
            "called_vehicle": _percent((answers.ok & is_vehicle)[rows]),
            "called_right": _percent(called[rows]),
        }

    kinds = np.unique(answers.seen["kind"])
    by_kind = {str(kind): rates(answers.seen["kind"] == kind) for kind in kinds}
    return rates(np.ones(len(answers), dtype=bool)) | {"kinds": by_kind}


def _called(answers: Answers, certainty: Certainty, is_vehicle: Mask) -> Mask:
    """(N,): what gets the status "ok"."""
    p = probability(_known(certainty), answers)
    return np.asarray(answers.ok & is_vehicle & (p >= (certainty.min_probability or 0.0)))


def _known(certainty: Certainty) -> tuple[float, ...]:
    assert certainty.probability_coefficients is not None
    return certainty.probability_coefficients


def _percent(values: Mask) -> float | None:
    return float(100.0 * values.mean()) if len(values) else None
