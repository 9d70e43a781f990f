"""The numbers that are stored of one contender in one setting."""

from __future__ import annotations

from typing import Any

import numpy as np

from groundpose.lab.contenders.contender import Answers, inlier_mask
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.metrics import (
    NO_ANSWER_E_R_DEG,
    NO_ANSWER_E_T_PERCENT,
    rotation_error_deg,
    summarise,
    translation_error_percent,
)


def numbers(scenes: Objects, answers: Answers) -> dict[str, Any]:
    """Deterministic for a seed."""
    e_r, e_t = rotation_error_deg(scenes.R, answers.R), translation_error_percent(scenes.t, answers.t)
    s = summarise(e_r, e_t)
    root = np.sqrt(s.trials)
    return {
        "trials": s.trials,
        "answered": s.answered,
        "mean_e_r_deg": s.mean_e_r_deg,
        "median_e_r_deg": s.median_e_r_deg,
        "error_of_mean_e_r_deg": float(np.nan_to_num(e_r, nan=NO_ANSWER_E_R_DEG).std() / root),
        "mean_e_t_percent": s.mean_e_t_percent,
        "median_e_t_percent": s.median_e_t_percent,
        "error_of_mean_e_t_percent": float(np.nan_to_num(e_t, nan=NO_ANSWER_E_T_PERCENT).std() / root),
        "failures": s.failures,
        "mean_inliers": float(inlier_mask(scenes, answers.R, answers.t).sum(axis=1).mean()),
        "mean_iterations": None if answers.iterations is None else float(np.mean(answers.iterations)),
    }
