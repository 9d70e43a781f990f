"""Refinement, statistics and covariance of the core against the independent NumPy implementation."""

from __future__ import annotations

import sys
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))

import bridge
import groundpose_reference as ref

REFINEMENTS = ("gn", "re", "hre", "default")
THRESHOLD = 4.0
MULTIPLES = (1.0, 1.5, 3.0)  # hre_thresholds: 4, 6, 12 px as in the paper
PLAIN = {"shape_prior": False, "tilt_sigma": float("inf"), "hre_thresholds": MULTIPLES}
Model = tuple[ref.Array, ref.Array, ref.Array]


def rng(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


def rigid(model: Model) -> Model:
    return model[0], model[1][:0], model[2]


def scenes(seed: int, count: int, with_shape: bool, **kind: Any) -> list[tuple[ref.Scene, ref.Array]]:
    """Scenes and their bases; outliers are far from the true projection: what an inlier is, is then clear."""
    draw = rng(seed)
    out: list[tuple[ref.Scene, ref.Array]] = []
    while len(out) < count:
        model = ref.car_model(draw)
        model = model if with_shape else rigid(model)
        s = ref.random_scene(draw, model, (-30.0, 5.0), distance=(8.0, 25.0), **kind)
        problem = ref.Problem.of(s.view.camera, s.pixels, s.keypoints_3d, model[1])
        r = problem.residuals(ref.State(s.R, s.t, s.shape))
        if r[~s.inliers].min(initial=np.inf) > 25.0:
            out.append((s, model[1]))
    return out


def state_of(one: dict[str, Any], modes: int) -> ref.State:
    return ref.State(one["R"], one["t"], one["shape_coefficients"][:modes])


def assert_near(one: dict[str, Any], state: ref.State, tolerance: float) -> None:
    assert one["status"] == "ok"
    assert ref.rotation_angle(one["R"], state.R) < tolerance
    assert np.linalg.norm(one["t"] - state.t) < tolerance * np.linalg.norm(state.t)
    np.testing.assert_allclose(
        one["shape_coefficients"][: len(state.shape)], state.shape, atol=100 * tolerance
    )


@pytest.mark.parametrize("refinement", REFINEMENTS)
@pytest.mark.parametrize("outliers", [0, 10])
def test_exact_data_give_the_truth(refinement: str, outliers: int) -> None:
    for s, basis in scenes(41, 60, False, outliers=outliers):
        one = bridge.estimate_scene(s, basis, THRESHOLD, refinement=refinement)
        assert_near(one, ref.State(s.R, s.t, s.shape), 1e-6)
        assert np.all(one["inlier_mask"][s.inliers])


@pytest.mark.parametrize("refinement", ["hre", "default"])
def test_exact_data_with_shape_give_the_truth(refinement: str) -> None:
    for s, basis in scenes(42, 30, True, outliers=6, shape_sigma=0.5):
        one = bridge.estimate_scene(s, basis, THRESHOLD, refinement=refinement, **PLAIN)
        assert_near(one, ref.State(s.R, s.t, s.shape), 1e-5)


def reference_from_start(s: ref.Scene, basis: ref.Array) -> tuple[ref.Problem, ref.State, dict[str, Any]]:
    """The problem, and the core's RANSAC pose before refinement: where all refinements start."""
    start = bridge.estimate_scene(s, basis, THRESHOLD, refinement="none", **PLAIN)
    assert start["status"] == "ok"
    problem = ref.Problem.of(s.view.camera, s.pixels, s.keypoints_3d, basis)
    return problem, ref.State(start["R"], start["t"], np.zeros(len(basis))), start


def test_the_stop_rule_is_the_exact_finite_one() -> None:
    """Without replacement: stop at the first k with P(k outliers only) = C(n - m, k) / C(n, k) <= 1 - p."""
    checked = exact = 0
    for s, basis in scenes(51, 60, False, noise=0.6, outliers=12):
        one = bridge.estimate_scene(
            s, basis, THRESHOLD, refinement="none", scoring="inliers", confidence=0.99
        )
        n, m, k = len(s.pixels), int(one["inlier_count"]), int(one["iterations"])
        if one["stop_reason"] != "confident":
            continue
        checked += 1
        first = next(i for i in range(n + 1) if comb(n - m, i) <= 0.01 * comb(n, i) * (1.0 + 1e-9))
        # later than `first` only when the best pose came in the very last draw
        assert k >= first
        exact += k == first
    assert checked > 30
    assert exact > 0.5 * checked


def test_gn_is_least_squares_on_the_ransac_inliers() -> None:
    for s, basis in scenes(43, 60, False, noise=0.6, outliers=8):
        problem, start, none = reference_from_start(s, basis)
        one = bridge.estimate_scene(s, basis, THRESHOLD, refinement="gn", **PLAIN)
        assert_near(one, ref.gn(problem, start, none["inlier_mask"]), 1e-6)


@pytest.mark.parametrize("with_shape", [False, True])
def test_hre_is_algorithm_1(with_shape: bool) -> None:
    for s, basis in scenes(44, 40, with_shape, noise=0.6, outliers=6, shape_sigma=0.2 * with_shape):
        problem, start, _ = reference_from_start(s, basis)
        one = bridge.estimate_scene(s, basis, THRESHOLD, refinement="hre", **PLAIN)
        taus = (THRESHOLD * MULTIPLES[0], THRESHOLD * MULTIPLES[1], THRESHOLD * MULTIPLES[2])
        assert_near(one, ref.hre(problem, start, taus, with_shape)[2], 1e-6)


def test_re_is_equation_9() -> None:
    """The paper leaves open whether the scale follows the residuals; one way must fit in every scene."""
    apart = {True: 0.0, False: 0.0}
    for s, basis in scenes(45, 15, False, noise=0.6, outliers=8):
        problem, start, _ = reference_from_start(s, basis)
        one = bridge.estimate_scene(s, basis, THRESHOLD, refinement="re", **PLAIN)
        for update in apart:
            state = ref.re(problem, start, update_scale=update)
            apart[update] = max(apart[update], ref.rotation_angle(one["R"], state.R))
    assert min(apart.values()) < 1e-5, apart


@pytest.mark.parametrize("refinement", ["none", *REFINEMENTS])
@pytest.mark.parametrize("with_shape", [False, True])
def test_statistics_belong_to_the_pose_returned(refinement: str, with_shape: bool) -> None:
    for s, basis in scenes(46, 25, with_shape, noise=1.5, outliers=8, shape_sigma=0.3 * with_shape):
        pixels = s.pixels.copy()
        pixels[[3, 11]] = np.nan
        model = bridge.core_model(s.keypoints_3d, s.bbox_3d, basis)
        one = bridge.estimate(s.view, pixels, s.bbox, model, THRESHOLD, refinement=refinement)
        assert one["status"] == "ok"
        seen = np.isfinite(pixels[:, 0])
        problem = ref.Problem.of(s.view.camera, pixels, s.keypoints_3d, basis)
        r = problem.residuals(state_of(one, len(basis)))
        np.testing.assert_allclose(one["residuals"][seen], r, rtol=1e-9, atol=1e-9)
        assert np.all(np.isnan(one["residuals"][~seen]))
        assert not one["inlier_mask"][~seen].any()
        np.testing.assert_array_equal(one["inlier_mask"][seen], r <= THRESHOLD)
        assert one["inlier_count"] == (r <= THRESHOLD).sum()
        inliers = r[r <= THRESHOLD]
        assert one["reprojection_rmse"] == pytest.approx(np.sqrt(np.mean(inliers**2)), rel=1e-9)
        # the mean truncated squared error, in units of the threshold: 0 best, 1 worst
        assert one["score"] == pytest.approx(ref.msac(r, THRESHOLD) / (len(r) * THRESHOLD**2), rel=1e-9)


@pytest.mark.parametrize("with_shape", [False, True])
def test_covariance_is_that_of_least_squares(with_shape: bool) -> None:
    """Without priors: noise_sigma^2 (J^T J)^-1 over the inliers, J by differences."""
    for s, basis in scenes(47, 25, with_shape, noise=0.8, outliers=6, shape_sigma=0.3 * with_shape):
        one = bridge.estimate_scene(s, basis, THRESHOLD, refinement="hre", **PLAIN)
        problem = ref.Problem.of(s.view.camera, s.pixels, s.keypoints_3d, basis).subset(one["inlier_mask"])
        expected = ref.covariance(problem, state_of(one, len(basis)), one["noise_sigma"], with_shape)
        scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        np.testing.assert_allclose(one["covariance"] / scale[:6, :6], (expected / scale)[:6, :6], atol=1e-5)
        shape = one["shape_covariance"][: len(basis), : len(basis)]
        np.testing.assert_allclose(shape / scale[6:, 6:], (expected / scale)[6:, 6:], atol=1e-5)


def test_noise_sigma_lies_between_the_data_and_the_threshold() -> None:
    """Few keypoints say little about the noise: the estimate is drawn towards half the threshold."""
    for s, basis in scenes(50, 40, False, noise=0.8, outliers=6):
        one = bridge.estimate_scene(s, basis, THRESHOLD, refinement="hre", **PLAIN)
        r = one["residuals"][one["inlier_mask"]]
        assert np.sqrt(r @ r / (2 * len(r) - 6)) < one["noise_sigma"] < 0.5 * THRESHOLD


@pytest.mark.parametrize(("noise", "low", "high"), [(0.8, 2.0, 6.5), (1.6, 4.8, 8.0)])
def test_the_covariance_states_the_error(noise: float, low: float, high: float) -> None:
    """Squared Mahalanobis distance to the truth, mean of 200 scenes: about 6, the number of unknowns.

    Less when the noise is far below half the threshold (see above): the statement is then on the safe side.
    """
    distances = []
    for s, basis in scenes(48, 200, False, noise=noise, outliers=4):
        one = bridge.estimate_scene(s, basis, THRESHOLD, refinement="hre", **PLAIN)
        error = np.concatenate([ref.log_so3(s.R @ one["R"].T), s.t - one["t"]])
        distances.append(error @ np.linalg.solve(one["covariance"], error))
    assert low < np.mean(distances) < high


def test_tilt_sigma_zero_is_upright() -> None:
    for s, basis in scenes(49, 20, False, noise=1.0, outliers=6):
        one = bridge.estimate_scene(s, basis, THRESHOLD, refinement="default", tilt_sigma=0.0)
        np.testing.assert_allclose(s.view.R_cg.T @ one["R"][:, 1], [0.0, 1.0, 0.0], atol=1e-7)
