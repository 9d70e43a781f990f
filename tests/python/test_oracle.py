"""The oracle: exact on exact data, a minimum on noisy data, and its Jacobian against differences."""

import numpy as np
import pytest
from groundpose.lab.contenders import oracle
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.metrics import rotation_error_deg, translation_error_percent


def problem_of(scenes: Objects) -> oracle.Problem:
    c = scenes.camera
    return oracle.Problem(
        scenes.keypoints_2d, scenes.keypoints_3d, scenes.inlier_truth, (c.fx, c.fy, c.cx, c.cy)
    )


def pushed(scenes: Objects, radians: float, metres: float) -> tuple[np.ndarray, np.ndarray]:
    """The true poses, turned and moved a little."""
    rng = np.random.default_rng(5)
    turn = oracle.rotation_from_vector(radians * rng.standard_normal((len(scenes), 3)))
    return turn @ scenes.R, scenes.t + metres * rng.standard_normal((len(scenes), 3))


@pytest.mark.parametrize("kind", ["cube", "vehicle"])
def test_it_finds_the_exact_pose_from_a_start_that_is_off(kind: str) -> None:
    scenes = generate(kind, 20, seed=3, noise_sigma=0.0) if kind == "cube" else generate(kind, 20, seed=3)
    problem = problem_of(scenes)
    exact, _ = oracle.residuals_and_jacobian(problem, scenes.R, scenes.t)
    on_top = np.where(scenes.inlier_truth[..., None], scenes.keypoints_2d + exact, np.nan)
    problem = oracle.Problem(on_top, problem.keypoints_3d, problem.inlier_truth, problem.intrinsics)
    R, t = oracle.solve_6dof(problem, *pushed(scenes, 0.05, 0.2))
    assert rotation_error_deg(scenes.R, R).max() < 1e-4
    assert translation_error_percent(scenes.t, t).max() < 1e-6


def test_four_degrees_of_freedom_keep_the_object_upright() -> None:
    scenes = generate("vehicle", 20, seed=1)
    tilt = scenes.view.R_camera_from_ground
    R, t = oracle.solve_4dof(problem_of(scenes), scenes.R, scenes.t, tilt)
    assert np.allclose(R[:, :, 1], tilt[:, 1])
    assert np.allclose(R @ np.swapaxes(R, 1, 2), np.eye(3))
    assert rotation_error_deg(scenes.R, R).mean() < 4.0
    assert translation_error_percent(scenes.t, t).mean() < 4.0


@pytest.mark.parametrize("degrees_of_freedom", [6, 4])
def test_no_neighbour_explains_the_inliers_better(degrees_of_freedom: int) -> None:
    scenes = generate("cube", 10, seed=2, outlier_ratio=0.3)
    problem, tilt = problem_of(scenes), scenes.view.R_camera_from_ground

    def cost(R: np.ndarray, t: np.ndarray) -> np.ndarray:
        return np.asarray(np.sum(oracle.residuals_and_jacobian(problem, R, t)[0] ** 2, axis=(1, 2)))

    if degrees_of_freedom == 6:
        R, t = oracle.solve_6dof(problem, scenes.R, scenes.t)
        turns = 1e-4 * np.eye(3)
    else:
        R, t = oracle.solve_4dof(problem, scenes.R, scenes.t, tilt)
        turns = 1e-4 * tilt[:, 1][None]
    best = cost(R, t)
    for turn in np.vstack([turns, -turns]):
        assert np.all(cost(oracle.rotation_from_vector(turn[None]) @ R, t) > best)
    for move in np.vstack([1e-3 * np.eye(3), -1e-3 * np.eye(3)]):
        assert np.all(cost(R, t + move) > best)


def test_its_jacobian_is_that_of_differences() -> None:
    scenes = generate("cube", 3, n_points=20)
    problem, step = problem_of(scenes), 1e-6
    _, jacobian = oracle.residuals_and_jacobian(problem, scenes.R, scenes.t)
    for k in range(6):
        change = np.zeros(6)
        change[k] = step
        moved = []
        for sign in (1.0, -1.0):
            R = oracle.rotation_from_vector(sign * change[None, :3]) @ scenes.R
            moved.append(oracle.residuals_and_jacobian(problem, R, scenes.t + sign * change[3:])[0])
        assert np.allclose(jacobian[..., k], (moved[0] - moved[1]) / (2 * step), rtol=1e-5, atol=1e-4)
