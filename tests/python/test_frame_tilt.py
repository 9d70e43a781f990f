"""The tilt of a frame from all its objects."""

import math

import groundpose as gp
import numpy as np
import pytest

CAMERA = gp.Camera(1000.0, 1000.0, 960.0, 540.0, image_size=(1920, 1080))
TOLD = gp.View(CAMERA)
BOX = np.array([[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]])


def frame(seed: int, truth: gp.View, cars: int = 12, noise_px: float = 1.0):
    """Keypoints, boxes, models, R and t of upright cars."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(BOX[0], BOX[1], (24, 3))
    corners = np.stack(np.meshgrid(*BOX.T), axis=-1).reshape(-1, 3)
    keypoints, boxes, rotations, places = [], [], [], []
    for yaw, z in zip(rng.uniform(-np.pi, np.pi, cars), rng.uniform(10, 40, cars), strict=True):
        c, s = np.cos(yaw), np.sin(yaw)
        R = truth.R_camera_from_ground @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        t = truth.R_camera_from_ground @ np.array([rng.uniform(-0.3, 0.3) * z, 1.5, z])
        pixels = CAMERA.K @ (points @ R.T + t).T
        keypoints.append((pixels[:2] / pixels[2]).T + rng.normal(0, noise_px, (24, 2)))
        extent = CAMERA.K @ (corners @ R.T + t).T
        extent = (extent[:2] / extent[2]).T
        boxes.append([*extent.min(axis=0), *extent.max(axis=0)])
        rotations.append(R)
        places.append(t)
    return np.array(keypoints), np.array(boxes), gp.ShapeModel(points, BOX), np.array(rotations)


def rotation_error_deg(R, truth):
    cosine = (np.einsum("nij,nij->n", R, truth) - 1.0) / 2.0
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def test_a_wrong_tilt_of_the_whole_frame_is_found():
    truth = gp.View(CAMERA, pitch=math.radians(-8.0), roll=math.radians(2.0))
    keypoints, boxes, model, R = frame(0, truth)
    as_told = gp.estimate_poses(TOLD, keypoints, boxes, model)
    found = gp.estimate_poses(TOLD, keypoints, boxes, model, frame_tilt_sigma=math.radians(10.0))
    assert math.degrees(abs(found.view.pitch - truth.pitch)) < 1.0
    assert math.degrees(abs(found.view.roll - truth.roll)) < 1.0
    assert np.median(rotation_error_deg(found.R, R)) < 0.9 * np.median(rotation_error_deg(as_told.R, R))
    assert as_told.view is TOLD
    assert np.isnan(as_told.tilt_covariance).all()


def test_objects_with_a_wrong_pose_do_not_decide():
    truth = gp.View(CAMERA, pitch=math.radians(5.0))
    keypoints, boxes, model, _ = frame(1, truth)
    # a third of the objects leans by 25 degrees
    leaning, _, _, _ = frame(1, gp.View(CAMERA, pitch=math.radians(30.0)))
    keypoints[:4] = leaning[:4]
    boxes[:4] = np.nan
    found = gp.estimate_poses(TOLD, keypoints, boxes, model, frame_tilt_sigma=math.radians(10.0))
    assert math.degrees(abs(found.view.pitch - truth.pitch)) < 1.0


def test_covariance_is_honest():
    errors = []
    for seed in range(60):
        truth = gp.View(CAMERA, pitch=math.radians(-6.0))
        keypoints, boxes, model, _ = frame(seed, truth, cars=6, noise_px=2.0)
        found = gp.estimate_poses(TOLD, keypoints, boxes, model, frame_tilt_sigma=math.radians(10.0))
        error = np.array([found.view.pitch - truth.pitch, found.view.roll - truth.roll])
        errors.append(error @ np.linalg.solve(found.tilt_covariance, error))
    # two degrees of freedom; objects stand exactly upright here, so the spread allowed for them is unused
    assert 0.1 < np.mean(errors) < 2.5


def test_without_objects_the_told_tilt_stays():
    nothing = np.full((3, 24, 2), np.nan)
    _, _, model, _ = frame(0, TOLD)
    found = gp.estimate_poses(TOLD, nothing, None, model, frame_tilt_sigma=0.1)
    assert (found.view.pitch, found.view.roll) == (0.0, 0.0)
    assert found.tilt_covariance == pytest.approx(np.eye(2) * 0.01)


def test_height_and_threads_change_nothing():
    truth = gp.View(CAMERA, pitch=math.radians(-8.0))
    keypoints, boxes, model, _ = frame(2, truth, cars=40)
    told = gp.View(CAMERA, height=1.5)
    one, two = (
        gp.estimate_poses(told, keypoints, boxes, model, threads=n, frame_tilt_sigma=0.2) for n in (1, 2)
    )
    assert one.view == two.view
    assert one.view.height == 1.5
    np.testing.assert_array_equal(one.R, two.R)


@pytest.mark.parametrize("sigma", [0.0, -1.0, math.inf, math.nan])
def test_a_sigma_that_cannot_be(sigma):
    keypoints, boxes, model, _ = frame(0, TOLD, cars=1)
    with pytest.raises(gp.InputError, match="frame_tilt_sigma: expected a positive number of radians"):
        gp.estimate_poses(TOLD, keypoints, boxes, model, frame_tilt_sigma=sigma)
