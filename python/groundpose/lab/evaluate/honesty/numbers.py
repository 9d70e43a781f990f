"""The numbers of one network's answers, by source."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from groundpose.keypoints.certainty import Certainty
from groundpose.lab.evaluate.honesty.answers import FLIP_DEG, RIGHT_YAW_DEG, Answers, Mask
from groundpose.lab.evaluate.honesty.coverage import covered
from groundpose.lab.evaluate.honesty.label_errors import allowed
from groundpose.lab.evaluate.honesty.probability import AMBIGUITY_EDGES, probability, reliability
from groundpose.lab.metrics import percentage

CLEAR, ALLOWED = "well visible", "well visible, errors of the labels allowed for"
INDEPENDENT = "well visible, errors taken for independent"
"""Groups of right answers whose coverage is stated."""
FEWEST = 10
"""Answers from which a group's numbers are stated."""


def vehicles(answers: Answers, certainty: Certainty, is_vehicle: Mask, real: bool) -> dict[str, Any]:
    """Numbers of a source of vehicles.

    Args:
        is_vehicle: (N,) what the network takes for a vehicle.
        real: whether the truth has errors of its own, as KITTI's labels.
    """
    answers, is_vehicle = answers.only(answers.vehicles), is_vehicle[answers.vehicles]
    p = probability(certainty, answers)
    called, clear = _called(answers, certainty, is_vehicle), answers.well_visible
    flipped = answers.yaw_error > FLIP_DEG
    found: dict[str, Any] = {
        "vehicles": len(answers),
        "well_visible": int(clear.sum()),
        "right": percentage(answers.right[clear]),
        "right_yaw_only": percentage(answers.yaw_error[clear] <= RIGHT_YAW_DEG),
        "kept": percentage(called[clear & answers.right]),
        "kept_all": percentage(called[answers.right]),
        "right_of_called": percentage(answers.right[called]),
        "probability": reliability(p[answers.ok], answers.right[answers.ok]),
        "ambiguity": reliability(answers.ambiguity[answers.ok], flipped[answers.ok], AMBIGUITY_EDGES)
        | {"flips": int(flipped.sum()), **_other_reading(answers.only(flipped))},
        "coverage": {},
    }
    easy, others = answers.right & clear, answers.right & ~clear
    cases = {
        CLEAR: (answers.only(easy), certainty),
        "hidden, cut or small": (answers.only(others), certainty),
        INDEPENDENT: (answers.only(easy), Certainty(1.0, math.inf)),
    }
    if real:
        cases[ALLOWED] = (allowed(answers).only(easy), certainty)
    for name, (some, numbers) in cases.items():
        if len(some) >= FEWEST:
            shared = (numbers.error_factor, numbers.error_shift, numbers.error_turn)
            found["coverage"][name] = covered(some.stated(*shared), numbers.error_dof)
    return found


def _other_reading(turned: Answers) -> dict[str, Any]:
    """Of poses turned round: percentage with another reading, and with one whose yaw is right."""
    error = turned.other_yaw_error
    return {"with_other": percentage(~np.isnan(error)), "other_right": percentage(error <= RIGHT_YAW_DEG)}


def background(answers: Answers, certainty: Certainty, is_vehicle: Mask) -> dict[str, Any]:
    """Percentage called right of places without a vehicle, in all and by what is there."""
    called = _called(answers, certainty, is_vehicle)

    def rates(rows: Mask) -> dict[str, Any]:
        return {
            "boxes": int(rows.sum()),
            "solved": percentage(answers.ok[rows]),
            "called_vehicle": percentage((answers.ok & is_vehicle)[rows]),
            "called_right": percentage(called[rows]),
        }

    kinds = np.unique(answers.seen["kind"])
    by_kind = {str(kind): rates(answers.seen["kind"] == kind) for kind in kinds}
    return rates(np.ones(len(answers), dtype=bool)) | {"kinds": by_kind}


def _called(answers: Answers, certainty: Certainty, is_vehicle: Mask) -> Mask:
    """(N,): what gets the status "ok"."""
    p = probability(certainty, answers)
    return np.asarray(answers.ok & is_vehicle & (p >= (certainty.min_probability or 0.0)))
