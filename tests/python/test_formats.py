"""JSON frames and KITTI text: what is read, what is written, and how errors name their place."""

import copy
import dataclasses
import io
import json
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from conftest import CAMERA, MODEL, VIEW, as_json, assert_same, frame_of, make_batch
from groundpose.formats.fields import parse
from groundpose.formats.frames import Frame, FrameSource, model_members, read_frame
from groundpose.formats.records import pose_record

BATCH = make_batch(3, seed=21)
FRAME = frame_of(BATCH)


def read(frame: object, folder: Path = Path()) -> Frame:
    return read_frame(parse(json.dumps(frame), "frame.json"), folder)


def source(text: str, seekable: bool = True) -> FrameSource:
    stream = io.BytesIO(text.encode())
    stream.seekable = lambda: seekable
    return FrameSource(stream, "f.jsonl", Path())


def test_a_frame_gives_the_poses_of_the_api():
    frame = read(FRAME)
    np.testing.assert_allclose(frame.view.R_camera_from_ground, VIEW.R_camera_from_ground, atol=1e-12)
    assert frame.view.camera == CAMERA
    view = frame.view
    expected = gp.estimate_poses(view, BATCH.keypoints_2d, BATCH.bboxes, MODEL)
    assert_same(gp.estimate_poses(**frame.arguments), expected)
    np.testing.assert_array_equal(frame.truth[1], BATCH.t)
    assert [o.id for o in frame.objects] == [0, 1, 2]


def test_everything_optional_is_read(tmp_path):
    MODEL.save(tmp_path / "car.npz")
    frame = copy.deepcopy(FRAME)
    del frame["pitch_deg"], frame["roll_deg"]
    down = VIEW.R_camera_from_ground[:, 1]
    frame |= {
        "gravity": (9.81 * down).tolist(),
        "camera_height": 1.5,
        "image": "a.png",
        "id": 12,
        "_note": "x",
    }
    frame["camera"]["distortion"] = [-0.2, 0.1, 0.0, 0.0, 0.0]
    basis = np.random.default_rng(0).normal(size=(2, 24, 3))
    frame["models"] |= {"saved": "car.npz"}
    frame["models"]["car"] |= {
        "basis": basis.tolist(),
        "eigenvalues": [0.2, 0.1],
        "footprint": [[-1, -2], [0, 2], [1, -2]],
    }
    frame["objects"][0] |= {
        "id": "bus 7",
        "keypoint_scores": [0.5] * 24,
        "bbox": [1.0, None, 200, 300],
        "_n": 1,
    }
    frame["objects"][1] |= {"model": "saved", "bbox": None, "truth": None}
    frame["objects"][1]["keypoints_2d"][3] = None
    frame["objects"][1]["keypoints_2d"][4] = [1.0, None]
    got = read(frame, tmp_path)
    assert got.view.height == 1.5
    assert got.view.pitch == pytest.approx(VIEW.pitch)
    assert got.view.roll == pytest.approx(VIEW.roll)
    assert got.view.camera.distortion == (-0.2, 0.1, 0.0, 0.0, 0.0)
    assert (got.id, got.image) == (12, tmp_path / "a.png")
    first, second = got.objects[:2]
    assert (first.id, first.model, second.model) == ("bus 7", "car", "saved")
    np.testing.assert_array_equal(first.bbox, [1.0, np.nan, 200.0, 300.0])
    assert second.bbox is None
    assert np.isnan(second.keypoints_2d[[3, 4], [0, 1]]).all()
    np.testing.assert_array_equal(got.models[0].basis, basis)
    assert got.models[0].footprint.shape == (3, 2)
    assert got.models[0].name == "car"
    np.testing.assert_array_equal(got.models[1].keypoints_3d, MODEL.keypoints_3d)
    assert np.isnan(got.truth[0][1]).all()
    assert len(gp.estimate_poses(**got.arguments)) == 3  # scores of one object only


def test_a_model_of_a_frame_has_all_that_a_model_can_have(tmp_path):
    """No field of `ShapeModel` gets lost on the way through JSON or a file."""
    rng = np.random.default_rng(1)
    model = gp.ShapeModel(
        MODEL.keypoints_3d,
        MODEL.bbox_3d,
        rng.normal(size=(2, 24, 3)),
        [0.04, 0.01],
        [f"k{i}" for i in range(24)],
        [[-0.9, -2.2], [-0.9, 2.2], [0.9, 2.2]],
        "car",
        0.1 * rng.normal(size=(2, 2, 3)),
    )
    names = [f.name for f in dataclasses.fields(gp.ShapeModel) if f.init]
    assert all(np.size(getattr(model, name)) for name in names), "a field that this test leaves empty"
    model.save(tmp_path / "car.npz")
    frame = FRAME | {"models": {"car": json.loads(json.dumps(model_members(model)))}}
    for again in (read(frame, tmp_path).models[0], gp.ShapeModel.load(tmp_path / "car.npz")):
        for name in names:
            np.testing.assert_array_equal(getattr(again, name), getattr(model, name), err_msg=name)


def set_at(path: str, value: object):
    """A change of one member of the frame, `objects.0.bbox` for instance."""

    def change(frame: dict) -> None:
        *way, last = [int(step) if step.isdigit() else step for step in path.split(".")]
        for step in way:
            frame = frame[step]
        frame[last] = value

    return change


POINTS = FRAME["objects"][0]["keypoints_2d"]
BAD_FIELDS = {
    "camera": (None, "camera: expected a value, got none"),
    "camera.fx": ("1000", 'camera.fx: expected a finite number, got "1000"'),
    "camera.fy": (-1, "camera: fy: expected a positive finite number, got -1"),
    "camera.cx": (None, "camera.cx: expected a value"),
    "camera.cy": (float("nan"), "camera.cy: expected a finite number"),
    "camera.f": (1, "camera.f: expected"),
    "camera.lens": ("fisheye", "camera: lens: expected one of brown_conrady"),
    "camera.distortion": ([1, 2], "camera.distortion: expected a list of 4 or 5 numbers, got [1, 2]"),
    "camera.image_size": ([0, 5], "camera: image_size: expected positive"),
    "pitch_deg": (95, "pitch_deg: expected degrees between -90 and 90, got 95"),
    "roll_deg": ([1], "roll_deg: expected a finite number"),
    "gravity": ([0, 1, 0], "pitch_deg: expected gravity or angles, got both"),
    "camera_height": (-2, "height: expected a positive"),
    "models": ([1], "models: expected an object {...}"),
    "models.car": (
        "no.npz",
        "models.car: expected a file written by ShapeModel.save, got no.npz: No such file",
    ),
    "models.car.keypoints_3d": (
        [[1, 2]],
        "models.car.keypoints_3d[0]: expected a list of 3 numbers, got [1, 2]",
    ),
    "models.car.bbox_3d": ([[1, 1, 1], [0, 0, 0]], "models.car: bbox_3d: expected"),
    "models.car.basis": ([[[0, 0, 0]]], "models.car: eigenvalues: expected an array"),
    "models.car.size": (1, "models.car.size: expected one of"),
    "objects": ({}, "objects: expected a list [...]"),
    "objects.1": (5, "objects[1]: expected an object"),
    "objects.1.model": ("bus", 'objects[1].model: expected one of the models car, got "bus"'),
    "objects.1.keypoints_2d": (
        POINTS[:3],
        "objects[1].keypoints_2d: expected 24 keypoints as in model 'car', got 3",
    ),
    "objects.1.keypoints_2d.2": (
        [1.0],
        "objects[1].keypoints_2d[2]: expected a list of 2 numbers, got [1.0]",
    ),
    "objects.1.keypoints_2d.3": (
        [1.0, "a"],
        'objects[1].keypoints_2d[3][1]: expected a finite number, got "a"',
    ),
    "objects.1.keypoint_scores": ([1.0], "objects[1].keypoint_scores: expected a list of 24 numbers"),
    "objects.1.keypoint_score": (
        [1.0],
        "objects[1].keypoint_score: expected 'keypoint_scores', got an unknown field",
    ),
    "objects.1.bbox": ([1, 2, 3], "objects[1].bbox: expected a list of 4 numbers"),
    "objects.1.id": (1.5, "objects[1].id: expected a string or a whole number, got 1.5"),
    "objects.1.truth": (
        {"R": np.ones((3, 3)).tolist(), "t": [0, 0, 1]},
        "objects[1].truth.R: expected a rotation",
    ),
    "objects.1.truth.t": ([1], "objects[1].truth.t: expected a list of 3 numbers"),
    "image": (5, "image: expected a string, got 5"),
    "frame": (1, "frame: expected one of"),
}


@pytest.mark.parametrize("path", BAD_FIELDS)
def test_errors_name_the_field(path):
    value, text = BAD_FIELDS[path]
    frame = copy.deepcopy(FRAME)
    set_at(path, value)(frame)
    with pytest.raises(gp.InputError) as caught:
        read(frame)
    assert str(caught.value).startswith("frame.json: ")
    assert text in str(caught.value)
    assert str(caught.value).count("frame.json") == 1


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("{", "expected JSON, got Expecting property name"),
        ("[1, 2]", "expected an object"),
        ("3", "expected an object"),
        ('{"camera": {"fx": 1e999999}}', "camera.fx: expected a finite number"),
        ("[" * 100_000, "expected JSON"),
        ('{"a": ' + "9" * 5000 + "}", "expected JSON"),
        ('{\n  "camera": {,}\n}', "line 2, column 14"),
    ],
)
def test_texts_that_are_not_frames(text, what):
    with pytest.raises(gp.InputError, match=r"frame\.json: ") as caught:
        read_frame(parse(text, "frame.json"), Path())
    assert what in str(caught.value)


def lines_of(*frames: object) -> str:
    return "".join((f if isinstance(f, str) else json.dumps(f)) + "\n" for f in frames)


def test_a_view_is_that_of_its_own_line():
    later = {k: v for k, v in FRAME.items() if k != "models"} | {"pitch_deg": 1.0}
    frames = list(source(lines_of(FRAME, later, later, {**later, "pitch_deg": True}, FRAME)))
    assert "f.jsonl:4: pitch_deg: expected a finite number" in str(frames.pop(3))
    first, second, third, last = frames
    assert second.view is third.view
    assert second.view.pitch == pytest.approx(np.radians(1.0))
    assert last.view == first.view != second.view


def test_json_lines_share_models_and_survive_a_bad_line():
    later = {k: v for k, v in FRAME.items() if k != "models"}
    damaged = copy.deepcopy(FRAME)
    damaged["models"] = {"van": damaged["models"]["car"]}
    damaged["objects"][0]["bbox"] = "all"
    of_van = copy.deepcopy(later)
    of_van["objects"] = [{**of_van["objects"][0], "model": "van"}]
    text = lines_of(FRAME, "", '{"half": ', damaged, later, b"\xff\xfe".decode("latin1"), of_van)
    frames = list(source("\ufeff" + text))
    kinds = [type(f).__name__ for f in frames]
    assert kinds == ["Frame", "InputError", "InputError", "Frame", "InputError", "Frame"]
    assert [f.id for f in frames if isinstance(f, Frame)] == [0, 4, 6]
    assert str(frames[1]).startswith("f.jsonl:3: expected JSON")
    assert str(frames[2]).startswith("f.jsonl:4: objects[0].bbox: ")


def test_bytes_that_are_not_utf_8_are_an_error_of_their_line():
    stream = io.BytesIO(lines_of(FRAME).encode() + b'{"\xff": 1}\n' + lines_of(FRAME).encode())
    kinds = [type(f).__name__ for f in FrameSource(stream, "f", Path())]
    assert kinds == ["Frame", "InputError", "Frame"]


def test_one_frame_over_many_lines_is_one_frame():
    for text in (json.dumps(FRAME, indent=2), "\n\n" + json.dumps(FRAME, indent=1), json.dumps(FRAME)):
        one = source(text)
        assert not one.several
        (frame,) = one
        assert len(frame.objects) == 3
    assert source(lines_of(FRAME, FRAME)).several
    assert source(lines_of(FRAME), seekable=False).several  # more may come
    with pytest.raises(gp.InputError, match="empty"):
        source("\n \n")


def test_frames_of_a_pipe_are_given_as_they_come():
    """The second line is not asked for before the first frame is out."""
    asked = []

    class Slow(io.BytesIO):
        def readline(self, *args):
            asked.append(1)
            return super().readline(*args)

        def seekable(self):
            return False

    frames = iter(FrameSource(Slow(lines_of(FRAME, FRAME).encode()), "-", Path()))
    next(frames)
    assert len(asked) == 1


def test_record_holds_the_pose_and_null_for_nan():
    batch = make_batch(3, seed=22)
    frame = frame_of(batch, "a/1")
    frame["objects"][1]["keypoints_2d"] = [None] * 24
    read_ = read(frame)
    poses = gp.estimate_poses(**read_.arguments)
    record = json.loads(pose_record(read_, poses), parse_constant=lambda name: pytest.fail(name))
    assert record["id"] == "a/1"
    good, bad = record["objects"][0], record["objects"][1]
    np.testing.assert_array_equal(good["R"], poses.R[0])
    np.testing.assert_array_equal(good["t"], poses.t[0])
    np.testing.assert_array_equal(good["covariance"], poses.covariance[0])
    assert (good["yaw"], good["inlier_count"], good["status"]) == (poses.yaw[0], poses.inlier_count[0], "ok")
    assert (good["inlier_mask"], good["model"]) == (poses.inlier_mask[0].tolist(), "car")
    assert bad["status"] == "too_few_keypoints"
    assert bad["t"] == [None, None, None]
    assert bad["yaw"] is None
    assert bad["residuals"] == [None] * 24


def test_kitti_text():
    """Against the definitions of KITTI's development kit, with a level camera."""
    view = gp.View(gp.Camera(700.0, 700.0, 600.0, 180.0, image_size=(1242, 375)))
    batch = make_batch(4, seed=23, outliers=0.0, noise=0.0, view=view, depth=(15.0, 30.0))
    keypoints, boxes = batch.keypoints_2d.copy(), batch.bboxes.copy()
    keypoints[2] = np.nan
    boxes[3, 0] = np.nan
    poses = gp.estimate_poses(view, keypoints, boxes, MODEL)
    lines = [
        line.split()
        for line in poses.to_kitti(["Car", "Van", "Car", "my bus"], [0.9, 0.8, 0.7, 0.6]).splitlines()
    ]
    assert [len(line) for line in lines] == [16] * 4
    assert [line[0] for line in lines] == ["Car", "Van", "Car", "my_bus"]
    assert [float(line[15]) for line in lines] == [0.9, 0.8, 0.7, 0.6]
    numbers = np.array([[float(x) for x in line[1:]] for line in lines])
    assert (numbers[:, :2] == -1.0).all()
    for i in (0, 1, 3):
        alpha, box, size, xyz, ry = (
            numbers[i, 2],
            numbers[i, 3:7],
            numbers[i, 7:10],
            numbers[i, 10:13],
            numbers[i, 13],
        )
        np.testing.assert_allclose(size, [1.5, 1.8, 4.5])
        np.testing.assert_allclose(xyz, batch.t[i], atol=2e-3)  # the model's origin is its bottom centre
        forward = [np.cos(ry), 0.0, -np.sin(ry)]  # KITTI: object x is forward, R_y(ry) [1, 0, 0]
        np.testing.assert_allclose(forward, batch.R[i, :, 2], atol=2e-3)
        assert np.cos(alpha - (ry - np.arctan2(xyz[0], xyz[2]))) == pytest.approx(1.0, abs=1e-6)
        np.testing.assert_allclose(box, np.clip(batch.bboxes[i], 0, [1241, 374] * 2), atol=0.1)
        assert -np.pi <= ry <= np.pi
    np.testing.assert_allclose(numbers[2, 3:7], boxes[2], atol=1e-4)
    np.testing.assert_array_equal(numbers[2, 7:14], [-1, -1, -1, -1000, -1000, -1000, -10])
    assert numbers[2, 2] == -10.0
    shares = [float(line.split()[15]) for line in poses.to_kitti().splitlines()]
    np.testing.assert_allclose(shares, [1.0, 1.0, 0.0, 1.0])
    with pytest.raises(gp.InputError, match="names: expected 4 names"):
        poses.to_kitti(["Car"])
    with pytest.raises(gp.InputError, match="scores: "):
        poses.to_kitti(None, [1.0])


def test_json_helper_of_these_tests_keeps_numbers():
    assert as_json(np.array([1.5, np.nan])) == [1.5, None]
