"""ApolloCar3D as it unpacks, and the tilt of frames on it."""

import json
import math
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose.cli.main import app
from groundpose.formats.apollo import CAMERAS, OURS_FROM_APOLLO, ApolloSet, read_keypoints, rotation
from groundpose.formats.kitti.dataset import KittiSet
from groundpose.formats.kitti.table import KittiTable
from groundpose.formats.skips import Skips
from groundpose.lab.contenders.libraries import POSELIB_TUNED, Library
from groundpose.lab.contenders.own import DEFAULT
from groundpose.lab.contenders.registry import contenders
from groundpose.lab.contenders.use import at_threshold
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate import real
from groundpose.lab.evaluate.kitti.bench import make_folder
from groundpose.lab.evaluate.kitti.keypoints import Simulated
from groundpose.lab.evaluate.kitti.objects import cars_of
from groundpose.lab.evaluate.real_data import RealObjects, apollo, apollo_images, apollo_library
from groundpose.lab.evaluate.tilt import table, ways
from typer.testing import CliRunner

NAME = "180114_025326632_Camera_5"
LIBRARY = np.random.default_rng(0).uniform([-0.9, -1.5, -2.2], [0.9, 0.0, 2.2], (12, 66, 3))


def folder_with(name: str) -> Path:
    folder = data_folder()
    if not (folder / name).exists():
        pytest.skip(f"{name} is not in {folder} (GROUNDPOSE_DATA)")
    return folder


def pose(car_id: int, x: float, z: float, yaw: float) -> dict:
    """A line of car_poses: `Rz(third) Ry(second) Rx(first)` of a car whose model has y up."""
    return {"car_id": car_id, "area": 1, "pose": [0.15, yaw, math.pi, x, 2.0, z], "visible_rate": 1.0}


def write_image(root: Path, poses: list[dict], name: str = NAME, noise: float = 0.0) -> None:
    """Poses and keypoints of the set, in the order of the poses turned round."""
    camera = CAMERAS["Camera_5"]
    (root / "car_poses").mkdir(parents=True, exist_ok=True)
    (root / "car_poses" / f"{name}.json").write_text(json.dumps(poses))
    folder = root / "keypoints" / name
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(1)
    for k, row in enumerate(reversed(poses)):
        values = row["pose"]
        R = rotation(*values[:3]) @ OURS_FROM_APOLLO.T
        points = (LIBRARY[row["car_id"]] @ R.T + values[3:]) @ camera.K.T
        pixels = points[:, :2] / points[:, 2:] + noise * rng.normal(size=(66, 2))
        lines = [f"{i}\t{u:.3f}\t{v:.3f}\n" for i, (u, v) in enumerate(pixels) if i % 3]
        (folder / f"{name}_{k}.txt").write_text("".join(lines))


POSES = [pose(0, -3.0, 15.0, 0.3), pose(2, 4.0, 22.0, 2.0), pose(1, 0.0, 40.0, -1.0)]


def test_keypoints_find_their_poses(tmp_path):
    write_image(tmp_path, POSES, noise=2.0)
    skipped = Skips()
    image = ApolloSet(tmp_path, LIBRARY).read(NAME, skipped)
    assert skipped.total == 0
    assert [car.car_id for car in image.cars] == [1, 2, 0]
    assert image.camera is CAMERAS["Camera_5"]
    for car in image.cars:
        left, top, right, bottom = car.bbox
        inside = car.keypoints_2d[np.isfinite(car.keypoints_2d[:, 0])]
        assert (inside > [left, top]).all()
        assert (inside < [right, bottom]).all()
        assert np.isnan(car.keypoints_2d[0]).all()


def test_the_public_angles_are_those_of_the_development_cars():
    folder = folder_with("apollo_cars_dev.npz")
    with np.load(folder / "apollo_cars_dev.npz") as data:
        for values, R in zip(data["pose"], data["R"], strict=True):
            np.testing.assert_allclose(rotation(*values[:3]), R, atol=1e-9)
        np.testing.assert_allclose(CAMERAS["Camera_5"].K, data["K"], rtol=1e-6)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda root: (root / "car_poses" / f"{NAME}.json").unlink(), "image without readable poses"),
        (lambda root: (root / "car_poses" / f"{NAME}.json").write_text("[{"), "image with bad poses"),
        (
            lambda root: (root / "car_poses" / f"{NAME}.json").write_text('[{"car_id": 99, "pose": []}]'),
            "image with bad poses",
        ),
        (
            lambda root: (root / "keypoints" / NAME / f"{NAME}_0.txt").write_text("1\t5\n"),
            "bad file of keypoints",
        ),
        (
            lambda root: (root / "keypoints" / NAME / f"{NAME}_0.txt").write_text("70\t5\t5\n"),
            "bad file of keypoints",
        ),
        (lambda root: (root / "keypoints" / NAME / f"{NAME}_0.txt").write_text(""), "bad file of keypoints"),
        (
            lambda root: (root / "keypoints" / NAME / f"{NAME}_0.txt").write_text("1\t5\t5\n2\t9\t9\n"),
            "keypoints that fit no pose",
        ),
    ],
)
def test_what_cannot_be_used_is_counted(tmp_path, damage, reason):
    write_image(tmp_path, POSES)
    damage(tmp_path)
    skipped = Skips()
    image = ApolloSet(tmp_path, LIBRARY).read(NAME, skipped)
    assert skipped.counts == {reason: 1}
    assert NAME in skipped.places[reason][0]
    assert image is None or len(image.cars) == 2


def test_other_folders_models_and_cameras_are_refused(tmp_path):
    with pytest.raises(gp.InputError, match="car_poses"):
        ApolloSet(tmp_path, LIBRARY)
    write_image(tmp_path, POSES)
    with pytest.raises(gp.InputError, match="models"):
        ApolloSet(tmp_path, LIBRARY[:, :5])
    skipped = Skips()
    assert ApolloSet(tmp_path, LIBRARY).read("a_Camera_9", skipped) is None
    assert skipped.counts == {"image of an unknown camera": 1}
    (tmp_path / "a.txt").write_text("1 2 3\n1 2\n")
    with pytest.raises(gp.InputError, match=r"a.txt:2: expected number, u, v"):
        read_keypoints(tmp_path / "a.txt")


def test_the_command_on_the_public_layout(tmp_path, monkeypatch):
    ours = tuple(one for one in contenders("real") if not isinstance(one, Library))
    monkeypatch.setattr(real, "contenders", lambda where: ours)  # libraries take their time
    monkeypatch.setattr(real, "kinder", lambda scored: ())
    for k in range(4):
        write_image(tmp_path, POSES, f"18_{k}_Camera_5", noise=3.0)
    (tmp_path / "car_poses" / "18_9_Camera_5.json").write_text("{")
    np.savez(tmp_path / "models.npz", keypoints_3d=LIBRARY @ OURS_FROM_APOLLO)
    split = tmp_path / "split.txt"
    split.write_text("".join(f"18_{k}_Camera_5.jpg\n" for k in (0, 1, 9)))
    given = ["--root", tmp_path, "--models", tmp_path / "models.npz", "--split", split]
    out = tmp_path / "out.json"
    library = apollo_library(tmp_path / "models.npz")
    np.testing.assert_allclose(library, LIBRARY)
    folder = ApolloSet(tmp_path, library)
    objects = apollo_images([folder.read(name, Skips()) for name in folder.ids()[:2]], library, True)
    assert [len(each) for each in objects] == [6]
    lines = table(objects[0], ways(8.9, 1.6, -8.9))
    assert lines[0]["median e_r deg"] < 2.0
    refused = CliRunner().invoke(app, ["evaluate", "apollo", "--root", str(tmp_path)])
    assert refused.exit_code == 2
    result = CliRunner().invoke(app, ["evaluate", "apollo", *map(str, given), "-o", str(out)])
    assert result.exit_code == 0, result.output
    assert "left out: 1 x image with bad poses" in result.output
    content = json.loads(out.read_text())
    assert [group["objects"] for group in content["sets"]] == [6, 6]
    assert content["sets"][0]["methods"][0]["median e_r deg"] < 2.0


def test_a_frames_tilt_is_worth_its_time_on_real_roads():
    objects = apollo(folder_with("apollo_cars_dev.npz"), known_model=True)
    lines = {row["tilt"]: row for row in table(objects, ways(8.9, 1.6, -8.9))}
    fixed, estimated = lines["wrong by -8.9 deg, fixed"], lines["wrong by -8.9 deg, then the frame's"]
    assert estimated["median e_r deg"] < 0.8 * fixed["median e_r deg"]
    assert estimated["above 15 deg %"] < fixed["above 15 deg %"]
    assert estimated["median tilt error of an image deg"] < 2.5 < fixed["median tilt error of an image deg"]
    known = lines["the set's mean, fixed"]
    assert estimated["median e_r deg"] < 1.1 * known["median e_r deg"]


def test_ours_is_at_or_below_poselib_on_the_development_cars():
    if reason := POSELIB_TUNED.missing():
        pytest.skip(reason)
    folder = folder_with("apollo_cars_dev.npz")
    for known in (True, False):
        objects = apollo(folder, known)
        ours = real.line_of(objects, DEFAULT)
        for factor in (1.0, 4.0):
            theirs = real.line_of(objects, at_threshold(POSELIB_TUNED, factor))
            assert ours["median e_r deg"] < theirs["median e_r deg"]
            assert ours["above 15 deg %"] < theirs["above 15 deg %"]


def test_tilt_needs_to_know_the_images():
    objects = RealObjects(
        name="x",
        view=gp.View(CAMERAS["Camera_5"]),
        keypoints_2d=np.zeros((1, 66, 2)),
        keypoint_scores=None,
        bboxes=np.zeros((1, 4)),
        inlier_threshold=np.ones(1),
        models=[gp.ShapeModel(LIBRARY[0])],
        R=np.eye(3)[None],
        t=np.zeros((1, 3)),
        scale_known=True,
    )
    with pytest.raises(ValueError, match="the image of each object"):
        table(objects, ways(0.0, 1.0, 2.0))


def test_cars_of_frames_are_one_set(tmp_path):
    make_folder(tmp_path, 15)
    objects = cars_of(KittiSet(tmp_path), Simulated(models="sized"), "labels", Skips())
    assert len(objects) > 30
    assert len(set(objects.frames)) > 8
    lines = table(objects, ways(0.0, 0.7, 4.0))
    fixed, estimated = (lines[k]["median e_r deg"] for k in (4, 6))
    assert lines[0]["median e_r deg"] < estimated < fixed


def test_a_table_of_vehicles_is_read_like_a_folder(tmp_path):
    folder = KittiTable(folder_with("kitti_vehicles_dev.npz") / "kitti_vehicles_dev.npz", True)
    skipped = Skips()
    ids = folder.ids()
    frames = [folder.read(name, skipped) for name in ids[:50]]
    assert len(ids) > 500
    assert skipped.total == 0
    assert sum(len(frame.labels) for frame in frames) > 100
    assert frames[0].image_size == (1242, 375)
    for frame in frames:
        boxes = [label.bbox for label in frame.labels]
        for found in frame.detections:
            assert min(np.abs(np.subtract(found.bbox, box)).max() for box in boxes) < 60.0
    split = tmp_path / "split.txt"
    split.write_text("01\n")
    assert {name[:2] for name in folder.ids(split)} == {"01"}
    assert folder.read("09/000000", skipped) is None
    np.savez(tmp_path / "a.npz", rows=np.zeros((1, 1)))
    with pytest.raises(gp.InputError, match="arrays rows, cols"):
        KittiTable(tmp_path / "a.npz").ids()


def test_the_command_for_tilt(tmp_path):
    folder_with("kitti_vehicles_dev.npz")
    out = tmp_path / "tilt.json"
    result = CliRunner().invoke(app, ["evaluate", "tilt", "--limit", "40", "-o", str(out)])
    assert result.exit_code == 0, result.output
    content = json.loads(out.read_text())
    assert content["command"].startswith("groundpose")
    assert [len(group["tilt"]) for group in content["sets"]] == [8] * len(content["sets"])
    missing = CliRunner().invoke(app, ["evaluate", "tilt", "--data", str(tmp_path)])
    assert missing.exit_code == 2
    assert "Traceback" not in missing.output
