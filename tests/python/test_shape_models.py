"""The shape models that ship, and how they are made."""

from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab.bodies import make_models
from groundpose.lab.bodies.catalogue import outline
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate import shape_check, shape_fit
from groundpose.vehicles import CLASSES, flip_indices, keypoint_indices, keypoint_names, shape_model


@pytest.mark.parametrize("class_name", CLASSES)
def test_models_that_ship(class_name: str) -> None:
    model = shape_model(class_name)
    assert model is shape_model(class_name)
    assert model.name == class_name
    assert model.keypoint_names == keypoint_names(class_name)
    assert 5 <= model.modes <= 10
    assert np.all(np.diff(model.eigenvalues) < 0.0)
    flat = model.basis.reshape(model.modes, -1)
    np.testing.assert_allclose(flat @ flat.T, np.eye(model.modes), atol=1e-4)
    # On the ground, symmetric, keypoints (mirrors apart) inside the box.
    np.testing.assert_allclose(model.bbox_3d.sum(axis=0)[[0, 2]], 0.0, atol=0.02)
    assert model.bbox_3d[1, 1] == 0.0
    rows = keypoint_indices(class_name)
    partner = np.searchsorted(rows, flip_indices()[rows])
    np.testing.assert_allclose(model.keypoints_3d[partner] * [-1, 1, 1], model.keypoints_3d, atol=5e-3)
    inside = np.array(["mirror" not in name for name in model.keypoint_names])
    assert np.all(model.keypoints_3d[inside] > model.bbox_3d[0] - 0.05)
    assert np.all(model.keypoints_3d[inside] < model.bbox_3d[1] + 0.05)


@pytest.mark.parametrize("class_name", CLASSES)
def test_models_reach_bodies_they_have_not_seen(class_name: str) -> None:
    model = shape_model(class_name)
    shapes = np.stack([outline(class_name, seed)[0] for seed in range(10_000, 10_020)])
    basis = model.basis.reshape(model.modes, -1)
    off = (shapes - model.keypoints_3d).reshape(len(shapes), -1)
    rest = (off - off @ basis.T @ basis).reshape(shapes.shape)
    assert np.sqrt(np.mean(np.sum(rest**2, axis=-1))) < 0.06
    spread = (off @ basis.T) / np.sqrt(model.eigenvalues)
    assert 0.5 < np.sqrt(np.mean(spread**2)) < 1.5


@pytest.mark.parametrize("class_name", CLASSES)
def test_boxes_of_bodies_not_seen(class_name: str) -> None:
    model = shape_model(class_name)
    bodies = [outline(class_name, seed) for seed in range(10_000, 10_020)]
    off = np.stack([(X - model.keypoints_3d).ravel() for X, _ in bodies])
    coefficients = off @ model.basis.reshape(model.modes, -1).T
    left = np.stack([box - model.bbox_3d_of(c) for (_, box), c in zip(bodies, coefficients, strict=True)])
    assert np.sqrt(np.mean(left**2)) < 0.05


def test_unknown_class_is_named() -> None:
    with pytest.raises(gp.InputError, match="class_name: expected one of"):
        shape_model("tram")


def test_the_same_files_every_time(tmp_path: Path) -> None:
    for name in ("a", "b"):
        make_models.make(tmp_path / name, count=12)
    for class_name in CLASSES:
        first, second = ((tmp_path / name / f"{class_name}.npz").read_bytes() for name in ("a", "b"))
        assert first == second
        assert gp.ShapeModel.load(tmp_path / "a" / f"{class_name}.npz").name == class_name


def test_a_model_is_fitted_back_to_a_moved_shape() -> None:
    model = shape_model("car")
    truth = np.array([1.0, -0.7, 0.4, 0.0, 0.3]) * np.sqrt(model.eigenvalues[:5])
    shape = model.keypoints_3d + np.tensordot(truth, model.basis[:5], axes=1)
    angle = 0.3
    R = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    fit = shape_fit.fitted((shape @ R.T + [1.0, 2.0, 3.0])[None], model.keypoints_3d, model.basis[:5])
    assert np.abs(fit.residuals).max() < 2e-3
    np.testing.assert_allclose(fit.R[0] @ R, np.eye(3), atol=0.02)


def test_real_cars_are_reached() -> None:
    cars = shape_check.real_cars(data_folder())
    if cars is None:
        pytest.skip("real car models not found: set GROUNDPOSE_DATA")
    found = shape_check.check_real(shape_model("car"), cars)
    plain, even = found["labels as they are"], found["labels made symmetric"]
    free, of_mean = "residual, free coefficients, cm", "residual of the mean car, cm"
    assert plain[free] < 0.6 * plain[of_mean]
    assert even[free] < 7.5
    assert even["variance reached, %"] > 80.0
    assert (
        even["variance reached, %"] < even["variance reached by as many modes of the real cars themselves, %"]
    )
