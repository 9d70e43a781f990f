"""Our own solver under the names that tables use: a name is a set of options, kept here only."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import groundpose as gp
from groundpose.lab.evaluate.scenes import Array, Scenes
from groundpose.lab.metrics import Summary, rotation_error_deg, summarise, translation_error_percent

PRIOR_DEG = 1.5
"""The tilt prior of the V1 bar (method: refinement keeps the tilt as a prior), degrees."""


@dataclass(frozen=True)
class Method:
    """One way to use the solver. `options` are fields of `groundpose.Options`."""

    name: str
    note: str
    options: dict[str, Any] = field(default_factory=dict)

    def __call__(self, scenes: Scenes, threads: int = 1) -> tuple[Array, Array]:
        """R (T, 3, 3) and t (T, 3), NaN where there is no answer."""
        poses = self.estimate(scenes, threads)
        return poses.R, poses.t

    def options_for(self, scenes: Scenes) -> gp.Options:
        """Its options with the thresholds of the scenes."""
        thresholds = scenes.inlier_threshold
        one_for_all = bool(np.all(thresholds == thresholds[0]))
        given = float(thresholds[0]) if one_for_all else thresholds.tolist()
        return gp.Options(inlier_threshold=given, **self.options)

    def estimate(self, scenes: Scenes, threads: int = 1, options: gp.Options | None = None) -> gp.PoseBatch:
        """The whole answer; `options` may be made before with `options_for`."""
        options = self.options_for(scenes) if options is None else options
        return gp.estimate_poses(
            scenes.view, scenes.keypoints_2d, scenes.bboxes, scenes.models, None, options, threads
        )


def without_prior(**options: Any) -> dict[str, Any]:
    """Options that forget tilt and box after the search, as the paper does."""
    return {"tilt_sigma": math.inf, "bbox_sigma": math.inf, **options}


def with_tilt_prior(sigma_deg: float, **options: Any) -> dict[str, Any]:
    """Options with a tilt prior of `sigma_deg` degrees and no other: boxes of these scenes are exact, and an
    oracle does not know them."""
    return {"tilt_sigma": math.radians(sigma_deg), "bbox_sigma": math.inf, **options}


# thresholds of the hierarchical refinement as multiples of the inlier threshold: 4, 6, 12 px in E1 to E4;
# 0.0375, 0.05, 0.15 of the longer box side for vehicles (paper, sec. 4.2.2)
HRE_CUBE = (1.0, 1.5, 3.0)
HRE_VEHICLE = (1.0, 4.0 / 3.0, 4.0)

DEFAULT = Method("ours, default", "soft priors on tilt and box sides")
NO_PRIOR = Method("ours, no priors", "tilt_sigma inf, bbox_sigma inf", without_prior())
PRIOR = Method("ours, tilt prior 1.5 deg", "tilt_sigma 1.5 deg, bbox_sigma inf", with_tilt_prior(PRIOR_DEG))
TIGHT_PRIOR = Method("ours, tilt prior 0.1 deg", "tilt_sigma 0.1 deg, bbox_sigma inf", with_tilt_prior(0.1))
UP2P = Method("ours, UP2P search", "solver up2p", {"solver": "up2p"})
P3P = Method("ours, P3P search", "solver p3p", {"solver": "p3p"})


def paper(solver: str, hre_thresholds: tuple[float, float, float]) -> Method:
    """RNSC-P1P+HRE or RNSC-P3P+HRE as in the paper: inlier count, its four cases, tilt forgotten."""
    options = without_prior(
        solver=solver, cases="paper", scoring="inliers", refinement="hre", hre_thresholds=hre_thresholds
    )
    return Method(f"RNSC-{solver.upper()}+HRE", "the paper's four cases, inlier count", options)


def paper_search(solver: str, refinement: str, hre_thresholds: tuple[float, float, float]) -> dict[str, Any]:
    """Options of RNSC-P1P or RNSC-P3P with a refinement of the paper: four cases, inlier count, tilt and box
    forgotten after the search, nothing refused, no covariance."""
    return without_prior(
        solver=solver,
        cases="paper",
        scoring="inliers",
        refinement=refinement,
        hre_thresholds=hre_thresholds,
        max_log10_nfa=math.inf,
        covariance=False,
    )


def hre(hre_thresholds: tuple[float, float, float]) -> Method:
    """Our search (all corner pairs, truncated squared error) with the paper's refinement."""
    options = without_prior(solver="p1p", refinement="hre", hre_thresholds=hre_thresholds)
    return Method("P1P search + HRE", "all corner pairs, truncated squared error", options)


def unrefined(solver: str) -> Method:
    """The best hypothesis of a search as it is: what the minimal solver alone is worth."""
    return Method(f"{solver.upper()} search, unrefined", "", without_prior(solver=solver, refinement="none"))


def errors(scenes: Scenes, R: Array, t: Array) -> Summary:
    """Errors of one answer a trial against the truth of the scenes."""
    return summarise(rotation_error_deg(scenes.R, R), translation_error_percent(scenes.t, t))
