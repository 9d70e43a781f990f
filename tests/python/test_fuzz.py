"""Random garbage and damaged scenes: no panic, no hang, and no statement that is not true.

GROUNDPOSE_FUZZ=50000 pytest tests/python/test_fuzz.py tries 100,000 inputs.
"""

import dataclasses
import os

import groundpose as gp
import numpy as np
from conftest import MODEL, make_batch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

FUZZ = settings(
    derandomize="GROUNDPOSE_FUZZ" not in os.environ,  # the suite tries the same inputs in every run
    max_examples=int(os.environ.get("GROUNDPOSE_FUZZ", "250")),
    deadline=10_000,  # milliseconds: nothing hangs
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)

ODD = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    5e-324,
    1e-300,
    1e-9,
    640.0,
    1e6,
    1e15,
    1e200,
    1e308,
    -1e308,
    np.nan,
    np.inf,
    -np.inf,
]
numbers = st.one_of(st.floats(-2000.0, 4000.0), st.sampled_from(ODD), st.floats(allow_nan=True))
pixels = st.one_of(st.floats(0.0, 1280.0), st.integers(0, 12).map(float), numbers)


@st.composite
def models(draw):
    points = draw(st.integers(1, 12))
    size = st.sampled_from([1e-12, 1e-3, 1.0, 1.0, 1.0, 1e3, 1e12])
    keypoints = draw(hnp.arrays(float, (points, 3), elements=st.floats(-3.0, 3.0))) * draw(size)
    shape = draw(st.sampled_from(["any", "any", "one point", "line", "plane"]))
    if shape != "any":
        keypoints[:, {"one point": [0, 1, 2], "line": [0, 1], "plane": [1]}[shape]] = draw(
            st.floats(-2.0, 2.0)
        )
    modes = draw(st.integers(0, 2))
    basis = draw(hnp.arrays(float, (modes, points, 3), elements=st.floats(-1.0, 1.0)))
    eigenvalues = draw(hnp.arrays(float, modes, elements=st.floats(1e-9, 1e3)))
    box = np.stack([keypoints.min(axis=0) - 0.1, keypoints.max(axis=0) + 0.1])
    return gp.ShapeModel(keypoints, box, basis, eigenvalues)


@st.composite
def views(draw):
    f = st.sampled_from([1e-6, 1.0, 500.0, 1000.0, 1e9])
    k = draw(st.sampled_from([None, None, (-0.3, 0.1, 0.0, 0.0, 0.0), (10.0, -5.0, 1.0, 1.0, 3.0)]))
    size = draw(st.sampled_from([None, (1280, 720)]))
    camera = gp.Camera(draw(f), draw(f), draw(st.sampled_from([0.0, 640.0, -1e6])), 360.0, k, size)
    height = draw(st.sampled_from([None, 1.5, 1e-9, 1e9]))
    return gp.View(camera, draw(st.floats(-1.5, 1.5)), draw(st.floats(-3.1, 3.1)), height)


options = st.builds(
    gp.Options,
    inlier_threshold=st.sampled_from([None, 1e-9, 3.0, 30.0, 1e9]),
    confidence=st.sampled_from([1e-6, 0.99, 0.999999]),
    solver=st.sampled_from(["auto", "p1p", "p3p", "up2p", "p1p_height"]),
    cases=st.sampled_from(["all", "paper"]),
    scoring=st.sampled_from(["msac", "inliers"]),
    refinement=st.sampled_from(["default", "hre", "re", "gn", "none"]),
    tilt_sigma=st.sampled_from([None, 0.0, 1e-9, 0.03, 10.0, np.inf]),
    bbox_sigma=st.sampled_from([None, 1e-9, 2.0, np.inf]),
    shape_prior=st.sampled_from([None, True, False]),
    covariance=st.booleans(),
    max_iterations=st.sampled_from([1, 50, 500]),
    min_keypoints=st.sampled_from([3, 4, 8]),
    max_log10_nfa=st.sampled_from([-5.0, 1.0, np.inf]),
    score_weights=st.booleans(),
    seed=st.integers(0, 2**63 - 1),
)


def able(view, options):
    """A view that has what the solver asked for needs."""
    needs_height = options.solver == "p1p_height" and view.height is None
    return dataclasses.replace(view, height=1.5) if needs_height else view


@FUZZ
@given(data=st.data(), model=models(), view=views(), options=options, count=st.integers(0, 3))
def test_garbage_never_makes_a_wrong_statement(data, model, view, options, count):
    """Nothing here has an answer, yet one may be found: it must be consistent with itself."""
    points = len(model.keypoints_3d)
    keypoints = data.draw(hnp.arrays(float, (count, points, 2), elements=pixels))
    bboxes = data.draw(st.none() | hnp.arrays(float, (count, 4), elements=pixels))
    scores = data.draw(st.none() | hnp.arrays(float, (count, points), elements=st.floats(0.0, 1.0) | numbers))
    check_loosely(
        gp.estimate_poses(able(view, options), keypoints, bboxes, model, scores, options, threads=1)
    )


@FUZZ
@given(data=st.data(), seed=st.integers(0, 2**32 - 1), options=options)
def test_damaged_scenes_never_make_a_wrong_statement(data, seed, options):
    """A true scene, damaged here and there: nearer to what finds an answer than garbage."""
    batch = make_batch(2, seed=seed, outliers=data.draw(st.sampled_from([0.0, 0.3, 0.9])))
    keypoints, boxes = batch.keypoints_2d.copy(), batch.bboxes.copy()
    for _ in range(data.draw(st.integers(0, 4))):
        keypoints[data.draw(st.integers(0, 1)), data.draw(st.integers(0, 23))] = data.draw(numbers)
        boxes[data.draw(st.integers(0, 1)), data.draw(st.integers(0, 3))] = data.draw(numbers)
    view = able(batch.view, options)
    check_loosely(gp.estimate_poses(view, keypoints, boxes, MODEL, None, options, threads=1))


def check_loosely(poses: gp.PoseBatch) -> None:
    """`check_consistency` for numbers of any size: errors are relative to what was added up."""
    camera = poses.view.camera
    for pose in poses:
        assert pose.status in gp._core.STATUS
        if not pose.ok:
            assert np.isnan(pose.R).all()
            assert np.isnan(pose.t).all()
            assert not pose.inlier_mask.any()
            continue
        assert np.isfinite(pose.R).all()
        assert np.isfinite(pose.t).all()
        assert np.isfinite(pose.yaw)
        assert np.isfinite(pose.shape_coefficients).all()
        np.testing.assert_allclose(pose.R @ pose.R.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(pose.R) > 0.5
        with np.errstate(invalid="ignore"):
            np.testing.assert_array_equal(pose.inlier_mask, pose.residuals <= pose.inlier_threshold)
        assert pose.inlier_count == pose.inlier_mask.sum() >= 1
        points = pose.keypoints_3d
        x = points @ pose.R.T + pose.t
        assert (x[pose.inlier_mask, 2] > 0.0).all()
        given = camera.undistort(pose.keypoints_2d)[pose.inlier_mask]
        x = x[pose.inlier_mask]
        size = np.abs(points).max() + np.abs(pose.t).max()
        scale = max(camera.fx, camera.fy) * size / x[:, 2]
        projected = x[:, :2] / x[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
        expected = np.linalg.norm(projected - given, axis=1)
        slack = 1e-9 * (scale * (1.0 + size / x[:, 2]) + np.abs(given).max() + abs(camera.cx)) + 1e-7
        assert (np.abs(pose.residuals[pose.inlier_mask] - expected) <= slack).all()
