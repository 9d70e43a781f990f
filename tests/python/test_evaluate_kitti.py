"""`groundpose evaluate kitti`: from a folder to numbers, and back to where it was stopped."""

import json
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose.cli.main import app
from groundpose.formats.kitti.dataset import KittiSet
from groundpose.formats.kitti.labels import CLASS_OF, read_labels
from groundpose.formats.kitti.results import R_from_rotation_y, results, rotation_y
from groundpose.formats.skips import Skips
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate.kitti import run as runs
from groundpose.lab.evaluate.kitti.bench import bench, make_folder
from groundpose.lab.evaluate.kitti.frame import Task, evaluate
from groundpose.lab.evaluate.kitti.keypoints import Found, Network, Simulated
from groundpose.lab.evaluate.kitti.run import Worker, run
from groundpose.lab.evaluate.kitti.store import Line, Store
from groundpose.vehicles import shape_model
from stand_in import write
from typer.testing import CliRunner

REAL = data_folder() / "kitti"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("kitti")
    make_folder(root, 12, seed=3)
    return root


class Exact:
    """A network that sees every keypoint where it is; its images need not be there."""

    def __call__(self, frame, bboxes, labels):
        pixels, models = [], []
        for label in labels:
            model = shape_model(CLASS_OF[label.type]).scaled(label.length, label.height, label.width)
            points = (model.keypoints_3d - model.bottom_centre) @ R_from_rotation_y(label.rotation_y).T
            at = (points + label.location + frame.camera_from_labels) @ frame.camera.K.T
            pixels.append(at[:, :2] / at[:, 2:])
            models.append(gp.ShapeModel(model.keypoints_3d, model.bbox_3d, name="exact"))
        return Found(pixels, [np.ones(len(p)) for p in pixels], models)


def worker(folder: Path, source=None, **task) -> Worker:
    return Worker(KittiSet(folder), Task(**{"keypoints": "simulated", **task}), source or Simulated())


def command(*arguments: object):
    return CliRunner().invoke(app, ["evaluate", "kitti", *map(str, arguments)])


def test_exact_keypoints_give_the_labels(folder, tmp_path):
    """Every convention at once: offset of the camera, angles, sizes, overlap, average precision."""
    content, _ = run(worker(folder, Exact()), tmp_path / "a.json")
    everything = content["methods"][0]["by difficulty"][-1]
    assert everything["objects"] > 40
    assert everything["no answer %"] == 0.0
    for name in ("mean e_r deg", "mean e_a deg", "median yaw error deg", "median depth error %"):
        assert everything[name] < 0.05, name
    assert everything["mean overlap in space"] > 0.99
    assert everything["median depth error on the ground %"] < 0.2
    assert content["methods"][0]["average precision"]["Car"]["3D"] == [100.0] * 3
    assert content["methods"][0]["average precision"]["Car"]["AOS"] == pytest.approx([100.0] * 3, abs=0.1)
    for values in content["self-check"].values():
        assert all(x in (100.0, None) for row in values.values() for x in row)


def test_the_task_reaches_the_solver(folder, tmp_path):
    def numbers(**task):
        content, found = run(worker(folder, **task), tmp_path / "b.json", fresh=True)
        return content, found.table((task.get("methods") or ("default",))[0])

    _, plain = numbers()
    assert not np.array_equal(plain, numbers(methods=("p1p+hre",))[1], equal_nan=True)
    assert not np.array_equal(plain, numbers(pitch_deg=3.0)[1], equal_nan=True)
    assert not np.array_equal(plain, numbers(frame_tilt_sigma_deg=3.0)[1], equal_nan=True)
    cars, errors = numbers(classes=("Car",))
    assert 0 < len(errors) < len(plain)
    assert [row["group"] for row in cars["methods"][0]["by class"]] == ["Car"]
    for wrong in ({"methods": ("p2p",)}, {"boxes": "none"}, {"classes": ("Tram",)}):
        with pytest.raises(gp.InputError, match="one of"):
            Task(**wrong)


def test_simulated_keypoints_depend_on_seed_and_frame_only(folder):
    frames = list(KittiSet(folder).frames(None, Skips()))
    frame = max(frames, key=lambda f: len(f.labels))
    boxes = np.array([x.bbox for x in frame.labels])
    first, again, other = (s(frame, boxes, frame.labels) for s in (Simulated(), Simulated(), Simulated(1)))
    fewer = Simulated()(frame, boxes[:2], frame.labels[:2])
    for k in range(2):
        np.testing.assert_array_equal(first.keypoints_2d[k], again.keypoints_2d[k])
        np.testing.assert_array_equal(first.keypoints_2d[k], fewer.keypoints_2d[k])
        assert not np.array_equal(first.keypoints_2d[k], other.keypoints_2d[k])
    sized = Simulated(models="sized")(frame, boxes, frame.labels).models[0].size
    label = frame.labels[0]
    assert sized == pytest.approx((label.length, label.height, label.width))
    rigid = Simulated(models="rigid")(frame, boxes, frame.labels).models[0]
    assert rigid.size == sized
    assert rigid.modes == 0
    with pytest.raises(gp.InputError, match="one of class, sized, rigid"):
        Simulated(models="none")


def test_two_processes_give_the_same(folder, tmp_path):
    one, _ = run(worker(folder), tmp_path / "one.json")
    two, _ = run(worker(folder), tmp_path / "two.json", jobs=2)
    for key in ("objects", "worst", "skipped", "self-check"):
        assert one[key] == two[key]
    for a, b in zip(one["methods"], two["methods"], strict=True):
        assert {k: v for k, v in a.items() if "us" not in k} == {k: v for k, v in b.items() if "us" not in k}


def test_a_run_goes_on_where_it_was_stopped(folder, tmp_path, monkeypatch):
    out = tmp_path / "c.json"
    whole, _ = run(worker(folder), tmp_path / "whole.json")
    done = []

    def stop(count, total):
        done.append((count, total))
        if count == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(worker(folder), out, advance=stop)
    store = out.with_suffix(".frames.jsonl")
    with store.open("a") as stream:  # a kill in the middle of a line
        stream.write('{"id": "0000')
    calls = []
    monkeypatch.setattr(runs, "evaluate", lambda *a: calls.append(a) or evaluate(*a))
    resumed, _ = run(worker(folder), out)
    assert done[-1] == (5, 12)
    assert len(calls) == 7
    assert resumed["methods"][0]["by difficulty"] == whole["methods"][0]["by difficulty"]
    assert resumed["worst"] == whole["worst"]
    with pytest.raises(gp.InputError, match="the same settings"):
        run(worker(folder, pitch_deg=1.0), out)
    run(worker(folder, pitch_deg=1.0), out, fresh=True)
    store.write_text("no frames\n")
    with pytest.raises(gp.InputError, match=r"c.frames.jsonl:1: expected frames of an evaluation"):
        run(worker(folder), out)


def test_a_line_of_the_store_round_trips(folder):
    line = Worker(KittiSet(folder), Task(methods=("default", "p3p+re")), Simulated())(("000001", True))
    assert line.result is not None
    again = Line.parse(line.text())
    assert again.text() == line.text()
    assert again.result.hits == line.result.hits
    line.skipped.add("a", "b")
    assert Line.parse(Line("x", None, line.skipped).text()).skipped.counts == {"a": 1}


def test_an_empty_store_is_begun_anew(tmp_path):
    path = tmp_path / "d.frames.jsonl"
    path.write_text("{")
    store = Store.open(path, {"a": 1})
    store.close()
    assert path.read_text() == '{"settings": {"a": 1}}\n'
    assert not list(store.lines())


def test_one_bad_file_does_not_stop_a_run(tmp_path, monkeypatch):
    make_folder(tmp_path / "k", 8)
    labels, calib = (tmp_path / "k" / "training" / name for name in ("label_2", "calib"))
    (calib / "000001.txt").write_text("P0: 1\n")
    (labels / "000002.txt").write_bytes(b"Car 0 0 \xff\xfe 1\nTricycle 0 0\n")
    (labels / "000003.txt").write_text("")
    (calib / "000004.txt").unlink()
    before = Simulated.__call__

    def breaks(self, frame, bboxes, labels):
        if frame.id == "000005":
            raise RuntimeError("out of luck")
        return before(self, frame, bboxes, labels)

    monkeypatch.setattr(Simulated, "__call__", breaks)
    split = tmp_path / "val.txt"
    split.write_text("".join(f"{k:06d}\n" for k in range(9)))
    result = command(
        *("--root", tmp_path / "k", "--keypoints", "simulated", "--jobs", 1),
        *("--split", split, "-o", tmp_path / "e.json"),
    )
    assert result.exit_code == 0, result.output
    assert "5 frames" in result.output
    assert "frames left out: 4" in result.output
    for text in ("000001", "cut-off line", "000004", "RuntimeError: out of luck", "000008"):
        assert text in result.output
    content = json.loads((tmp_path / "e.json").read_text())
    assert {row["reason"]: row["count"] for row in content["skipped"]} == {
        "frame with a bad calibration": 1,
        "cut-off line": 2,
        "frame without a readable file in calib": 2,
        "frame that failed": 1,
    }


def test_an_interrupt_keeps_what_is_done(folder, tmp_path, monkeypatch):
    before, calls = Simulated.__call__, []

    def stops(self, frame, bboxes, labels):
        calls.append(frame.id)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return before(self, frame, bboxes, labels)

    monkeypatch.setattr(Simulated, "__call__", stops)
    arguments = ["--root", folder, "--keypoints", "simulated", "--jobs", 1, "-o", tmp_path / "j.json"]
    stopped = command(*arguments)
    assert stopped.exit_code == 130
    assert "the same command goes on" in stopped.output
    assert command(*arguments).exit_code == 0
    assert json.loads((tmp_path / "j.json").read_text())["frames"]["done"] == 12


def test_every_frame_bad_is_status_2(tmp_path):
    make_folder(tmp_path / "k", 2)
    for path in (tmp_path / "k" / "training" / "calib").iterdir():
        path.unlink()
    result = command("--root", tmp_path / "k", "--keypoints", "simulated", "-o", tmp_path / "f.json")
    assert result.exit_code == 2
    assert "no frame could be used" in result.output


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--root", "nowhere"], "nowhere"),
        (["--method", "p9p"], "--method: expected one of default"),
        (["--class", "Tram"], "--class: expected one of Car"),
        (["--network", "none.onnx", "--keypoints", "network"], "none.onnx"),
        (["--split", "none.txt"], "none.txt"),
        (["--boxes", "detections"], "a folder of detections"),
    ],
)
def test_mistakes_are_one_line_and_status_2(folder, tmp_path, arguments, text):
    result = command("--root", folder, "--keypoints", "simulated", "-o", tmp_path / "g.json", *arguments)
    assert result.exit_code == 2
    assert text in result.output
    assert "Traceback" not in result.output


def test_results_are_written_as_kitti_wants_them(folder, tmp_path):
    run(Worker(KittiSet(folder), Task(), Exact(), tmp_path / "results"), tmp_path / "h.json")
    paths = sorted((tmp_path / "results" / "default" / "data").iterdir())
    assert len(paths) == 12
    for path in paths:
        truth = read_labels(folder / "training" / "label_2" / path.name)
        for found, label in zip(read_labels(path), truth, strict=True):
            assert found.type == label.type
            assert found.location == pytest.approx(label.location, abs=0.05)
            assert np.cos(found.rotation_y - label.rotation_y) == pytest.approx(1.0, abs=1e-4)
            assert np.cos(found.alpha - label.alpha) == pytest.approx(1.0, abs=1e-4)
            assert (found.truncated, found.occluded, found.score) == (-1, -1, 1.0)


def test_angle_and_box_of_a_pose():
    for angle in (-3.0, -1.0, 0.0, 2.5):
        assert rotation_y(R_from_rotation_y(angle)) == pytest.approx(angle)
    model = shape_model("van_bus")
    longer = model.stretched_bbox_3d(np.eye(model.modes)[0] * np.sqrt(model.eigenvalues[0]))
    shorter = model.stretched_bbox_3d(-np.eye(model.modes)[0] * np.sqrt(model.eigenvalues[0]))
    mean = np.ptp(model.bbox_3d, axis=0)
    np.testing.assert_allclose(model.stretched_bbox_3d(np.zeros(model.modes)), model.bbox_3d)
    np.testing.assert_allclose(np.ptp(longer, axis=0) + np.ptp(shorter, axis=0), 2 * mean, rtol=0.01)
    assert abs(np.ptp(longer, axis=0) - mean).max() > 1.0
    assert longer[1, 1] == model.bbox_3d[1, 1]  # it stays on the ground
    rigid = gp.ShapeModel(model.keypoints_3d, model.bbox_3d)
    np.testing.assert_array_equal(rigid.stretched_bbox_3d(np.zeros(3)), model.bbox_3d)


def test_offset_moves_results_to_the_frame_of_the_labels(folder):
    frame = KittiSet(folder).read("000000", Skips())
    boxes = np.array([x.bbox for x in frame.labels])
    found = Exact()(frame, boxes, frame.labels)
    poses = gp.estimate_poses(gp.View(frame.camera), found.keypoints_2d, boxes, found.models)
    plain, moved = results(poses), results(poses, offset=[1.0, 2.0, 3.0])
    for a, b in zip(plain, moved, strict=True):
        np.testing.assert_allclose(np.subtract(a.location, b.location), [1.0, 2.0, 3.0], atol=1e-9)


def test_real_frames_and_a_real_detector(tmp_path):
    if not REAL.is_dir():
        pytest.skip(f"no KITTI frames in {REAL} (GROUNDPOSE_DATA)")
    result = command("--root", REAL, "--keypoints", "simulated", "-o", tmp_path / "r.json", "--jobs", 1)
    assert result.exit_code == 0, result.output
    content = json.loads((tmp_path / "r.json").read_text())
    assert content["frames"] == {"done": 9, "left out": 0}
    hard = content["methods"][0]["by difficulty"][2]
    assert hard["objects"] == 33
    assert hard["median e_r deg"] < 3.0
    assert hard["e_r above 15 deg %"] < 10.0
    found = command(
        *("--root", REAL, "--keypoints", "simulated", "--boxes", "detections", "--jobs", 1),
        *("-o", tmp_path / "s.json"),
    )
    assert found.exit_code == 0, found.output
    assert "3 x frame without a readable file in detections" in found.output
    content = json.loads((tmp_path / "s.json").read_text())
    assert content["frames"] == {"done": 6, "left out": 3}
    assert content["methods"][0]["average precision"]["Car"]["2D"][1] > 60.0
    assert content["methods"][0]["by difficulty"][2]["median e_r deg"] < 3.0


def test_the_network_looks_at_the_image(tmp_path):
    """A toy network of the right shape: what it finds is wrong, but every step runs."""
    if not REAL.is_dir():
        pytest.skip(f"no KITTI frames in {REAL} (GROUNDPOSE_DATA)")
    source = Network(write(tmp_path / "toy.onnx"), threads=1)
    content, _ = run(Worker(KittiSet(REAL), Task(), source), tmp_path / "n.json", limit=2)
    assert content["frames"] == {"done": 2, "left out": 0}
    assert content["objects"] > 0
    assert content["keypoints, us per box"] > 0.0
    again, _ = run(Worker(KittiSet(REAL), Task(), source), tmp_path / "m.json", limit=2, jobs=2)
    assert again["methods"][0]["by difficulty"] == content["methods"][0]["by difficulty"]


def test_frames_without_an_image_are_named_for_the_network(folder, tmp_path):
    class Blind(Network):
        def __init__(self):
            pass

    content, _ = run(Worker(KittiSet(folder), Task(), Blind()), tmp_path / "i.json")
    assert content["frames"]["left out"] == 12
    assert content["skipped"][0]["reason"] == "frame without an image for the network"


def test_time_and_memory_are_measured():
    content = bench(30, 1)
    assert content["frames"] == 30
    assert content["objects"] > 60
    assert content["seconds"] > 0.0
