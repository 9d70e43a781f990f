"""`groundpose demo`: the bundled street is consistent, and the demo says and draws what it promises."""

import itertools
import json

import groundpose as gp
import numpy as np
import pytest
from conftest import project, rotation_error_deg
from groundpose import demo
from groundpose.demo.street import IMAGE, LABELS
from groundpose.keypoints.network import bundled
from groundpose.vehicles import CLASSES
from PIL import Image
from test_cli import one_line, run

STREET = demo.example()
# What stands out of a vehicle's 3D box: mirrors and aerials, metres.
FITTINGS = np.array([[-0.35, -0.4, 0.0], [0.35, 0.0, 0.0]])
needs_network = pytest.mark.skipif(not bundled().exists(), reason="the bundled network is not there")


def extent(R: np.ndarray, t: np.ndarray, bbox_3d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    corners = project(STREET.view, R, t, np.array(list(itertools.product(*bbox_3d.T))))
    return corners.min(axis=0), corners.max(axis=0)


def test_the_street_is_what_its_labels_say():
    """Boxes are those of the true poses, up to hidden parts; several classes; small enough to ship."""
    assert IMAGE.stat().st_size < 250_000
    height, width = STREET.image.shape[:2]
    assert STREET.view.camera.image_size == (width, height)
    assert len(STREET.bboxes) >= 6
    assert len(set(STREET.classes)) >= 3
    assert set(STREET.classes) <= set(CLASSES)
    assert (STREET.view.pitch, STREET.view.roll) == (0.0, 0.0)
    for box, R, t, bbox_3d in zip(STREET.bboxes, STREET.R, STREET.t, STREET.bbox_3d, strict=True):
        low, high = extent(R, t, bbox_3d + FITTINGS)
        assert (box[:2] >= np.maximum(low, 0.0) - 1.0).all()
        assert (box[2:] <= np.minimum(high, (width, height)) + 1.0).all()
        low, high = extent(R, t, bbox_3d)
        cut = np.minimum(high, (width - 1, height - 1)) - np.maximum(low, 0.0)
        assert ((box[2:] - box[:2]) > 0.7 * cut).all()
    # they stand on the ground as the true tilt has it
    ground = STREET.t @ STREET.true_view.R_camera_from_ground
    assert np.abs(ground[:, 1] - STREET.true_view.height).max() < 1.5


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    import stand_in

    return stand_in.write(tmp_path_factory.mktemp("model") / "any.onnx")


def test_demo_prints_and_draws(model, tmp_path):
    path = tmp_path / "street.png"
    result = run("demo", "--out", path, "--network", model)
    assert result.exit_code == 0, result.stderr
    assert f"Picture: {path}" in result.stdout
    for word in ("car", "crop", "network", "decode", "solve", "ms per vehicle", "nominally 0° and 0°"):
        assert word in result.stdout, word
    with Image.open(path) as image:
        assert image.width > 1000
    assert "street.nope" in one_line(run("demo", "--out", tmp_path / "street.nope", "--network", model))


def test_demo_without_a_network_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr("groundpose.keypoints.network.MODELS", tmp_path)
    result = run("demo", "--out", tmp_path / "street.png")
    assert result.exit_code == 2
    assert "give the file of one" in one_line(result)


def test_the_files_of_the_street_are_input_of_estimate(model):
    result = run("estimate", IMAGE, "--boxes", LABELS, "--network", model)
    assert result.exit_code == 0, result.stderr
    line = json.loads(result.stdout)
    assert len(line["objects"]) == len(STREET.bboxes)


@needs_network
def test_the_bundled_network_solves_the_street():
    result = demo.run()
    good = result.poses.ok
    assert good.sum() >= len(good) - 1
    assert np.median(rotation_error_deg(STREET.R, result.poses.R)[good]) < 4.0
    assert np.median((result.position_errors / np.linalg.norm(STREET.t, axis=1))[good]) < 0.06
    assert np.mean(result.poses.classes == np.array(STREET.classes)) > 0.8
    again = gp.Pipeline(threads=2)(IMAGE, STREET.bboxes, STREET.view)
    np.testing.assert_allclose(again.t, result.poses.t, rtol=1e-4)
