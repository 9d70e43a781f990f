"""A frame as a whole: what `frame=FramePriors(...)` makes of poses, sizes and view."""

import copy
import pickle
from dataclasses import replace

import groundpose as gp
import numpy as np
import pytest
from groundpose.vehicles import CLASSES, shape_model

CAMERA = gp.Camera(720.0, 720.0, 620.0, 190.0, image_size=(1242, 375))
TRUTH = gp.View(CAMERA, pitch=0.006, roll=-0.004, height=1.6)
NOMINAL = gp.View(CAMERA, height=1.62)
PLACES = ((-4.0, 9.0), (3.5, 14.0), (-6.0, 20.0), (5.0, 27.0), (0.5, 33.0))
SURE = gp.FramePriors(pitch_sigma=0.01, roll_sigma=0.01, roughness=0.01, slope=1e-3)


def scene(scale=1.0, view=TRUTH, seed=0, noise=1.0):
    """Keypoints, boxes and models of cars on the road, `scale` times as large as their model; true places."""
    rng, model = np.random.default_rng(seed), shape_model("car")
    body = scale * model.keypoints_3d
    keypoints, boxes, places = [], [], []
    for x, z in PLACES:
        yaw = rng.uniform(-3.0, 3.0)
        c, s = np.cos(yaw), np.sin(yaw)
        R = view.R_camera_from_ground @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        t = view.R_camera_from_ground @ np.array([x, view.height, z])
        pixels = CAMERA.project(body @ R.T + t)
        boxes.append([*pixels.min(axis=0), *pixels.max(axis=0)])
        keypoints.append(pixels + rng.normal(0.0, noise, pixels.shape))
        places.append(t)
    return np.array(keypoints), np.array(boxes), model, np.array(places)


def errors(poses, places):
    """Relative errors of the distances."""
    return np.linalg.norm(poses.t, axis=1) / np.linalg.norm(places, axis=1) - 1.0


def test_vehicles_that_are_smaller_than_their_model_come_nearer():
    keypoints, boxes, model, places = scene(scale=0.92)
    alone = gp.estimate_poses(NOMINAL, keypoints, boxes, model)
    together = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=SURE)
    assert np.median(errors(alone, places)) > 0.06
    assert np.abs(np.median(errors(together, places))) < 0.035
    assert (together.size < alone.size).all()
    mean, sigma = together.view.class_scales["car"]
    assert -0.09 < mean < -0.02
    assert 0.0 < sigma < 0.08


def test_the_view_is_estimated_with_its_sigmas():
    keypoints, boxes, model, _ = scene()
    view = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=SURE).view
    assert isinstance(view, gp.EstimatedView)
    assert abs(view.pitch - TRUTH.pitch) < 3.0 * view.pitch_sigma < 0.03
    assert abs(view.roll - TRUTH.roll) < 3.0 * view.roll_sigma <= 0.03
    assert abs(view.height - TRUTH.height) < 3.0 * view.height_sigma < 0.15
    assert abs(view.height_conflict) < 3.0
    assert 4.0 < view.agreeing <= 5.0
    for same in (copy.copy(view), pickle.loads(pickle.dumps(view)), replace(view, pitch=view.pitch)):
        assert same == view
        assert same.height_sigma == view.height_sigma


def test_without_a_height_it_is_found():
    keypoints, boxes, model, places = scene()
    nominal = replace(NOMINAL, height=None)
    poses = gp.estimate_poses(nominal, keypoints, boxes, model, frame=SURE)
    assert abs(poses.view.height - TRUTH.height) < 0.15
    assert np.isnan(poses.view.height_conflict)
    assert np.abs(errors(poses, places)).max() < 0.1


def test_a_height_that_cannot_be_right_is_noticed():
    keypoints, boxes, model, _ = scene()
    frame = replace(SURE, size=gp.SizePrior.from_dimensions({"car": model.size}))
    poses = gp.estimate_poses(replace(NOMINAL, height=2.1), keypoints, boxes, model, frame=frame)
    assert poses.view.height_conflict < -2.0
    assert any("height" in remark for remark in poses.remarks)
    right = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=frame)
    assert right.remarks == ()


def test_places_and_headings_are_in_the_ground_frame():
    keypoints, boxes, model, _ = scene(noise=0.3)
    for frame in (None, SURE):
        poses = gp.estimate_poses(TRUTH, keypoints, boxes, model, frame=frame)
        assert poses.position.shape == (5, 3)
        np.testing.assert_allclose(poses.position[:, [0, 2]], PLACES, rtol=0.06, atol=0.2)
        np.testing.assert_allclose(np.cos(poses.heading - poses.yaw), 1.0, atol=1e-9)
    np.testing.assert_allclose(poses.position[:, 1], poses.view.height, atol=0.1)


def test_sizes_are_those_of_the_boxes():
    keypoints, boxes, model, _ = scene()
    poses = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=SURE)
    for k, pose in enumerate(poses):
        low, high = pose.model.stretched_bbox_3d(pose.shape_coefficients)
        np.testing.assert_allclose(poses.size[k], (high - low)[[2, 1, 0]])
    assert ((poses.size_sigma > 0.0) & (poses.size_sigma < poses.size)).all()
    alone = gp.estimate_poses(NOMINAL, keypoints, boxes, model)
    assert (alone.size_sigma > 0.0).all()


def test_size_sigma_follows_the_derivatives():
    model, rng = shape_model("car"), np.random.default_rng(3)
    coefficients = 0.5 * rng.standard_normal(model.modes) * np.sqrt(model.eigenvalues)
    size, slopes = model.stretched_size(coefficients)
    for mode in range(model.modes):
        moved = coefficients.copy()
        moved[mode] += 1e-6
        difference = (np.log(model.stretched_size(moved)[0]) - np.log(size)) / 1e-6
        np.testing.assert_allclose(slopes[mode], difference, atol=1e-5)


def test_poses_of_the_frame_still_project_onto_the_keypoints():
    keypoints, boxes, model, _ = scene(scale=0.92, noise=0.3)
    poses = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=SURE)
    for k, pose in enumerate(poses):
        seen = CAMERA.project(pose.keypoints_3d @ pose.R.T + pose.t)
        side = (boxes[k, 2:] - boxes[k, :2]).max()
        assert np.sqrt(np.square(seen - keypoints[k]).mean()) < 0.05 * side


def test_covariances_are_symmetric_and_positive():
    keypoints, boxes, model, _ = scene()
    poses = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=SURE)
    for covariance in (*poses.covariance, *poses.shape_covariance):
        np.testing.assert_allclose(covariance, covariance.T, atol=1e-9)
        assert np.linalg.eigvalsh(covariance).min() > -1e-9
    assert np.linalg.eigvalsh(poses.view.covariance).min() > 0.0


def test_a_tilt_that_is_far_off_is_found_and_objects_are_estimated_again():
    keypoints, boxes, model, _ = scene(noise=0.3)
    wrong = gp.View(CAMERA, pitch=TRUTH.pitch + 0.04, height=1.6)
    frame = replace(SURE, pitch_sigma=0.05)
    poses = gp.estimate_poses(wrong, keypoints, boxes, model, frame=frame)
    assert abs(poses.view.pitch - TRUTH.pitch) < 0.01


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_vehicles(count):
    keypoints, boxes, model, _ = scene()
    poses = gp.estimate_poses(NOMINAL, keypoints[:count], boxes[:count], model, frame=SURE)
    assert len(poses) == count
    assert poses.view.pitch_sigma <= SURE.pitch_sigma + 1e-12
    assert poses.size.shape == poses.size_sigma.shape == poses.position.shape == (count, 3)
    if count == 0:
        assert (poses.view.pitch, poses.view.roll) == (0.0, 0.0)
        assert poses.view.height == pytest.approx(1.62)


def test_objects_without_an_answer_stay_so():
    keypoints, boxes, model, _ = scene()
    keypoints[2] = np.nan
    poses = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=SURE)
    assert poses.status[2] == "too_few_keypoints"
    for values in (poses.R, poses.t, poses.size, poses.size_sigma, poses.position, poses.covariance):
        assert np.isnan(values[2]).all()
        assert np.isfinite(values[[0, 1, 3, 4]]).all()
    nothing = gp.estimate_poses(NOMINAL, np.full_like(keypoints, np.nan), boxes, model, frame=SURE)
    assert not nothing.ok.any()
    assert nothing.view.agreeing == 0.0


def test_classes_have_their_own_sizes():
    keypoints, boxes, model, _ = scene()
    other = gp.ShapeModel(
        model.keypoints_3d, model.bbox_3d, model.basis, model.eigenvalues, model.keypoint_names, name="truck"
    )
    poses = gp.estimate_poses(NOMINAL, keypoints, boxes, [model, other, model, other, model], frame=SURE)
    assert list(poses.view.class_scales) == ["car", "truck"]
    many = [replace_name(model, f"class {k}") for k in range(9)]
    twice = [np.concatenate([rows, rows[:4]]) for rows in (keypoints, boxes)]
    with pytest.raises(gp.InputError, match="models: expected at most 8 classes, got 9"):
        gp.estimate_poses(NOMINAL, *twice, many, frame=SURE)


def replace_name(model, name):
    return gp.ShapeModel(model.keypoints_3d, model.bbox_3d, model.basis, model.eigenvalues, name=name)


@pytest.mark.parametrize(
    "name", ["pitch_sigma", "roll_sigma", "height_sigma", "roughness", "slope", "curvature"]
)
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, 50.0])
def test_absurd_priors_are_refused(name, value):
    with pytest.raises(gp.InputError, match=f"{name}: expected"):
        gp.FramePriors(**{name: value})


def test_mistakes():
    keypoints, boxes, model, _ = scene()
    given = (NOMINAL, keypoints, boxes, model)
    with pytest.raises(TypeError, match="frame: expected FramePriors"):
        gp.estimate_poses(*given, frame=0.1)
    with pytest.raises(TypeError, match="size: expected a SizePrior"):
        gp.FramePriors(size="europe")
    with pytest.raises(gp.InputError, match="frame_tilt_sigma"):
        gp.estimate_poses(*given, frame=SURE, frame_tilt_sigma=0.1)
    with pytest.raises(gp.InputError, match=r"options\.covariance"):
        gp.estimate_poses(*given, frame=SURE, options=gp.Options(covariance=False))
    for height in (0.01, 1500.0):
        with pytest.raises(gp.InputError, match="height: expected"):
            gp.estimate_poses(replace(NOMINAL, height=height), *given[1:], frame=SURE)


@pytest.mark.parametrize("region", sorted(gp.sizes.REGIONS))
def test_regions_size_the_models_of_every_class(region):
    prior = gp.SizePrior.region(region)
    for name in CLASSES:
        model = prior.sized(shape_model(name))
        if name in prior.classes:
            np.testing.assert_allclose(model.size, prior.classes[name].mean)
            assert prior.sized(shape_model(name)) is model
        mean, sigma, own = prior.scale(name)
        assert mean == 0.0
        assert 0.0 < sigma <= 0.2
        assert 0.0 < own <= 0.2


def test_size_priors():
    known = gp.SizePrior.from_dimensions({"car": (4.3, 1.5, 1.8)}, sigma=0.01)
    np.testing.assert_allclose(known.sized(shape_model("car")).size, (4.3, 1.5, 1.8))
    assert known.scale("car")[1] == 0.01
    assert known.scale("pickup") == gp.SizePrior.region().scale("pickup")
    for wrong in (
        lambda: gp.SizePrior.region("moon"),
        lambda: gp.SizePrior.from_dimensions({"car": (4.3, -1.5, 1.8)}),
        lambda: gp.SizePrior.from_dimensions({"car": (4.3, 1.5, 1.8)}, sigma=0.0),
        lambda: gp.ClassSize((4.0, 1.5, 1.8), -np.eye(3)),
        lambda: gp.ClassSize((4.0, 1.5, 1.8), np.eye(3), mean_sigma=3.0),
    ):
        with pytest.raises(gp.InputError):
            wrong()
    for wrong in (
        lambda: gp.SizePrior(3),
        lambda: gp.SizePrior({"car": 4.0}),
        lambda: gp.SizePrior.from_dimensions(4.0),
    ):
        with pytest.raises(TypeError):
            wrong()
