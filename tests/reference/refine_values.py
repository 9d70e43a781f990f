"""The refinement part of values.json; see make_values.py for the schema and the command."""

from __future__ import annotations

from typing import Any

import groundpose_reference as ref
import numpy as np
from make_values import pose_dict, view_dict

THRESHOLD = 4.0
TAUS = (4.0, 6.0, 12.0)


def result(problem: ref.Problem, state: ref.State, c: float | None, parameters: int) -> dict[str, Any]:
    r = problem.residuals(state)
    sigma = float(np.sqrt(r @ r / (2 * len(r) - parameters))) if c is None else None
    cost = ref.robust_cost(problem, state, c)
    return {"R": state.R, "t": state.t, "shape": state.shape, "cost": cost, "c": c, "noise_sigma": sigma}


def hre_results(
    problem: ref.Problem, start: ref.State, with_shape: bool, parameters: int
) -> dict[str, Any] | None:
    """The three stages; None when the way s is updated, or a residual at tau1, would decide the answer."""
    stages = ref.hre(problem, start, TAUS, with_shape)
    other = ref.hre(problem, start, TAUS, with_shape, update_scale=True)
    if max(np.abs(a.t - b.t).max() for a, b in zip(stages, other, strict=True)) > 1e-9:
        return None
    r = problem.residuals(stages[1])
    if np.abs(r - TAUS[0]).min() < 0.05:
        return None
    c1 = ref.clamped_c(problem, start, TAUS[1], TAUS[2])
    c2 = ref.clamped_c(problem, stages[0], TAUS[0], TAUS[1])
    name = "hre_shape" if with_shape else "hre"
    return {
        f"{name}1": result(problem, stages[0], c1, parameters),
        f"{name}2": result(problem, stages[1], c2, parameters),
        f"{name}3": result(problem.subset(r < TAUS[0]), stages[2], None, parameters),
    }


def refine_case(
    rng: np.random.Generator,
    models: list[tuple[ref.Array, ref.Array, ref.Array]],
    index: int,
    with_shape: bool,
) -> dict[str, Any]:
    mean, basis, _ = models[index]
    modes = len(basis)
    parameters = 6 + (modes if with_shape else 0)
    while True:
        s = ref.random_scene(
            rng, models[index], (-20.0, 5.0), distance=(8.0, 25.0), noise=0.6, outliers=6,
            shape_sigma=float(with_shape),
        )  # fmt: skip
        pixels = s.pixels.copy()
        pixels[rng.permutation(len(mean))[:2]] = np.nan
        problem = ref.Problem.of(s.view.camera, pixels, mean, basis)
        seen = np.isfinite(pixels[:, 0])
        truth = ref.State(s.R, s.t, s.shape)
        if problem.residuals(truth)[~s.inliers[seen]].min(initial=np.inf) < 15.0:
            continue
        R = ref.exp_so3(0.02 * rng.standard_normal(3)) @ s.R
        start = ref.State(R, s.t * (1.0 + 0.01 * rng.standard_normal()), np.zeros(modes))
        stages = hre_results(problem, start, with_shape, parameters)
        if stages is not None:
            break
    inliers = s.inliers[seen]
    gn = ref.gn(problem, start, inliers, with_shape)
    results = {"gn_shape" if with_shape else "gn": result(problem.subset(inliers), gn, None, parameters)}
    results |= stages
    if not with_shape:
        for name, update in (("re_fixed", False), ("re_updated", True)):
            state = ref.re(problem, start, update_scale=update)
            c = ref.clamped_c(problem, state if update else start, 0.0, np.inf)
            results[name] = result(problem, state, c, parameters)
    sigma = results["gn_shape" if with_shape else "gn"]["noise_sigma"]
    return {
        "model": index, "shape_in_data": with_shape, "view": view_dict(s.view), "keypoints_2d": pixels,
        "truth": pose_dict(s.R, s.t), "truth_shape": s.shape, "inlier_truth": s.inliers,
        "start": pose_dict(start.R, start.t), "inlier_threshold": THRESHOLD, "taus": TAUS,
        "msac_start": ref.msac(problem.residuals(start), THRESHOLD),
        "scale_start": ref.mad_scale(problem.residuals(start)), "results": results,
        "covariance": ref.covariance(problem.subset(inliers), gn, sigma, with_shape)[:6, :6],
    }  # fmt: skip


def refine_cases(rng: np.random.Generator) -> dict[str, Any]:
    models = [ref.car_model(rng) for _ in range(2)]
    cases = [refine_case(rng, models, k % 2, with_shape) for with_shape in (False, True) for k in range(8)]
    listed = [{"mean": m, "basis": b, "bbox_3d": box} for m, b, box in models]
    return {"models": listed, "refine": cases}
