"""The public Python API: what goes in, in every form, and what comes out."""

import ast
import copy
import dataclasses
import inspect
import itertools
import pickle
import subprocess
import sys
import textwrap

import groundpose as gp
import numpy as np
import pytest
from conftest import ARRAYS, CAMERA, MODEL, VIEW, Batch, assert_same, make_batch, project, rotation_error_deg
from groundpose._checks import shape_text
from groundpose.poses import ResultFields


def test_public_names_are_the_promised_ones():
    promised = (
        "Alternatives Calibration Camera CameraProfile CameraState ClassSize Crossing CrossingCounter "
        "Detector EstimatedView Estimator Flow FramePriors InputError Known Lane Line Network Options "
        "Pipeline Pose PoseBatch SeenVehicles ShapeModel Sightings SizePrior TrackOptions Tracker Tracks "
        "TrafficSummary VehiclePoses View World __version__ build_info calibrate estimate_poses "
        "region_radius2"
    )
    assert gp.__all__ == promised.split() == sorted(gp.__all__)
    info = gp.build_info()
    assert gp.__version__ == info["version"]
    assert {"std", "rayon"} <= set(info["features"])
    assert info["vector_unit"] in ("avx512", "avx2", "neon", "baseline")
    assert issubclass(gp.InputError, ValueError)


def test_poses_are_near_the_truth(batch, poses):
    assert poses.ok.sum() >= 29
    errors = rotation_error_deg(poses.R, batch.R)[poses.ok]
    distance = np.linalg.norm(poses.t - batch.t, axis=1) / np.linalg.norm(batch.t, axis=1)
    assert np.median(errors) < 1.5
    assert np.mean(errors > 15.0) <= 0.1
    assert np.median(distance[poses.ok]) < 0.02


def test_shapes_and_dtypes(batch, poses):
    assert vars(poses).keys() == {field.name for field in dataclasses.fields(poses)}
    n, p = batch.keypoints_2d.shape[:2]
    shapes = {"R": (n, 3, 3), "t": (n, 3), "covariance": (n, 6, 6)}
    shapes |= {"shape_coefficients": (n, 0), "shape_covariance": (n, 0, 0)}
    shapes |= {"shape_pose_covariance": (n, 0, 6)}
    shapes |= {"alternative_R": (n, 3, 3), "alternative_t": (n, 3), "alternative_covariance": (n, 6, 6)}
    shapes |= {"evidence": (n, 6)}
    shapes |= dict.fromkeys(("inlier_mask", "residuals"), (n, p))
    shapes |= dict.fromkeys(("stage_iterations", "stage_costs"), (n, 3))
    kinds = {"status": "U", "stop_reason": "U", "solver": "U", "ok": "b", "inlier_mask": "b"}
    kinds |= dict.fromkeys(("inlier_count", "iterations", "hypotheses", "stage_iterations"), "i")
    for name in ARRAYS:
        array = getattr(poses, name)
        assert array.shape == shapes.get(name, (n,)), name
        assert array.dtype.kind == kinds.get(name, "f"), name


def test_results_keep_their_own_copy_of_what_was_given(batch):
    """What the caller does to an array later changes no result, and the other way round."""
    given, boxes = batch.keypoints_2d.copy(), batch.bboxes.copy()
    poses = gp.estimate_poses(batch.view, given, boxes, batch.models)
    given[:], boxes[:] = 0.0, 0.0
    np.testing.assert_array_equal(poses.keypoints_2d, batch.keypoints_2d)
    np.testing.assert_array_equal(poses.bboxes, batch.bboxes)
    poses.keypoints_2d[:], poses.bboxes[:] = 1.0, 1.0
    assert not given.any()
    assert not boxes.any()


def test_a_result_field_is_what_its_row_of_the_table_says(batch, poses):
    """Shapes in `ResultFields` are those of the arrays, of one object's, and of the docstrings."""
    sizes = {"P": batch.keypoints_2d.shape[1], "M": MODEL.modes}
    tree = ast.parse(textwrap.dedent(inspect.getsource(ResultFields)))
    docs = dict(
        (row.target.id, doc.value.value)
        for row, doc in itertools.pairwise(tree.body[0].body)
        if isinstance(row, ast.AnnAssign) and isinstance(doc, ast.Expr)
    )
    for field in dataclasses.fields(ResultFields):
        shape = field.metadata["shape"]
        own = tuple(sizes.get(n, n) for n in shape)
        assert getattr(poses, field.name).shape == (len(poses), *own), field.name
        assert np.shape(getattr(poses[0], field.name)) == own, field.name
        assert docs[field.name].startswith(shape_text(shape)) == bool(shape), field.name


def check_consistency(poses: gp.PoseBatch) -> None:
    """What is said about inliers belongs to the pose returned; no answer means NaN everywhere."""
    for i, pose in enumerate(poses):
        assert pose.ok == (pose.status == "ok")
        if not pose.ok:
            assert np.isnan(pose.R).all()
            assert np.isnan(pose.t).all()
            assert np.isnan(pose.covariance).all()
            assert not pose.inlier_mask.any()
            assert np.isnan(pose.yaw)
            assert pose.inlier_count == 0
            continue
        np.testing.assert_allclose(pose.R @ pose.R.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(pose.R) > 0.0
        assert np.isfinite(pose.t).all()
        x = pose.keypoints_3d @ pose.R.T + pose.t
        seen = np.isfinite(pose.keypoints_2d).all(axis=1)
        camera = poses.view.camera
        given = camera.undistort(pose.keypoints_2d) if camera.distortion is not None else pose.keypoints_2d
        in_front = seen & (x[:, 2] > 0.0)
        expected = np.linalg.norm(project(poses.view, pose.R, pose.t, pose.keypoints_3d) - given, axis=1)
        np.testing.assert_allclose(pose.residuals[in_front], expected[in_front], rtol=1e-6, atol=1e-7)
        assert np.isnan(pose.residuals[~seen]).all()
        with np.errstate(invalid="ignore"):
            np.testing.assert_array_equal(pose.inlier_mask, pose.residuals <= pose.inlier_threshold)
        assert pose.inlier_count == pose.inlier_mask.sum() == poses.inlier_mask[i].sum()
        inliers = pose.residuals[pose.inlier_mask]
        assert pose.reprojection_rmse == pytest.approx(np.sqrt(np.mean(inliers**2)), rel=1e-9, abs=1e-9)
        forward = poses.view.R_camera_from_ground.T @ pose.R[:, 2]
        assert pose.yaw == pytest.approx(np.arctan2(forward[0], forward[2]), abs=1e-9)
        assert 0.0 <= pose.ambiguity <= 1.0


@pytest.mark.parametrize("refinement", ["default", "hre", "re", "gn", "none"])
@pytest.mark.parametrize("solver", ["auto", "p3p", "up2p"])
def test_what_is_said_of_inliers_belongs_to_the_pose(batch, refinement, solver):
    poses = batch.estimate(refinement=refinement, solver=solver)
    assert poses.ok.sum() >= 20
    check_consistency(poses)


@pytest.mark.parametrize("refinement", ["default", "gn", "hre"])
def test_covariance_is_that_of_the_errors(refinement):
    """Errors weighed by the covariance spread as a chi-squared of six (median 5.35, 95 % below 12.6)."""
    batch = make_batch(400, seed=3, outliers=0.0, noise=0.01)
    poses = batch.estimate(refinement=refinement, tilt_sigma=np.inf)
    assert poses.ok.all()
    np.testing.assert_allclose(poses.covariance, np.swapaxes(poses.covariance, 1, 2), rtol=1e-6, atol=1e-12)
    delta = batch.R @ np.swapaxes(poses.R, 1, 2)  # true = exp(w) estimated
    w = 0.5 * np.stack(
        [delta[:, 2, 1] - delta[:, 1, 2], delta[:, 0, 2] - delta[:, 2, 0], delta[:, 1, 0] - delta[:, 0, 1]],
        axis=1,
    )
    error = np.concatenate([w, batch.t - poses.t], axis=1)
    squared = np.einsum("ni,nij,nj->n", error, np.linalg.inv(poses.covariance), error)
    assert 3.0 < np.median(squared) < 8.0
    assert np.mean(squared < 12.6) > 0.9


def _strided(a: np.ndarray) -> np.ndarray:
    wide = np.zeros((*a.shape[:-1], 2 * a.shape[-1]))
    wide[..., ::2] = a
    return wide[..., ::2]


FORMS = {
    "float32": lambda a: a.astype(np.float32),
    "longdouble": lambda a: a.astype(np.longdouble),
    "big endian": lambda a: a.astype(">f8"),
    "Fortran order": np.asfortranarray,
    "strided": _strided,
    "reversed": lambda a: np.ascontiguousarray(a[::-1])[::-1],
    "lists": lambda a: a.tolist(),
    "list of arrays": list,
    "tuple of tuples": lambda a: tuple(
        tuple(map(tuple, row)) if a.ndim == 3 else tuple(row) for row in a.tolist()
    ),
    "masked": lambda a: np.ma.masked_array(a, np.isnan(a)),
    "read-only": lambda a: (b := a.copy(), b.setflags(write=False))[0],
}


@pytest.mark.parametrize("form", FORMS)
def test_input_of_any_form_gives_the_same_bits(batch, form):
    single = lambda a: a.astype(np.float32).astype(np.float64)  # noqa: E731  exact in every form
    keypoints, boxes = single(batch.keypoints_2d), single(batch.bboxes)
    keypoints[::3, 5] = np.nan
    scores = single(np.random.default_rng(0).random(keypoints.shape[:2]))
    expected = gp.estimate_poses(batch.view, keypoints, boxes, MODEL, scores)
    change = FORMS[form]
    assert_same(
        gp.estimate_poses(batch.view, change(keypoints), change(boxes), MODEL, change(scores)), expected
    )


def test_inputs_are_not_changed(batch):
    keypoints, boxes = batch.keypoints_2d.copy(), batch.bboxes.copy()
    gp.estimate_poses(batch.view, keypoints, boxes, MODEL)
    np.testing.assert_array_equal(keypoints, batch.keypoints_2d)
    np.testing.assert_array_equal(boxes, batch.bboxes)


def test_none_in_lists_is_not_seen_and_not_known(batch):
    keypoints, boxes = batch.keypoints_2d.copy(), batch.bboxes.copy()
    keypoints[2, [1, 7]] = np.nan
    boxes[4], boxes[5, 2] = np.nan, np.nan
    lists = keypoints.tolist()
    lists[2][1] = lists[2][7] = None
    sides = boxes.tolist()
    sides[4], sides[5][2] = None, None
    expected = gp.estimate_poses(batch.view, keypoints, boxes, MODEL)
    assert_same(gp.estimate_poses(batch.view, lists, sides, MODEL), expected)
    nothing = gp.estimate_poses(batch.view, keypoints, None, MODEL)
    assert_same(nothing, gp.estimate_poses(batch.view, keypoints, np.full_like(boxes, np.nan), MODEL))
    assert set(nothing.solver[nothing.ok]) == {"up2p"}


def _mixed(batch: Batch) -> tuple[list[gp.ShapeModel], list[np.ndarray]]:
    """Every third object has a model of the first 17 keypoints only, with two modes of shape."""
    rng = np.random.default_rng(1)
    small = gp.ShapeModel(
        MODEL.keypoints_3d[:17], MODEL.bbox_3d, 0.1 * rng.normal(size=(2, 17, 3)), [0.02, 0.01]
    )
    models = [small if i % 3 == 0 else MODEL for i in range(len(batch.keypoints_2d))]
    return models, [row[: len(m.keypoints_3d)] for row, m in zip(batch.keypoints_2d, models, strict=True)]


def test_ragged_is_padded_and_models_do_not_mix(batch, poses):
    models, rows = _mixed(batch)
    padded = batch.keypoints_2d.copy()
    padded[::3, 17:] = np.nan
    scores = np.random.default_rng(2).random(padded.shape[:2])
    ragged_scores = [row[: len(r)] for row, r in zip(scores, rows, strict=True)]
    ragged = gp.estimate_poses(batch.view, rows, batch.bboxes, models, ragged_scores)
    assert_same(ragged, gp.estimate_poses(batch.view, padded, batch.bboxes, models, scores))

    # Objects with the full model are what they are in a batch of that model alone.
    mixed = gp.estimate_poses(batch.view, rows, batch.bboxes, models)
    others = np.arange(len(models)) % 3 != 0
    for name in ("R", "t", "residuals", "inlier_mask", "covariance", "status"):
        np.testing.assert_array_equal(
            getattr(mixed, name)[others], getattr(poses, name)[others], err_msg=name
        )
    assert mixed[0].keypoints_2d.shape == (17, 2)
    assert mixed[0].shape_coefficients.shape == (2,)
    assert mixed[1].shape_coefficients.shape == (0,)
    assert mixed[1].shape_covariance.shape == (0, 0)
    assert mixed.shape_coefficients.shape == (len(models), 2)
    assert (mixed.shape_coefficients[others & mixed.ok] == 0.0).all()
    assert np.isnan(mixed.residuals[::3, 17:]).all()
    check_consistency(mixed)
    assert_same(gp.estimate_poses(batch.view, batch.keypoints_2d, batch.bboxes, [MODEL] * 30), poses)


@pytest.mark.parametrize(
    ("keypoints", "bboxes", "models"),
    [([], [], MODEL), ([], None, []), (np.empty((0, 24, 2)), np.empty((0, 4)), MODEL), ((), (), ())],
)
def test_no_objects_give_an_empty_batch(keypoints, bboxes, models):
    poses = gp.estimate_poses(VIEW, keypoints, bboxes, models)
    assert len(poses) == 0
    assert list(poses) == []
    assert poses.R.shape == (0, 3, 3)
    assert poses.covariance.shape == (0, 6, 6)
    assert poses.ok.dtype == bool
    assert poses.to_kitti() == ""


def test_pose_of_one_object(batch, poses):
    pose = poses[3]
    assert isinstance(pose, gp.Pose)
    assert isinstance(pose.status, str)
    assert isinstance(pose.ok, bool)
    assert isinstance(pose.yaw, float)
    assert isinstance(pose.inlier_count, int)
    np.testing.assert_array_equal(pose.R, poses.R[3])
    np.testing.assert_array_equal(pose.bbox, batch.bboxes[3])
    assert pose.model is MODEL
    np.testing.assert_array_equal(poses[-1].t, poses.t[-1])
    assert [p.inlier_count for p in poses] == poses.inlier_count.tolist()
    np.testing.assert_array_equal(poses.keypoints_3d(3), MODEL.keypoints_3d)
    for outside in (30, -31):
        with pytest.raises(IndexError, match="index"):
            poses[outside]
    with pytest.raises(TypeError, match="index"):
        poses[1:3]
    assert repr(poses) == f"PoseBatch({poses.ok.sum()} of 30 ok)"


def test_every_status_has_its_cause():
    batch = make_batch(6, seed=5, outliers=0.0)
    keypoints, boxes = batch.keypoints_2d.copy(), batch.bboxes.copy()
    keypoints[1, 2:] = np.nan
    keypoints[2] = keypoints[2, 0]
    keypoints[3] = np.random.default_rng(0).uniform(boxes[3, :2], boxes[3, 2:], keypoints[3].shape)
    keypoints[4, 0, 1] = np.inf
    boxes[5] = boxes[5, [2, 1, 0, 3]]
    poses = gp.estimate_poses(batch.view, keypoints, boxes, MODEL)
    expected = ["ok", "too_few_keypoints", "degenerate", "no_consensus", "invalid_input", "invalid_input"]
    assert poses.status.tolist() == expected
    check_consistency(poses)


def test_keypoints_on_a_line_are_degenerate():
    batch = make_batch(1, seed=6)
    share = np.linspace(0.1, 0.9, 24)[:, None]
    line = batch.bboxes[0, :2] + share * (batch.bboxes[0, 2:] - batch.bboxes[0, :2])
    assert gp.estimate_poses(batch.view, [line], batch.bboxes, MODEL).status[0] == "degenerate"


def test_distortion_is_undone(batch):
    """Keypoints distorted by the forward model give the poses of the undistorted ones."""
    k = (-0.25, 0.08, 0.001, -0.0005, 0.01)
    camera = dataclasses.replace(CAMERA, distortion=k)
    x = (batch.keypoints_2d - (CAMERA.cx, CAMERA.cy)) / (CAMERA.fx, CAMERA.fy)
    distorted = _distorted(x, k) * (CAMERA.fx, CAMERA.fy) + (CAMERA.cx, CAMERA.cy)
    back = camera.undistort(distorted.reshape(-1, 2)).reshape(distorted.shape)
    np.testing.assert_allclose(back, batch.keypoints_2d, atol=1e-6)
    view = dataclasses.replace(batch.view, camera=camera)
    poses = gp.estimate_poses(view, distorted, None, MODEL)
    straight = gp.estimate_poses(batch.view, batch.keypoints_2d, None, MODEL)
    np.testing.assert_allclose(poses.t[poses.ok], straight.t[poses.ok], rtol=1e-4, atol=1e-3)
    check_consistency(poses)


def _distorted(x: np.ndarray, k: tuple[float, ...]) -> np.ndarray:
    k1, k2, p1, p2, k3 = k
    u, v = x[..., 0], x[..., 1]
    r2 = u**2 + v**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    return np.stack(
        [
            u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u**2),
            v * radial + p1 * (r2 + 2 * v**2) + 2 * p2 * u * v,
        ],
        -1,
    )


VALUES = [CAMERA, VIEW, gp.Options(seed=3, inlier_threshold=[1.0, 2.0]), MODEL]


@pytest.mark.parametrize("value", VALUES, ids=lambda v: type(v).__name__)
def test_values_are_frozen_and_can_be_copied(value):
    for field in dataclasses.fields(value):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(value, field.name, None)
    for twin in (pickle.loads(pickle.dumps(value)), copy.deepcopy(value), copy.copy(value)):
        assert type(twin) is type(value)
        if not isinstance(value, gp.ShapeModel):
            assert twin == value
            assert hash(twin) == hash(value)
        else:
            np.testing.assert_array_equal(twin.keypoints_3d, value.keypoints_3d)
            assert twin.name == value.name


def test_results_can_be_pickled_and_are_frozen(poses):
    assert_same(pickle.loads(pickle.dumps(poses)), poses)
    with pytest.raises(dataclasses.FrozenInstanceError):
        poses.R = None
    with pytest.raises(dataclasses.FrozenInstanceError):
        poses[0].R = None
    assert dataclasses.replace(CAMERA, fx=2.0).fx == 2.0


def test_scores_of_zero_and_nan_are_not_seen(batch):
    scores = np.ones(batch.keypoints_2d.shape[:2])
    scores[1, 3], scores[1, 4] = 0.0, np.nan
    poses = batch.estimate(scores)
    assert np.flatnonzero(np.isnan(poses.residuals[1])).tolist() == [3, 4]
    hidden = batch.keypoints_2d.copy()
    hidden[1, 3:5] = np.nan
    assert_same(poses, gp.estimate_poses(batch.view, hidden, batch.bboxes, MODEL, np.ones_like(scores)))


def test_importing_the_package_loads_nothing_it_does_not_need():
    heavy = ("matplotlib", "typer", "rich", "PIL")
    code = f"import sys, groundpose; print([m for m in {heavy} if m in sys.modules])"
    command = [sys.executable, "-W", "error", "-c", code]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "[]\n"
