"""Real keypoints: the conventions of the data sets, and the main job on them."""

from pathlib import Path

import numpy as np
import pytest
from groundpose.lab.contenders.libraries import POSELIB_TUNED
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate.real import compare
from groundpose.lab.evaluate.real_data import RealObjects, apollo, kitti
from groundpose.lab.metrics import rotation_error_deg
from groundpose.lab.timing import Clock


def folder_with(name: str) -> Path:
    folder = data_folder()
    if not (folder / name).exists():
        pytest.skip(f"{name} is not in {folder} (GROUNDPOSE_DATA)")
    return folder


def kitti_objects() -> RealObjects:
    return kitti(folder_with("kitti_cnn_keypoints14_dev.npz"))


def apollo_objects(known_model: bool) -> RealObjects:
    return apollo(folder_with("apollo_cars_dev.npz"), known_model)


def relative_residuals(objects: RealObjects) -> np.ndarray:
    """(N, P) distance of each keypoint from its place under the labelled pose, over the box size."""
    fractions = np.full(objects.keypoints_2d.shape[:2], np.nan)
    for k in range(len(objects)):
        points = objects.models[k].keypoints_3d @ objects.R[k].T + objects.t[k]
        distance = np.linalg.norm(objects.view.project(points) - objects.keypoints_2d[k], axis=1)
        left, top, right, bottom = objects.bboxes[k]
        fractions[k] = distance / max(right - left, bottom - top)
    return fractions


def test_kitti_labels_and_keypoints_agree() -> None:
    objects = kitti_objects()
    assert objects.keypoint_scores is not None
    residuals, sure = relative_residuals(objects), objects.keypoint_scores > 0.3
    assert len(objects) == 108
    assert np.median(residuals[sure]) < 0.10
    assert np.mean(residuals[sure] > 0.15) < 0.10
    assert np.mean(residuals[~sure] > 0.15) > 0.6  # the scores tell the outliers


def test_the_labelled_kitti_boxes_are_those_of_the_labelled_3d_boxes() -> None:
    objects = kitti_objects()
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    differences = []
    for k in range(len(objects)):
        low, high = objects.models[k].bbox_3d
        points = (low + corners * (high - low)) @ objects.R[k].T + objects.t[k]
        pixels = objects.view.project(points)
        differences.append(np.r_[pixels.min(axis=0), pixels.max(axis=0)] - objects.bboxes[k])
    assert np.median(np.abs(differences)) < 1.5


@pytest.mark.parametrize("known_model", [True, False])
def test_apollo_labels_and_keypoints_agree(known_model: bool) -> None:
    objects = apollo_objects(known_model)
    residuals = relative_residuals(objects)
    assert len(objects) == 453
    assert np.isfinite(residuals).sum(axis=1).min() >= 8
    assert np.nanmedian(residuals) < 0.06


def test_the_nominal_tilt_of_apollo_is_that_of_its_labels() -> None:
    objects = apollo_objects(True)
    down = objects.R[:, :, 1] @ objects.view.R_camera_from_ground[:, 1]
    assert np.degrees(np.median(np.arccos(down))) < 3.0


def test_a_library_finds_the_labelled_orientations() -> None:
    """Conventions once more, without our own solver: all keypoints of Apollo, no outlier removed."""
    if reason := POSELIB_TUNED.missing():
        pytest.skip(reason)
    objects = apollo_objects(True)
    answers = POSELIB_TUNED.solve(objects, Clock())
    assert np.nanmedian(rotation_error_deg(objects.R, answers.R)) < 8.0


def test_the_main_job_on_real_keypoints() -> None:
    objects = kitti_objects()
    compared = compare(objects, "")
    ours = compared["methods"][0]
    assert ours["method"] == "ours, default, scores as weights"
    assert ours["no answer"] <= 5
    assert ours["median e_r deg"] < 4.0
    assert ours["above 15 deg %"] < 20.0
