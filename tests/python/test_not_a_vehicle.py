"""Boxes that hold no vehicle, with a network of format version 2 that takes bright crops for vehicles."""

import json
import pickle
from dataclasses import fields

import groundpose as gp
import numpy as np
import pytest
from groundpose import Network, Pipeline
from groundpose.keypoints.certainty import Certainty
from groundpose.keypoints.network import FORMAT
from groundpose.vehicles.classes import CLASSES
from PIL import Image
from stand_in import ANGLES, HEIGHT, WIDTH, write
from test_cli import run
from test_cli_images import BOX, CALIBRATION, SIZE, VIEW, T, car_places

# bright where the cars are, dark at the right
IMAGE = np.full((SIZE[1], SIZE[0], 3), 230, np.uint8)
IMAGE[:, 480:] = 20
BRIGHT, BESIDE = BOX.tolist(), (BOX - [20.0, 0.0, 20.0, 0.0]).tolist()
DARK, OUTSIDE = [500.0, 100.0, 600.0, 180.0], [900.0, 0.0, 950.0, 40.0]
BOXES = [BRIGHT, DARK, OUTSIDE, BESIDE]
_NOT_BY_OBJECT = {"view", "models", "seconds", "tilt_covariance", "error_dof", "box_remarks"}
_NOT_BY_OBJECT |= {"nominal_view", "nominal_tilt_sigma"}
SAID = ("vehicle_probability", "viewing_angle_probabilities")
FROM_WHAT_IS_SAID = ("evidence", "probability", "ambiguity")
FROM_WHAT_IS_SAID += tuple(f"alternative_{name}" for name in ("R", "t", "yaw", "covariance", "probability"))


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return write(tmp_path_factory.mktemp("networks") / "two.onnx", 0, car_places(), "2")


@pytest.fixture(scope="module")
def poses(path):
    return Pipeline(path, threads=1)(IMAGE, BOXES, VIEW)


def same(a: gp.VehiclePoses, b: gp.VehiclePoses, rows: object = slice(None), but: object = ()) -> None:
    """The answers of the rows are equal to the bit."""
    for name in {f.name for f in fields(gp.VehiclePoses)} - _NOT_BY_OBJECT - set(but):
        np.testing.assert_array_equal(getattr(a, name)[rows], getattr(b, name)[rows], err_msg=name)


def test_no_pose_without_a_vehicle_and_the_others_as_if_it_were_one(path, poses):
    assert poses.status[1] == "not_a_vehicle"
    assert poses.status[2] in ("too_few_keypoints", "invalid_input")
    assert not poses.ok[1]
    assert np.isnan(poses.R[1]).all()
    assert np.isnan(poses.t[1]).all()
    assert np.isnan(poses.keypoints_2d[1]).all()
    assert not poses.keypoint_scores[1, :28].any()
    assert (poses.iterations[1], poses.hypotheses[1]) == (0, 0)
    assert poses.classes.tolist() == ["car", "", "", "car"]
    assert poses.ok[[0, 3]].all()
    np.testing.assert_allclose(poses.t[0], T, atol=0.15)
    off = Pipeline(path, threads=1, vehicle_threshold=0.0)(IMAGE, BOXES, VIEW)
    assert off.classes.tolist() == ["car", "car", "", "car"]
    assert off.status[1] != "not_a_vehicle"
    same(poses, off, [0, 2, 3])
    assert off.keypoint_scores[1, :28].all()


def test_probabilities_stand_in_the_order_of_the_boxes(poses):
    np.testing.assert_allclose(poses.vehicle_probability, [230 / 255, 20 / 255, np.nan, 230 / 255], rtol=0.02)
    np.testing.assert_array_equal(poses.viewing_angle_probabilities[[0, 1, 3]], np.stack([ANGLES] * 3))
    assert np.isnan(poses.viewing_angle_probabilities[2]).all()
    np.testing.assert_allclose(poses.class_probability[[0, 1, 3]], 0.7, rtol=1e-6)


def test_version_1_answers_as_before_and_takes_all_boxes_for_vehicles(tmp_path, path):
    first = Network(write(tmp_path / "one.onnx", 0, car_places()), threads=1)
    found = first.detect(np.zeros((3, HEIGHT, WIDTH, 3), np.uint8))
    np.testing.assert_array_equal(found.vehicle, np.ones(3))
    assert found.viewing_angle.shape == (3, 16)
    assert np.isnan(found.viewing_angle).all()
    one = Pipeline(first, threads=1, vehicle_threshold=1.0)(IMAGE, BOXES, VIEW)
    two = Pipeline(path, threads=1, vehicle_threshold=0.0)(IMAGE, BOXES, VIEW)
    same(one, two, but=(*SAID, *FROM_WHAT_IS_SAID))
    np.testing.assert_array_equal(one.vehicle_probability, [1.0, 1.0, np.nan, 1.0])


def test_the_tilt_of_the_frame_is_that_of_its_vehicles(path):
    pipeline = Pipeline(path, threads=1)
    with_sky, without = (
        pipeline(IMAGE, boxes, VIEW, frame_tilt_sigma=0.02)
        for boxes in ([BRIGHT, BESIDE, DARK], [BRIGHT, BESIDE])
    )
    assert with_sky.view == without.view != VIEW
    for name in ("R", "t", "tilt_covariance", "keypoints_2d"):
        np.testing.assert_array_equal(getattr(with_sky, name)[:2], getattr(without, name)[:2])


@pytest.mark.parametrize("batch_size", [1, 3])
def test_batches_do_not_matter(path, poses, batch_size):
    same(Pipeline(path, threads=1, batch_size=batch_size)(IMAGE, BOXES, VIEW), poses)


@pytest.mark.parametrize("boxes", [[], [OUTSIDE], [DARK]])
def test_images_without_vehicles(path, boxes):
    poses = Pipeline(path, threads=1)(IMAGE, boxes, VIEW)
    assert len(poses) == len(boxes)
    assert not poses.ok.any()
    assert poses.viewing_angle_probabilities.shape == (len(boxes), 16)
    assert poses.class_probabilities.shape == (len(boxes), len(CLASSES))


def test_certainty_is_the_files_unless_it_is_given(tmp_path):
    own = Certainty(9.0, 7.0, (0.0,) * 7, 0.3)
    file = write(tmp_path / "sure.onnx", version="2", certainty=json.dumps(own.numbers()))
    assert Network(file, threads=1).certainty == own
    options = Pipeline(file, threads=1, options=gp.Options(min_probability=0.6)).options
    assert (options.keypoint_error_factor, options.keypoint_error_dof) == (9.0, 7.0)
    assert options.min_probability == 0.6


def test_a_network_without_certainty_does_not_err_independently(path):
    assert Pipeline(path, threads=1).options.keypoint_error_factor == Certainty().error_factor > 1.0


def test_the_threshold_is_the_files_unless_it_is_given(tmp_path):
    picky = write(tmp_path / "picky.onnx", version="2", vehicle_threshold="0.95")
    assert Network(picky, threads=1).vehicle_threshold == 0.95
    assert Pipeline(picky, threads=1)(IMAGE, [BRIGHT], VIEW).status.tolist() == ["not_a_vehicle"]
    assert Pipeline(picky, threads=1, vehicle_threshold=0.5)(IMAGE, [BRIGHT], VIEW).classes.tolist() == [
        "car"
    ]
    for bad in (-0.1, 1.5, np.nan):
        with pytest.raises(gp.InputError, match="vehicle_threshold: expected 0 to 1, or None"):
            Pipeline(picky, vehicle_threshold=bad)
    with pytest.raises(TypeError, match="vehicle_threshold: expected a number"):
        Pipeline(picky, vehicle_threshold="0.5")  # type: ignore[arg-type]


def test_a_file_without_the_outputs_of_its_version(tmp_path):
    with pytest.raises(gp.InputError, match="expected an output 'vehicle', got 'keypoints'"):
        Network(write(tmp_path / "cut.onnx", **{FORMAT: "2"}))


def test_results_can_be_pickled_drawn_and_written_for_kitti(poses, tmp_path):
    same(pickle.loads(pickle.dumps(poses)), poses)
    figure = poses.draw(IMAGE, tmp_path / "drawn.png")
    said = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert any("not_a_vehicle" in text for text in said)
    rows = [line.split() for line in poses.to_kitti().splitlines()]
    assert [float(value) for value in rows[1][3:8]] == [-10.0, *DARK]
    assert [float(value) for value in rows[1][11:16]] == [-1000.0, -1000.0, -1000.0, -10.0, 0.0]


def test_command_line(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Image.fromarray(IMAGE).save("street.png")
    (tmp_path / "boxes.json").write_text(json.dumps(BOXES))
    (tmp_path / "camera.json").write_text(json.dumps(CALIBRATION))
    given = ["estimate", "street.png", "--boxes", "boxes.json", "--calib", "camera.json", "--network", path]
    result = run(*given)
    assert result.exit_code == 0
    assert result.stderr.splitlines() == [
        "1 box holds no vehicle",
        "street.png: boxes outside the image: 1 of 4 end far beyond 640 x 300; "
        "are they of another image size?",
    ]
    sky = json.loads(result.stdout)["objects"][1]
    assert (sky["status"], sky["model"], sky["t"]) == ("not_a_vehicle", "", [None, None, None])
    assert sky["vehicle_probability"] == pytest.approx(20 / 255, rel=0.02)
    assert sky["keypoints_2d"] == [[None, None]] * 28
    assert json.loads(result.stdout)["objects"][2]["vehicle_probability"] is None
    strict, off = (run(*given, "--vehicle-threshold", value) for value in (0.99, 0))
    assert strict.stderr.splitlines()[0] == "3 boxes hold no vehicle"
    assert "no vehicle" not in off.stderr
    assert run(*given, "--format", "table").stdout.count("not_a_vehicle") == 1
    assert run(*given, "--vehicle-threshold", 2).exit_code == 2
    (tmp_path / "frame.json").write_text("{}")
    refused = run("estimate", "frame.json", "--vehicle-threshold", 0.5)
    assert "--vehicle-threshold: is for images" in refused.stderr
