"""Networks in files and the pipeline, on a network that is made here without training."""

import dataclasses
import json
import pickle
import subprocess
import sys
from types import SimpleNamespace
from typing import get_args

import groundpose as gp
import numpy as np
import pytest
from groundpose import Network, Pipeline, VehiclePoses
from groundpose.cli.inputs import NetworkFile
from groundpose.cli.main import app
from groundpose.keypoints import network as network_module
from groundpose.keypoints import onnx as onnx_file
from groundpose.keypoints.decode import Calibration, Detections
from groundpose.keypoints.image import as_rgb
from groundpose.keypoints.network import CERTAINTY, FORMAT
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import keypoint_indices
from PIL import Image
from stand_in import HEIGHT, PLACES, WIDTH, K, write
from typer.testing import CliRunner

IMAGE = np.random.default_rng(0).integers(0, 256, (150, 200, 3), dtype=np.uint8)
VIEW = gp.View(gp.Camera(200.0, 200.0, 99.5, 74.5, image_size=(200, 150)))


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return write(tmp_path_factory.mktemp("networks") / "stand_in.onnx")


@pytest.fixture(scope="module")
def pipeline(path):
    return Pipeline(path, threads=1)


def test_network_answers(path):
    network = Network(path, threads=1)
    assert (network.codec.width, network.codec.height) == (WIDTH, HEIGHT)
    assert repr(network) == "Network('stand_in.onnx', 128 x 96)"
    for n in (0, 1, 3):
        found = network.detect(np.zeros((n, HEIGHT, WIDTH, 3), np.uint8))
        assert found.keypoints.shape == (n, K, 2)
        assert found.spread.shape == found.peak.shape == (n, K)
        assert found.class_probabilities.shape == (n, len(CLASSES))
    np.testing.assert_array_equal(found.keypoints[2], PLACES)


@pytest.mark.parametrize(
    "crops",
    [np.zeros((1, 96, 128, 3)), np.zeros((96, 128, 3), np.uint8), np.zeros((1, 128, 96, 3), np.uint8)],
)
def test_crops_of_another_kind(path, crops):
    with pytest.raises(gp.InputError, match=r"crops: expected uint8 of shape \(N, 96, 128, 3\)"):
        Network(path, threads=1).detect(crops)


def test_files_that_are_not_ours(path, tmp_path, monkeypatch):
    with pytest.raises(FileNotFoundError):
        Network(tmp_path / "none.onnx")
    junk = tmp_path / "junk.onnx"
    junk.write_bytes(b"no network" * 10)
    with pytest.raises(gp.InputError, match=r"junk\.onnx: expected an ONNX network"):
        Network(junk)
    with pytest.raises(
        gp.InputError, match=r"expected a keypoint network of version 1 or 2, got another ONNX file"
    ):
        Network(write(tmp_path / "other.onnx", **{FORMAT: "99"}))
    with pytest.raises(gp.InputError, match="expected the keypoints of this version"):
        Network(write(tmp_path / "names.onnx", keypoints='["nose"]'))
    with pytest.raises(gp.InputError, match="threads: expected 1 or more"):
        Network(path, threads=0)
    with pytest.raises(TypeError, match="path: expected a path"):
        Network(3)  # type: ignore[arg-type]
    monkeypatch.setattr(network_module, "MODELS", tmp_path)
    for name in (None, *network_module.BUNDLED):
        with pytest.raises(FileNotFoundError, match=r"bundled network is not part .*`groundpose train`"):
            Network(name)


def test_the_bundled_networks_go_together_and_are_named_in_the_help():
    """The default asks the network of the others and a larger one."""
    found = [Network(name, threads=1) for name in network_module.BUNDLED]
    both, small, plain = (network.metadata["command"] for network in found)
    assert both.split("; ")[1:] == [small] == [plain]
    assert [json.loads(network.metadata.get("others", "[]")) for network in found] == [["lite32"], [], []]
    assert all(CERTAINTY in network.metadata and network.version == "2" for network in found)
    assert [network.metadata.get("weights") for network in found] == ["int8", "int8", None]
    assert all(name in get_args(NetworkFile)[1].help for name in network_module.BUNDLED)


@pytest.mark.parametrize("class_name", range(len(CLASSES)))
def test_keypoints_of_the_class_in_image_pixels(tmp_path, class_name):
    pipeline = Pipeline(write(tmp_path / "n.onnx", class_name), threads=1)
    box = np.array([50.0, 40.0, 130.0, 90.0])
    poses = pipeline(IMAGE, [box], VIEW)
    codec = pipeline.network.codec
    rows = keypoint_indices(CLASSES[class_name])
    wanted = codec.image_from_crop(PLACES[None].astype(float), codec.windows(box[None]))[0, rows]
    np.testing.assert_allclose(poses.keypoints_2d[0], wanted)
    assert poses.classes.tolist() == [CLASSES[class_name]]
    assert poses.models[0] is pipeline.models[CLASSES[class_name]]
    assert poses.class_probability[0] == pytest.approx(0.7)
    side = 80.0 / ((codec.windows(box[None])[0, [2]] - codec.windows(box[None])[0, [0]]) / WIDTH)
    np.testing.assert_allclose(poses.keypoint_scores[0], 1 / (1 + np.exp(6 + 2 * np.log(2.0 / side[0]))))


def test_bad_boxes_lose_nothing_of_the_others(pipeline):
    good = [50.0, 40.0, 130.0, 90.0]
    alone = pipeline(IMAGE, [good], VIEW)
    many = pipeline(
        IMAGE, [[0, 0, 0, 0], good, [500, 0, 600, 40], [np.nan] * 4, [90, 80, 60, 40], good], VIEW
    )
    assert isinstance(many, VehiclePoses)
    assert isinstance(many, gp.PoseBatch)
    assert many.classes.tolist() == ["", "car", "", "", "", "car"]
    for i in (0, 2, 3, 4):
        assert not many.ok[i]
        assert many.status[i] != "ok"
        assert np.isnan(many.class_probability[i])
    for i in (1, 5):
        np.testing.assert_array_equal(many.keypoints_2d[i], alone.keypoints_2d[0])
        np.testing.assert_array_equal(many.keypoint_scores[i], alone.keypoint_scores[0])
    assert repr(pipeline(IMAGE, [], VIEW)) == "VehiclePoses(0 of 0 ok)"
    assert len(pipeline(IMAGE, np.empty((0, 4)), VIEW)) == 0
    assert len(many[1].keypoints_2d) == 28
    assert "Car" in many.to_kitti() or "car" in many.to_kitti()


def test_importing_the_package_imports_neither_onnxruntime_nor_matplotlib():
    """They take longer than the rest together; `Pipeline` and `Network` are there when asked for."""
    code = """
import sys, groundpose
heavy = {"onnxruntime", "matplotlib", "PIL", "torch", "groundpose.vehicles"}
assert not heavy & set(sys.modules), heavy & set(sys.modules)
assert {"Network", "Pipeline", "VehiclePoses"} <= set(dir(groundpose))
assert groundpose.Pipeline is groundpose.keypoints.pipeline.Pipeline
assert "onnxruntime" not in sys.modules
try:
    groundpose.Pipelines
except AttributeError as error:
    assert "has no attribute 'Pipelines'" in str(error)
else:
    raise AssertionError
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_the_camera_has_the_size_of_the_image(pipeline):
    """Without it the sides of boxes that the border cuts would count as those of the vehicle."""
    free = dataclasses.replace(VIEW, camera=dataclasses.replace(VIEW.camera, image_size=None))
    cut = [[50.0, 40.0, 199.5, 90.0]]
    a, b = pipeline(IMAGE, cut, free), pipeline(IMAGE, cut, VIEW)
    assert a.view == b.view == VIEW
    np.testing.assert_array_equal(a.t, b.t)


def test_steps_are_timed_and_the_tilt_of_the_frame_is_passed_on(pipeline):
    boxes = [[50, 40, 130, 90], [20, 30, 100, 80]]
    poses = pipeline(IMAGE, boxes, VIEW)
    assert list(poses.seconds) == ["crop", "network", "decode", "solve"]
    assert all(0.0 < seconds < 5.0 for seconds in poses.seconds.values())
    assert np.isnan(poses.tilt_covariance).all()
    assert np.isfinite(pipeline(IMAGE, boxes, VIEW, frame_tilt_sigma=0.02).tilt_covariance).all()


def test_batches_do_not_matter(path):
    boxes = np.random.default_rng(2).uniform(0, 100, (11, 2)) + np.array([[0.0, 0.0]])
    boxes = np.concatenate([boxes, boxes + 50], axis=1)
    one, all_ = (Pipeline(path, threads=1, batch_size=n)(IMAGE, boxes, VIEW) for n in (1, 64))
    np.testing.assert_array_equal(one.keypoints_2d, all_.keypoints_2d)


def test_images(pipeline, tmp_path):
    Image.fromarray(IMAGE).save(tmp_path / "rgb.png")
    for same in (
        IMAGE,
        IMAGE[..., ::-1][..., ::-1],
        Image.fromarray(IMAGE),
        tmp_path / "rgb.png",
        str(tmp_path / "rgb.png"),
    ):
        np.testing.assert_array_equal(as_rgb(same), IMAGE)
    grey = IMAGE[..., 0]
    for same in (grey, grey[..., None], Image.fromarray(grey)):
        np.testing.assert_array_equal(as_rgb(same), np.stack([grey] * 3, axis=2))
    np.testing.assert_array_equal(as_rgb(Image.fromarray(IMAGE).convert("RGBA")), IMAGE)
    assert len(pipeline(tmp_path / "rgb.png", [[50, 40, 130, 90]], VIEW)) == 1


def test_images_that_are_refused(pipeline, tmp_path):
    deep = Image.fromarray(IMAGE[..., 0].astype(np.float32))
    deep.save(tmp_path / "deep.tif")
    (tmp_path / "text.png").write_text("no picture")
    whole = tmp_path / "whole.png"
    Image.fromarray(IMAGE).save(whole)
    (tmp_path / "cut.png").write_bytes(whole.read_bytes()[:2000])
    refused = [
        (IMAGE.astype(np.uint16), "image: expected uint8, got .*uint16.*scale it"),
        (IMAGE / 255.0, "image: expected uint8, got .*float64.*scale it"),
        (
            np.zeros((10, 10, 4), np.uint8),
            r"image: expected shape \(H, W, 3\) or \(H, W\), got shape \(10, 10, 4\)",
        ),
        (np.zeros((3, 10, 10), np.uint8), r"image: expected shape"),
        (np.zeros((0, 10, 3), np.uint8), "image: expected at least one pixel"),
        (deep, "image: expected whole numbers, got mode F"),
        (tmp_path / "deep.tif", r"deep\.tif: expected whole numbers"),
        (tmp_path / "text.png", r"text\.png: expected a picture"),
        (tmp_path / "cut.png", r"cut\.png: expected a whole picture"),
        (IMAGE[:100], r"image: expected the camera's size \(200, 150\), got \(200, 100\)"),
    ]
    for image, text in refused:
        with pytest.raises(gp.InputError, match=text):
            pipeline(image, [[50, 40, 130, 90]], VIEW)
    with pytest.raises(FileNotFoundError):
        pipeline(tmp_path / "none.png", [], VIEW)
    with pytest.raises(TypeError, match="image: expected an"):
        pipeline(None, [], VIEW)


def test_boxes_as_detectors_give_them(pipeline):
    """The result of another library, here one that looks like supervision's and one like torchvision's."""
    boxes = np.array([[50.0, 40.0, 130.0, 90.0], [20.0, 30.0, 100.0, 80.0]])
    wanted = pipeline(IMAGE, boxes, VIEW)
    detections = SimpleNamespace(xyxy=boxes, confidence=np.array([0.9, 0.8]), class_id=np.array([2, 7]))
    for given in (detections, {"boxes": boxes}, tuple(boxes), boxes.tolist()):
        np.testing.assert_array_equal(pipeline(IMAGE, given, VIEW).bboxes, wanted.bboxes)
    with pytest.raises(TypeError, match="expected boxes of a detector or an array"):
        pipeline(IMAGE, 3, VIEW)


def test_arguments_that_are_refused(path, pipeline):
    with pytest.raises(TypeError, match="view: expected a View"):
        pipeline(IMAGE, [], VIEW.camera)
    with pytest.raises(gp.InputError, match=r"bboxes: expected shape \(N, 4\)"):
        pipeline(IMAGE, [[1, 2, 3]], VIEW)
    with pytest.raises(gp.InputError, match="models: expected classes of car"):
        Pipeline(path, models={"boat": gp.ShapeModel(np.eye(3))})
    with pytest.raises(gp.InputError, match=r"models\['car'\]: expected 28 keypoints, got 3"):
        Pipeline(path, models={"car": gp.ShapeModel(np.eye(3))})
    with pytest.raises(gp.InputError, match="batch_size: expected 1 or more"):
        Pipeline(path, batch_size=0)
    with pytest.raises(TypeError, match="options: expected Options"):
        Pipeline(path, options={})  # type: ignore[arg-type]


def test_calibration_recovers_the_chances():
    rng = np.random.default_rng(0)
    spread = np.exp(rng.normal(-2.5, 0.8, (400, K)))
    peak = rng.uniform(0.01, 0.99, (400, K))
    peak[:, ::3] = 1.0  # outside the crop
    found = Detections.of(np.zeros((400, K, 2)), spread, peak, np.zeros((400, 4)))
    true = Calibration(-6.0, -2.5, 0.5, -4.0, -1.0)
    chance = true.scores(found, np.ones(400))
    fitted = Calibration.fit(found, np.ones(400), rng.random((400, K)) < chance, np.ones((400, K), bool))
    np.testing.assert_allclose(fitted.numbers, true.numbers, atol=0.4)
    assert Calibration.of(fitted.numbers) == fitted
    first = Calibration.of([-6.0, -2.5, 0.5])  # of a file that states nothing outside
    at_one = first.scores(Detections.of(np.zeros((1, 1, 2)), [[0.1]], [[1.0]], np.zeros((1, 4))), np.ones(1))
    np.testing.assert_allclose(at_one, 1.0 / (1.0 + np.exp(6.0 + 2.5 * np.log(0.1))))
    assert np.all((chance >= 0.0) & (chance <= 1.0))
    constant = Calibration.fit(found, np.ones(400), np.ones((400, K), bool), np.ones((400, K), bool))
    assert np.isfinite(constant.numbers).all()


@pytest.mark.parametrize("providers", [["cpu"], ["CPUExecutionProvider"], ("CPU",), [], None])
def test_the_cpu_runs_a_network_by_any_of_its_names(path, providers):
    pipeline = gp.Pipeline(path, providers=providers)
    assert pipeline.network._file._session.get_providers() == ["CPUExecutionProvider"]
    again = pickle.loads(pickle.dumps(pipeline.network))
    assert again.providers == (None if providers is None else tuple(providers))


@pytest.mark.parametrize("name", ["NoSuchExecutionProvider", "nosuch"])
def test_a_provider_that_is_not_there_is_refused_with_those_that_are(path, name):
    expected = rf"providers: expected execution providers of .*CPUExecutionProvider.*, got '{name}'"
    with pytest.raises(gp.InputError, match=expected):
        gp.Pipeline(path, providers=[name])
    with pytest.raises(gp.InputError, match=expected):
        gp.Network(path, providers=[name, "cpu"])
    with pytest.raises(TypeError, match="providers: expected a list of names"):
        gp.Network(path, providers="cpu")


def test_a_provider_that_does_not_start_is_refused(path, monkeypatch):
    """onnxruntime goes on with the CPU when it cannot load a provider's libraries."""
    there = ["NoSuchExecutionProvider", "CPUExecutionProvider"]
    ort = onnx_file.runtime()
    monkeypatch.setattr(ort, "get_available_providers", lambda: there)
    begin = ort.InferenceSession
    monkeypatch.setattr(
        ort, "InferenceSession", lambda *a, providers, **more: begin(*a, providers=providers[-1:], **more)
    )
    with pytest.raises(gp.InputError, match="NoSuchExecutionProvider, which does not start here"):
        gp.Network(path, providers=["nosuch"])


def test_a_network_given_has_its_own_providers(path):
    with pytest.raises(gp.InputError, match="providers: expected None beside a Network"):
        gp.Pipeline(gp.Network(path), providers=["cpu"])


def test_the_command_line_has_providers(path, tmp_path):
    Image.fromarray(IMAGE).save(tmp_path / "a.png")
    (tmp_path / "a.txt").write_text("10 10 90 80\n")
    given = [tmp_path / "a.png", "--boxes", tmp_path / "a.txt", "--network", path, "--fov-deg", "60"]
    for name, status in (("cpu", 0), ("nosuch", 2)):
        command = ["estimate", *map(str, given), "--provider", name, "--format", "jsonl"]
        result = CliRunner().invoke(app, command, catch_exceptions=False)
        assert (result.exit_code == 2) == (status == 2), result.stderr
    assert "providers: expected execution providers of" in result.stderr


def test_crops_are_asked_few_at_a_time_and_none_alone():
    for count in range(2, 65):
        places = [0, *network_module.cuts(count), count]
        sizes = np.diff(places)
        assert all(2 <= size <= network_module.MOST_AT_ONCE for size in sizes)
        assert all(place % 4 == 0 for place in places[:-1])


@pytest.mark.parametrize("count", [9, 13, 16])
def test_crops_asked_in_parts_have_the_bits_of_one_call(count):
    network = Network("int8", threads=1)
    crops = np.random.default_rng(count).integers(
        0, 256, (count, network.codec.height, network.codec.width, 3)
    )
    crops = crops.astype(np.uint8)
    found = network.detect(crops)
    whole = Detections.of(*network._file.run(network_module.OUTPUTS[network.version], crops=crops))
    for field in dataclasses.fields(Detections):
        np.testing.assert_array_equal(getattr(found, field.name), getattr(whole, field.name))
