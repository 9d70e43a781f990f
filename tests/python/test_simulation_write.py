"""`groundpose simulate`: what is in the folder, what an interruption leaves, what a mistake looks like."""

import csv
import errno
import json
import math
import shutil
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose.cli.main import app
from groundpose.cli.simulate import read_fractions
from groundpose.formats.kitti.labels import read_labels
from groundpose.lab.drive import labels, scene, scene_seed, workers, write
from groundpose.lab.drive.workers import Settings
from groundpose.lab.drive.write import write_drive
from groundpose.vehicles import CLASSES, keypoint_names
from typer.testing import CliRunner

SEED, FIRST, FRAMES = 9, 5, 5
SETTINGS = Settings(seed=SEED, split="validation", first=FIRST, images=None)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    """A finished folder without pictures."""
    out = tmp_path_factory.mktemp("drive") / "out"
    write_drive(out, FRAMES, SETTINGS)
    return out


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def records(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "labels.jsonl").read_text().splitlines()]


def run(*arguments: object):
    return CliRunner().invoke(app, ["simulate", *map(str, arguments)])


def one_line(result) -> str:
    lines = result.stderr.strip().splitlines()
    assert result.exit_code == 2
    assert len(lines) == 1, result.stderr
    assert "Traceback" not in result.output
    return lines[0]


def test_lines_are_the_labels(whole):
    found = records(whole)
    assert [frame["id"] for frame in found] == list(range(FIRST, FIRST + FRAMES))
    for frame in found:
        truth = labels(scene(scene_seed(SEED, "validation"), frame["id"]))
        assert [o["id"] for o in frame["objects"]] == [label.index for label in truth]
        assert set(frame["models"]) == {label.class_name for label in truth}
        for item, label in zip(frame["objects"], truth, strict=True):
            np.testing.assert_allclose(item["bbox"], label.bbox, atol=1e-3)
            np.testing.assert_allclose(item["truth"]["t"], label.t, atol=1e-6)
            assert [p is None for p in item["keypoints_2d"]] == (label.keypoint_states == 0).tolist()
            assert item["keypoint_scores"] == (label.keypoint_states == 2).astype(float).tolist()


def test_every_frame_can_be_estimated(whole, tmp_path):
    out = tmp_path / "poses.jsonl"
    result = CliRunner().invoke(app, ["estimate", str(whole / "labels.jsonl"), "-o", str(out)])
    assert result.exit_code == 0, result.output
    poses = [json.loads(line) for line in out.read_text().splitlines()]
    assert [len(p["objects"]) for p in poses] == [len(f["objects"]) for f in records(whole)]
    assert sum(o["status"] == "ok" for p in poses for o in p["objects"]) > 5


def test_kitti_files_say_the_same(whole):
    checked = 0
    for frame in records(whole):
        stem = f"{frame['id']:06d}.txt"
        camera = gp.Camera.from_kitti(whole / "training" / "calib" / stem)
        assert camera.fx == pytest.approx(frame["camera"]["fx"])
        rows = read_labels(whole / "training" / "label_2" / stem)
        assert len(rows) == len(frame["objects"])
        for row, item in zip(rows, frame["objects"], strict=True):
            assert (
                row.type
                == {"car": "Car", "van_bus": "Van", "pickup": "Car", "box_truck": "Truck"}[item["model"]]
            )
            assert row.bbox == pytest.approx(item["bbox"], abs=2e-3)
            assert row.truncated == pytest.approx(item["_truncation"], abs=6e-3)
            assert row.occluded == item["_occlusion"]
            low, high = np.array(item["_bbox_3d"])
            assert [row.width, row.height, row.length] == pytest.approx(high - low, abs=1e-3)
            R, t = np.array(item["truth"]["R"]), np.array(item["truth"]["t"])
            middle = [0.5 * (low[0] + high[0]), high[1], 0.5 * (low[2] + high[2])]
            assert row.location == pytest.approx(R @ middle + t, abs=1e-3)
            forward = [math.cos(row.rotation_y), -math.sin(row.rotation_y)]  # KITTI's object points along x
            assert np.dot(forward, R[[0, 2], 2]) / np.hypot(*R[[0, 2], 2]) == pytest.approx(1.0, abs=1e-6)
            checked += 1
    assert checked > 10


def test_kitti_reader_names_the_line(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("Car 0 0 0 1 2 3\n")
    with pytest.raises(gp.InputError, match=r"a.txt:1: expected a type and 14 numbers"):
        read_labels(path)


def test_coco_keypoints_are_valid(whole):
    coco = json.loads((whole / "keypoints_coco.json").read_text())
    frames = records(whole)
    assert [image["id"] for image in coco["images"]] == [frame["id"] for frame in frames]
    classes = {c["id"]: c for c in coco["categories"]}
    assert [c["name"] for c in coco["categories"]] == list(CLASSES)
    for c in coco["categories"]:
        assert tuple(c["keypoints"]) == keypoint_names(c["name"])
        joined = {n for pair in c["skeleton"] for n in pair}
        assert joined == set(range(1, len(c["keypoints"]) + 1))
    assert [a["id"] for a in coco["annotations"]] == list(range(1, len(coco["annotations"]) + 1))
    objects = [(f["id"], o) for f in frames for o in f["objects"]]
    for a, (image, item) in zip(coco["annotations"], objects, strict=True):
        assert a["image_id"] == image
        assert classes[a["category_id"]]["name"] == item["model"]
        points = np.array(a["keypoints"]).reshape(-1, 3)
        assert len(points) == len(classes[a["category_id"]]["keypoints"])
        assert set(points[:, 2]) <= {0, 1, 2}
        assert (points[points[:, 2] == 0] == 0).all()
        assert a["num_keypoints"] == np.count_nonzero(points[:, 2])
        assert a["area"] == pytest.approx(a["bbox"][2] * a["bbox"][3], abs=1e-3)
        assert a["iscrowd"] == 0


def test_tilt_table_holds_the_truth(whole):
    with (whole / "tilt.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["frame"]) for row in rows] == list(range(FIRST, FIRST + FRAMES))
    for row in rows:
        truth = scene(scene_seed(SEED, "validation"), int(row["frame"]))
        assert float(row["pitch_deg"]) == pytest.approx(math.degrees(truth.pitch), abs=1e-5)
        assert float(row["camera_height"]) == pytest.approx(truth.height, abs=1e-3)
        R = [float(row[f"R_world_{i}{j}"]) for i in range(3) for j in range(3)]
        np.testing.assert_allclose(R, truth.R_camera_from_world.ravel(), atol=1e-8)


def test_labels_are_the_same_for_any_number_of_jobs(tmp_path, monkeypatch):
    quiet = Settings(seed=12, split="validation", images=None)  # a country road: few bodies to make
    monkeypatch.setitem(workers._BLOCK, False, 3)
    for jobs in (1, 2):
        write_drive(tmp_path / str(jobs), 6, quiet, jobs=jobs)
    assert content(tmp_path / "1") == content(tmp_path / "2")
    assert sum(len(frame["objects"]) for frame in records(tmp_path / "1")) > 0


def test_a_second_run_continues(whole, tmp_path):
    out, told = tmp_path / "out", []
    write_drive(out, 2, SETTINGS)
    write_drive(out, FRAMES, SETTINGS, advance=lambda done, total, objects: told.append((done, total)))
    assert told == [(n, FRAMES) for n in range(2, FRAMES + 1)]
    assert content(out) == content(whole)
    assert write_drive(out, FRAMES, SETTINGS) == 0
    assert content(out) == content(whole)


def test_a_line_cut_short_by_a_crash_is_made_again(whole, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    lines = (whole / "labels.jsonl").read_bytes().splitlines(keepends=True)
    (out / "labels.jsonl").write_bytes(b"".join(lines[:2]) + lines[2][:100])
    (out / "training" / "image_2").mkdir()
    write_drive(out, FRAMES, SETTINGS)
    assert content(out) == content(whole)


class Stop(Exception):
    """Stands for any way a run may end early."""


def test_an_interrupted_run_leaves_whole_frames(whole, tmp_path):
    def stop(done, total, objects):
        if done == 3:
            raise Stop

    out = tmp_path / "out"
    with pytest.raises(Stop):
        write_drive(out, FRAMES, SETTINGS, advance=stop)
    assert [frame["id"] for frame in records(out)] == [FIRST, FIRST + 1, FIRST + 2]
    assert len(list((out / "training" / "label_2").iterdir())) == 3
    assert not (out / "keypoints_coco.json").exists()
    assert not [p for p in out.rglob("*") if p.name.endswith(".part")]


def test_a_full_disk_ends_with_one_line_and_whole_frames(whole, tmp_path, monkeypatch):
    out = tmp_path / "out"
    made = write._replace

    def full(path, pieces):
        if path.name == f"{FIRST + 2:06d}.txt":
            path.with_name(f".{path.name}.part").write_text("half")
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        made(path, pieces)

    monkeypatch.setattr(write, "_replace", full)
    arguments = ("--frames", FRAMES, "--out", out, "--seed", SEED, "--split", "validation", "--first", FIRST)
    result = run(*arguments, "--no-images", "--jobs", 1)
    assert one_line(result).endswith(f"{FIRST + 2:06d}.txt: No space left on device")
    assert [frame["id"] for frame in records(out)] == [FIRST, FIRST + 1]
    monkeypatch.undo()
    assert run(*arguments, "--no-images", "--jobs", 1).exit_code == 0
    assert content(out).keys() >= content(whole).keys()
    assert (out / "labels.jsonl").read_bytes() == (whole / "labels.jsonl").read_bytes()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_file_on_a_full_disk_is_named(tmp_path):
    (tmp_path / ".a.txt.part").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left") as caught:
        write._replace(tmp_path / "a.txt", ["x" * 100_000])
    assert caught.value.filename == str(tmp_path / "a.txt")
    assert not list(tmp_path.iterdir())


def test_half_a_line_is_taken_back(tmp_path, monkeypatch):
    path = tmp_path / "labels.jsonl"
    with write._appending(path) as append:
        append("whole\n")

    class Full:
        def __init__(self, file):
            self.file = file

        def write(self, data):
            self.file.write(data[:2])
            self.file.flush()
            raise OSError(errno.ENOSPC, "No space left on device")

        def __getattr__(self, name):
            return getattr(self.file, name)

    real = Path.open

    def opened(self, mode="r", *a, **k):
        file = real(self, mode, *a, **k)
        return file if mode != "ab" else _Context(Full(file))

    class _Context:
        def __init__(self, file):
            self.file = file

        def __enter__(self):
            return self.file

        def __exit__(self, *_):
            self.file.close()

    monkeypatch.setattr(Path, "open", opened)
    with pytest.raises(OSError, match="No space"), write._appending(path) as append:
        append("another line\n")
    assert path.read_text() == "whole\n"


class _Renderer:
    """Pictures of one colour."""

    def frame(self, made):
        return np.full((1080, 1914, 3), made.number, dtype=np.uint8)


@pytest.mark.parametrize("form", ["png", "jpg"])
def test_pictures_stand_beside_their_labels(tmp_path, monkeypatch, form):
    from PIL import Image

    monkeypatch.setattr(workers, "_renderer", _Renderer)
    out = tmp_path / "out"
    write_drive(out, 2, Settings(seed=SEED, split="validation", first=FIRST, images=form))
    for frame in records(out):
        assert frame["image"] == f"training/image_2/{frame['id']:06d}.{form}"
        with Image.open(out / frame["image"]) as picture:
            assert picture.size == (1914, 1080)
            assert picture.getpixel((5, 5)) == (frame["id"],) * 3
    coco = json.loads((out / "keypoints_coco.json").read_text())
    assert coco["images"][0]["file_name"] == f"{FIRST:06d}.{form}"


def test_mistakes_are_one_line(whole, tmp_path):
    out = tmp_path / "out"
    file = tmp_path / "file"
    file.write_text("x")
    other = tmp_path / "other"
    other.mkdir()
    (other / "notes.txt").write_text("x")
    base = ("--no-images", "--frames", 1)
    assert "is a file; give a folder" in one_line(run(*base, "--out", file))
    assert "a new or empty folder" in one_line(run(*base, "--out", other))
    assert (other / "notes.txt").read_text() == "x"
    assert "Not a directory" in one_line(run(*base, "--out", file / "in"))
    assert "with which the folder was begun" in one_line(run(*base, "--out", whole, "--seed", 1))
    assert "classes car, van_bus" in one_line(run(*base, "--out", out, "--class-fractions", "tram=1"))
    assert "CLASS=FRACTION" in one_line(run(*base, "--out", out, "--class-fractions", "car"))
    assert "a number from 0 for car" in one_line(run(*base, "--out", out, "--class-fractions", "car=-1"))
    assert "at least one above zero" in one_line(run(*base, "--out", out, "--class-fractions", "car=0"))
    # the option's former name
    assert "classes car, van_bus" in one_line(run(*base, "--out", out, "--class-shares", "tram=1"))
    assert not out.exists()
    for bad in (
        ("--frames", 0),
        ("--frames", -3),
        ("--seed", -1),
        ("--first", -1),
        ("--split", "dev"),
        ("--jobs", 0),
    ):
        result = run("--no-images", "--frames", 1, "--out", out, *bad)
        assert result.exit_code == 2
        assert "Traceback" not in result.output
    assert not out.exists()


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs /proc")
def test_a_folder_that_cannot_be_made_is_named():
    assert "/proc/nowhere" in one_line(run("--no-images", "--frames", 1, "--out", "/proc/nowhere"))


def test_settings_are_checked():
    for wrong, text in (
        ({"split": "dev"}, "split: expected"),
        ({"seed": -1}, "seed: expected"),
        ({"first": -1}, "first: expected"),
        ({"images": "gif"}, "format: expected one of png, jpg"),
        ({"shares": {"tram": 1.0}}, "class fractions: expected classes"),
    ):
        with pytest.raises(gp.InputError, match=text):
            Settings(**wrong)
    assert read_fractions("car=1, pickup=0.5") == {"car": 1.0, "pickup": 0.5}


def test_class_fractions_decide_the_traffic():
    shares = {"box_truck": 1.0}
    classes = {v.class_name for v in scene(scene_seed(SEED, "validation"), 0, shares).vehicles}
    assert classes <= {"box_truck"}
