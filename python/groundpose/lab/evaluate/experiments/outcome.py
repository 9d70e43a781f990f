"""What one method did in one setting, and the numbers stored of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from groundpose.lab.evaluate.scenes import Array, Scenes
from groundpose.lab.metrics import (
    NO_ANSWER_E_R_DEG,
    NO_ANSWER_E_T_PERCENT,
    rotation_error_deg,
    summarise,
    translation_error_percent,
)

Mask = npt.NDArray[np.bool_]
CHUNK = 50
"""Objects whose times are averaged before the median is taken."""


@dataclass(frozen=True)
class Outcome:
    """One row a trial; R and t are NaN where there is no answer."""

    R: Array
    t: Array
    seconds: Array
    """(T,) a trial; the same number for all objects of one batch call. NaN: not timed."""
    iterations: Array | None = None
    """(T,) samples a RANSAC drew; None when there is none or it does not tell."""

    def numbers(self, scenes: Scenes) -> dict[str, Any]:
        """What is stored: deterministic for a seed."""
        e_r, e_t = rotation_error_deg(scenes.R, self.R), translation_error_percent(scenes.t, self.t)
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
            "mean_inliers": float(inlier_mask(scenes, self.R, self.t).sum(axis=1).mean()),
            "mean_iterations": None if self.iterations is None else float(np.mean(self.iterations)),
        }

    def microseconds(self) -> float:
        """Median over chunks of the mean time an object: what interrupts a machine hits few chunks."""
        chunks = max(len(self.seconds) // CHUNK, 1)
        return 1e6 * float(np.median([np.mean(part) for part in np.array_split(self.seconds, chunks)]))


def inlier_mask(scenes: Scenes, R: Array, t: Array) -> Mask:
    """(T, P) keypoints within the threshold of the pose given: counted alike for every method."""
    Y = scenes.keypoints_3d @ np.swapaxes(R, 1, 2) + t[:, None, :]
    u, v = np.moveaxis(scenes.camera.project(Y) - scenes.keypoints_2d, -1, 0)
    return np.asarray(np.hypot(u, v) <= scenes.inlier_threshold[:, None])


def missing(trials: int) -> tuple[Array, Array]:
    """R and t of nothing."""
    return np.full((trials, 3, 3), np.nan), np.full((trials, 3), np.nan)
