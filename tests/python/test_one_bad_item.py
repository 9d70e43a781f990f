"""Whatever one image, frame or object raises becomes its own error, and the run goes on."""

import json
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from conftest import CAMERA, MODEL, VIEW, make_batch
from groundpose._checks import blamed
from groundpose.cli import frames as command
from groundpose.formats.fields import Field
from groundpose.formats.frames import Frame, FrameObject, model_members, read_frame
from PIL import Image
from stand_in import write
from test_cli import run

CAR = make_batch(1, seed=1).keypoints_2d[0].tolist()
LENS = {name: getattr(CAMERA, name) for name in ("fx", "fy", "cx", "cy")}
OBJECT = {"model": "car", "keypoints_2d": CAR}


def frame(label: object, **changes: object) -> str:
    return json.dumps({"id": label, "camera": LENS, "objects": [OBJECT]} | changes)


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    MODEL.save("names.npz")
    with np.load("names.npz") as content:
        np.savez("numbers.npz", **dict(content) | {"keypoint_names": np.arange(24)})
    return tmp_path


BAD_FRAMES = {
    "a model with numbers for names": (
        frame(1, models={"van": "numbers.npz"}),
        "frames.jsonl:2: models.van: numbers.npz: keypoint_names: expected a sequence of str",
    ),
    "a model of no name": (frame(1, models={"van": "\0"}), "frames.jsonl:2: models.van: "),
    "a focal length of 400 digits": (frame(1, camera=LENS | {"fx": 10**400}), "frames.jsonl:2: camera.fx: "),
    "an image size of 5000 digits": (
        frame(1).replace(str(LENS["fx"]), "9" * 5000),
        "frames.jsonl:2: expected JSON",
    ),
    "lists without an end": ('{"id": ' + "[" * 100_000 + "}", "frames.jsonl:2: expected JSON"),
    "bytes that are no text": ('{"id": "\udcff\udcfe}', "frames.jsonl:2: expected JSON"),
}


@pytest.mark.parametrize("case", BAD_FRAMES)
def test_a_bad_frame_costs_itself(case, folder):
    bad, text = BAD_FRAMES[case]
    first = frame(0, models={"car": "names.npz"})
    Path("frames.jsonl").write_bytes("\n".join([first, bad, frame(2)]).encode(errors="surrogateescape"))
    result = run("estimate", "frames.jsonl", "-o", "out.jsonl")
    assert result.exit_code == 1
    assert f"error: {text}" in result.stderr
    assert len(result.stderr) < 1500
    assert [json.loads(line)["id"] for line in Path("out.jsonl").read_text().splitlines()] == [0, 2]


def test_a_picture_that_is_missing_costs_itself(folder, monkeypatch):
    """Its poses are kept."""
    monkeypatch.setattr(gp.PoseBatch, "draw", lambda poses, image, path, **more: path.write_bytes(b""))
    labels = [0, "a" * 300, "\ud800", 3]
    given = [frame(label, models={"car": "names.npz"}) for label in labels]
    given[3] = frame(3, image="missing.png")
    Path("frames.jsonl").write_text("\n".join(given))
    result = run("estimate", "frames.jsonl", "-o", "out.jsonl", "--draw", "drawn/{id}.png")
    assert result.exit_code == 1
    assert "error: missing.png: No such file or directory" in result.stderr
    assert [json.loads(line)["id"] for line in Path("out.jsonl").read_text().splitlines()] == labels
    assert len(list(Path("drawn").iterdir())) == 3


def test_an_absurd_keypoint_does_not_make_a_picture_of_gigabytes(tmp_path):
    keypoints = np.array([CAR, CAR])
    keypoints[1, 0] = 1e300
    free = gp.View(gp.Camera(**LENS), VIEW.pitch, VIEW.roll)
    gp.estimate_poses(free, keypoints, [[0, 0, 1e20, 9], [1, 2, 3, 4]], MODEL).draw(None, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as drawn:
        assert drawn.width < 4000


class PanicException(BaseException):
    """What a panic of the core is in Python."""


@pytest.mark.parametrize("error", [MemoryError(), ZeroDivisionError("by zero"), PanicException("index")])
def test_whatever_a_frame_raises(error, folder, monkeypatch):
    def estimate(view, keypoints_2d, *_, **__):
        if len(keypoints_2d) == 2:
            raise error
        return gp.estimate_poses(view, keypoints_2d, [None], MODEL)

    monkeypatch.setattr(command, "estimate_poses", estimate)
    two = frame(1, objects=[OBJECT, OBJECT])
    given = [frame(0, models={"car": "names.npz"}), two, frame(2)]
    Path("frames.jsonl").write_text("\n".join(given))
    result = run("estimate", "frames.jsonl", "-o", "out.jsonl")
    assert result.exit_code == 1
    assert f"error: frames.jsonl:2: {type(error).__name__}" in result.stderr
    assert len(Path("out.jsonl").read_text().splitlines()) == 2


def test_what_is_not_the_items_passes():
    with pytest.raises(KeyboardInterrupt), blamed("item"):
        raise KeyboardInterrupt
    with pytest.raises(OSError, match="disk"), blamed("item", files=False):
        raise OSError(28, "disk full")
    with pytest.raises(gp.InputError, match=r"^item: disk full$"), blamed("item"):
        raise OSError(28, "disk full")
    with pytest.raises(gp.InputError, match=r"^x: expected$"), blamed("item"):
        raise gp.InputError("x: expected")


@pytest.mark.filterwarnings("error")
def test_an_absurd_box_costs_itself(tmp_path):
    pipeline = gp.Pipeline(write(tmp_path / "n.onnx"), threads=1)
    image, good = np.zeros((150, 200, 3), np.uint8), [50.0, 40.0, 130.0, 90.0]
    view = gp.View(gp.Camera(200.0, 200.0, 99.5, 74.5))
    boxes = [[0, 0, 1e20, 1e20], good, [-1e300, 0, 1e300, 70], [0, 0, 1e-300, 1], [-1e5, -1e5, 1e5, 1e5]]
    alone, poses = pipeline(image, [good], view), pipeline(image, boxes, view)
    np.testing.assert_array_equal(poses.keypoints_2d[1], alone.keypoints_2d[0])
    assert poses.classes.tolist()[:3] == ["", "car", ""]


def test_many_boxes_need_little_memory(tmp_path):
    """Crops are made batch by batch: 600 of them together would be 22 MB."""
    import tracemalloc

    pipeline = gp.Pipeline(write(tmp_path / "n.onnx", version="2"), threads=1, batch_size=10**6)
    boxes, image = np.tile([50.0, 40.0, 130.0, 90.0], (600, 1)), np.zeros((150, 200, 3), np.uint8)
    tracemalloc.start()
    pipeline.detect(image, boxes)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 8e6


def test_a_rigid_model_is_read_as_it_is_written(tmp_path):
    """A list of no modes has no shape."""
    objects = [OBJECT | {"model": "car"}]
    members = {"camera": LENS, "models": {"car": model_members(MODEL)}, "objects": objects}
    found = read_frame(Field(json.loads(json.dumps(members)), "x"), tmp_path)
    assert isinstance(found, Frame)
    assert isinstance(found.objects[0], FrameObject)
    np.testing.assert_array_equal(found.models[0].keypoints_3d, MODEL.keypoints_3d)
