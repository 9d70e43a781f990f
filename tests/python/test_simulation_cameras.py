"""Cameras of the virtual drive: ranges of rigs, masts that stand still, labels from above, options."""

import io
import itertools
import json
import math

import groundpose as gp
import numpy as np
import pytest
from groundpose.calibration import read_kitti_projection
from groundpose.cli.main import app
from groundpose.cli.simulate import read_range, read_size
from groundpose.formats.frames import FrameSource
from groundpose.lab.drive import CAMERA, RIGS, labels, scene, scene_seed
from groundpose.lab.drive.ego import FRAMES_PER_DRIVE
from groundpose.lab.drive.labels import own_body_hides
from groundpose.lab.drive.rigs import MAST, SENSORS, draw_mount, rigs
from groundpose.lab.drive.visibility import Order, look
from groundpose.lab.drive.workers import Settings
from groundpose.lab.drive.write import write_drive
from typer.testing import CliRunner

SEED = scene_seed(5, "validation")
ABOVE = rigs(
    "mast", height=(8.0, 8.0), pitch_deg=(-30.0, -30.0), fov_deg=(70.0, 70.0), image_size=(1280, 720)
)


def from_mast(drives: int = 6, among=ABOVE):
    return [scene(SEED, FRAMES_PER_DRIVE * drive + 7, None, among) for drive in range(drives)]


def test_the_camera_changes_neither_road_nor_traffic():
    """Rigs have a random stream of their own, so drives of moving cameras can be compared."""
    wide = rigs("car", height=(1.2, 1.8), fov_deg=(90.0, 90.0), image_size=(1280, 720))
    for number in range(0, 4 * FRAMES_PER_DRIVE, FRAMES_PER_DRIVE):
        one, other = scene(SEED, number), scene(SEED, number, rigs=wide)
        assert one.camera == CAMERA != other.camera
        assert not one.mount.tilted
        assert len(one.vehicles) == len(other.vehicles) > 0
        for a, b in zip(one.vehicles, other.vehicles, strict=True):
            assert (a.class_name, a.seed, a.look_seed) == (b.class_name, b.seed, b.look_seed)
            np.testing.assert_array_equal(a.t_world, b.t_world)
        assert one.light.sky == other.light.sky


def test_mounts_stay_in_their_ranges():
    rng = np.random.default_rng(0)
    found = [draw_mount(rng, RIGS["mixed"]) for _ in range(2000)]
    heights = np.array([m.height for m in found if m.height is not None])
    pitch, roll = (np.degrees([getattr(m, name) for m in found]) for name in ("pitch", "roll"))
    fov = np.degrees([m.fov for m in found])
    for values, low, high in (
        (heights, 1.0, 12.0),
        (pitch, -45.0, 5.0),
        (roll, -5.0, 5.0),
        (fov, 20.0, 120.0),
    ):
        assert low <= values.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < values.max() <= high
    assert {m.camera.image_size for m in found} == set(SENSORS)
    masts = [m for m in found if m.standing]
    assert 0.1 < len(masts) / len(found) < 0.2
    for m in masts:
        away = m.height / math.tan(-m.pitch)
        assert m.height >= MAST
        assert away <= 80.0 + 1e-6
        assert away >= 8.0 - 1e-6 or math.degrees(m.pitch) == pytest.approx(-45.0)


def test_ranges_of_the_caller_replace_those_of_the_rig():
    among = rigs(
        "car", height=(4.0, 6.0), pitch_deg=(-25.0, -15.0), roll_deg=(1.0, 2.0), fov_deg=(60.0, 60.0)
    )
    for made in from_mast(among=among):
        assert made.mount.standing
        assert 4.0 <= made.height <= 6.0
        assert -25.0 <= math.degrees(made.mount.pitch) <= -15.0
        assert abs(math.degrees(made.pitch - made.mount.pitch)) < 3.0
        assert math.degrees(made.mount.fov) == pytest.approx(60.0)
    low = rigs("car", height=(2.0, 2.5))
    assert not scene(SEED, 0, None, low).mount.standing


def test_a_camera_on_a_mast_does_not_move_but_traffic_does():
    moved = 0
    for drive in range(4):
        a, b = (scene(SEED, FRAMES_PER_DRIVE * drive + n, None, ABOVE) for n in (3, 4))
        np.testing.assert_allclose(a.camera_position, b.camera_position, atol=1e-9)
        assert a.speed == b.speed == 0.0
        places = {v.look_seed: v.t_world for v in a.vehicles if v.state == "moving"}
        moved += sum(
            np.linalg.norm(v.t_world - places[v.look_seed]) > 0.5 for v in b.vehicles if v.look_seed in places
        )
    assert moved > 10


def test_the_ground_and_vehicles_are_seen_from_above():
    seen = 0
    for made in from_mast():
        assert made.pitch == pytest.approx(math.radians(-30.0), abs=math.radians(3.0))
        ray = made.R_camera_from_world.T @ [0.0, 0.0, 1.0]
        ground = made.camera_position + ray * made.height / ray[1]
        y, _ = made.road.surface(ground[0], ground[2])
        assert abs(y[0] - ground[1]) < 2.0  # the optical axis meets the road's surface
        assert 6.0 < np.linalg.norm((ground - made.camera_position)[[0, 2]]) < 25.0
        for label in labels(made):
            seen += label.truncation < 0.3
            roof = label.R @ [0.0, -1.0, 0.0]
            assert roof @ label.t < 0.0  # turned to the camera
    assert seen > 20


def test_labels_from_above_project_exactly():
    checked = 0
    for made in from_mast(4, RIGS["mast"]):
        for label in labels(made):
            points = label.keypoints_3d @ label.R.T + label.t
            front = points[:, 2] > 0.3
            pixels = points[front] @ made.camera.K.T
            np.testing.assert_allclose(pixels[:, :2] / pixels[:, 2:], label.keypoints_2d[front], atol=1e-6)
            width, height = made.camera.image_size
            assert (label.bbox >= 0.0).all()
            assert (label.bbox <= [width - 1, height - 1, width - 1, height - 1]).all()
            checked += 1
    assert checked > 20


def test_the_order_of_vehicles_from_above_is_that_of_their_surfaces():
    right = total = 0
    for made in from_mast(5, RIGS["mast"]):
        views = [s for i, v in enumerate(made.vehicles) if (s := look(made, i, v)) is not None]
        order = Order(made, views) if views else None
        for a, b in itertools.permutations(views, 2):
            front = b.target.depth > 1.0
            near = (b.target.pixels >= a.box[:2]) & (b.target.pixels <= a.box[2:])
            front = np.flatnonzero(front & near.all(axis=1))[::40]
            hidden = own_body_hides(a.target, b.target.pixels[front], b.target.depth[front])
            if np.count_nonzero(hidden) > 3:
                right += order.before(a, b)
                total += 1
    assert total > 20
    assert right / total > 0.98


def test_files_hold_the_camera_of_their_frame(tmp_path):
    settings = Settings(seed=5, split="validation", first=19, images=None, rig="mixed", height=(4.0, 9.0))
    write_drive(tmp_path, 3, settings)
    text = (tmp_path / "labels.jsonl").read_bytes()
    lines = [json.loads(line) for line in text.splitlines()]
    frames = FrameSource(io.BytesIO(text), "labels.jsonl", tmp_path)
    sizes = set()
    for line, frame in zip(lines, frames, strict=True):
        assert not isinstance(frame, gp.InputError)
        made = scene(SEED, line["id"], None, settings.rigs)
        assert frame.view.camera == made.camera
        assert math.degrees(frame.view.pitch) == pytest.approx(math.degrees(made.mount.pitch), abs=1e-5)
        P = read_kitti_projection(tmp_path / "training" / "calib" / f"{line['id']:06d}.txt", "P2")
        np.testing.assert_allclose(P[:, :3], made.camera.K, atol=1e-3)
        sizes.add((tuple(line["camera"]["image_size"]), line["camera"]["fx"]))
    assert len(sizes) == 2  # two drives


def run(*arguments: object):
    return CliRunner().invoke(app, ["simulate", "--no-images", *map(str, arguments)])


def test_the_command_line_takes_ranges_and_a_folder_keeps_its_camera(tmp_path):
    out = tmp_path / "out"
    camera = ("--camera-height", "6..8", "--pitch-deg", "-35..-20", "--roll-deg", 1, "--fov-deg", 60)
    command = ("--frames", 1, "--out", out, "--jobs", 1, *camera)
    assert run(*command, "--image-size", "640x480").exit_code == 0
    line = json.loads((out / "labels.jsonl").read_text())
    assert line["camera"]["image_size"] == [640, 480]
    assert 6.0 <= line["_tilt"]["camera_height"] <= 8.0
    assert -35.0 <= line["pitch_deg"] <= -20.0
    assert line["roll_deg"] == 1.0
    assert run(*command, "--image-size", "640x480").exit_code == 0
    other = run(*command, "--image-size", "1280x720")
    assert other.exit_code == 2
    assert "image_size [640, 480], with which the folder was begun" in other.stderr
    assert "rig" in run("--frames", 1, "--out", out, "--rig", "mast").stderr


def test_a_folder_older_than_rigs_is_continued(tmp_path):
    write_drive(tmp_path, 1, Settings(seed=5, images=None))
    path = tmp_path / "drive.json"
    old = json.loads(path.read_text())
    for name in ("rig", "height", "pitch_deg", "roll_deg", "fov_deg", "image_size"):
        del old[name]
    path.write_text(json.dumps(old))
    write_drive(tmp_path, 2, Settings(seed=5, images=None))
    with pytest.raises(gp.InputError, match="rig 'car', with which the folder was begun"):
        write_drive(tmp_path, 3, Settings(seed=5, images=None, rig="mast"))


@pytest.mark.parametrize(
    ("option", "value", "text"),
    [
        ("--camera-height", "8..3", "height: expected a range within 0.3..30"),
        ("--camera-height", "high", "--camera-height: expected LOW..HIGH or one VALUE"),
        ("--pitch-deg", "-90", "pitch_deg: expected a range"),
        ("--fov-deg", "nan", "fov_deg: expected"),
        ("--image-size", "640", "--image-size: expected WIDTHxHEIGHT"),
        ("--image-size", "8x8", "image_size: expected sides from 64"),
        ("--rig", "drone", "rig: expected one of car"),
    ],
)
def test_mistakes_are_one_line(tmp_path, option, value, text):
    result = run("--frames", 1, "--out", tmp_path / "out", option, value)
    assert result.exit_code == 2
    assert text in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_ranges_and_sizes_are_read():
    assert read_range("--x", "-30..-10") == (-30.0, -10.0)
    assert read_range("--x", "8") == (8.0, 8.0)
    assert read_range("--x", None) is None
    assert read_size("1280x720") == (1280, 720)
