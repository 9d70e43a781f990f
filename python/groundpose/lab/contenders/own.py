"""Our solver under the names that tables use, and the paper's methods on it: a name is a set of options."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import groundpose as gp
from groundpose.lab.contenders.contender import Answers, nothing
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.timing import Clock

PRIOR_DEG = 1.5
"""The tilt prior of a target of V1 (method: refinement keeps the tilt as a prior), degrees."""


@dataclass(frozen=True)
class Own:
    """One way to use the solver."""

    name: str
    note: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    """Fields of `groundpose.Options`."""
    weighs_scores: bool = True
    paper_thresholds: bool = False
    """Whether HRE's thresholds are those of the paper for the objects, instead of the default's."""
    threads: int = 1
    batch: int | None = None
    """Objects of a call; None: all."""
    slow_with_outliers: bool = False

    def missing(self) -> str | None:
        """It is always there."""
        return None

    def options_for(self, objects: Objects) -> gp.Options:
        """Its options with the thresholds of the objects."""
        thresholds = objects.inlier_threshold
        one_for_all = len(thresholds) > 0 and bool(np.all(thresholds == thresholds[0]))
        given = float(thresholds[0]) if one_for_all else thresholds.tolist()
        paper = {"hre_thresholds": objects.hre_thresholds} if self.paper_thresholds else {}
        return gp.Options(inlier_threshold=given, **{**objects.keypoint_errors, **self.options, **paper})

    def poses(self, objects: Objects, clock: Clock | None = None) -> gp.PoseBatch:
        """One batch call with all the objects; options and models exist before, as a user's do."""
        width = max((len(model.keypoints_3d) for model in objects.models), default=0)
        keypoints = np.ascontiguousarray(objects.keypoints_2d[:, :width])
        scores = objects.keypoint_scores
        if scores is not None:
            scores = np.ascontiguousarray(scores[:, :width])
        arguments = (objects.view, keypoints, objects.bboxes, objects.models, scores)
        options = self.options_for(objects)
        # a frame is estimated from the poses' covariances
        frame = objects.frame if options.covariance else None
        last = (options, self.threads, objects.frame_tilt_sigma, None, None, frame)
        found: gp.PoseBatch = (clock or Clock()).batch(gp.estimate_poses, *arguments, *last)
        return found

    def solve(self, objects: Objects, clock: Clock) -> Answers:
        """See `Contender`. The whole Python batch call is timed."""
        size = self.batch or max(len(objects), 1)
        parts, seconds = [], np.zeros(len(objects))
        for first in range(0, max(len(objects), 1), size):
            part, before = objects[first : first + size], clock.seconds
            parts.append(self.poses(part, clock))
            seconds[first : first + size] = (clock.seconds - before) / max(len(part), 1)
        return _joined(parts, seconds)


def _joined(parts: list[gp.PoseBatch], seconds: np.ndarray) -> Answers:
    R, t = nothing(len(seconds))
    modes = max(part.shape_coefficients.shape[1] for part in parts)
    coefficients, iterations = np.full((len(seconds), modes), np.nan), np.zeros(len(seconds))
    row = 0
    for part in parts:
        rows = slice(row, row := row + len(part))
        R[rows], t[rows], iterations[rows] = part.R, part.t, part.iterations
        coefficients[rows, : part.shape_coefficients.shape[1]] = part.shape_coefficients
    poses = parts[0] if len(parts) == 1 else None
    return Answers(R, t, seconds, iterations, coefficients, poses=poses)


def without_prior(**options: Any) -> dict[str, Any]:
    """Options that forget tilt and box after the search, as the paper does."""
    return {"tilt_sigma": math.inf, "bbox_sigma": math.inf, **options}


def with_tilt_prior(sigma_deg: float, **options: Any) -> dict[str, Any]:
    """Options with a tilt prior of `sigma_deg` degrees and no other: boxes of these scenes are exact, and an
    oracle does not know them."""
    return {"tilt_sigma": math.radians(sigma_deg), "bbox_sigma": math.inf, **options}


DEFAULT = Own("ours, default", "soft priors on tilt and box sides")
NO_PRIOR = Own("ours, no priors", "tilt_sigma inf, bbox_sigma inf", without_prior())
PRIOR = Own("ours, tilt prior 1.5 deg", "tilt_sigma 1.5 deg, bbox_sigma inf", with_tilt_prior(PRIOR_DEG))
TIGHT_PRIOR = Own("ours, tilt prior 0.1 deg", "tilt_sigma 0.1 deg, bbox_sigma inf", with_tilt_prior(0.1))
UP2P = Own("ours, UP2P search", "solver up2p", {"solver": "up2p"})
P3P = Own("ours, P3P search", "solver p3p", {"solver": "p3p"})
_NEVER = {"max_log10_nfa": math.inf, "min_probability": 0.0}
NEVER_REFUSES = Own("ours, never refusing", "max_log10_nfa inf, min_probability 0", _NEVER)
UP2P_NEVER_REFUSES = Own(
    "ours, UP2P, never refusing", "the same with solver up2p", {"solver": "up2p", **_NEVER}
)
HRE = Own(
    "P1P search + HRE",
    "all corner pairs, truncated squared error",
    without_prior(solver="p1p", refinement="hre"),
    paper_thresholds=True,
)
"""Our search with the paper's refinement."""


def paper(solver: str, refinement: str = "none") -> Own:
    """RNSC-P1P or RNSC-P3P of the paper, alone or with a refinement, or the same loop with UP2P.

    Four cases, inlier count, tilt and box forgotten after the search, nothing refused, no covariance.
    """
    suffix = "" if refinement == "none" else f"+{refinement.upper()}"
    options = without_prior(
        solver=solver,
        cases="paper",
        scoring="inliers",
        refinement=refinement,
        max_log10_nfa=math.inf,
        covariance=False,
    )
    note = f"paper's search, refinement {refinement}"
    return Own(f"RNSC-{solver.upper()}{suffix}", note, options, weighs_scores=False, paper_thresholds=True)


def refusing(contender: Own) -> Own:
    """The same, but a pose that chance explains is refused, as our default does."""
    options = {k: v for k, v in contender.options.items() if k not in ("max_log10_nfa", "covariance")}
    note = "the paper's four cases, inlier count; refuses chance"
    return replace(contender, name=f"{contender.name}, refusing", note=note, options=options)


def unrefined(solver: str) -> Own:
    """The best hypothesis of a search as it is: what the minimal solver alone is worth."""
    return Own(f"{solver.upper()} search, unrefined", "", without_prior(solver=solver, refinement="none"))
