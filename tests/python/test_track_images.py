"""`groundpose track` of images: the profile whole, what an interrupted run keeps, films, recordings."""

import json
import subprocess
import sys

import groundpose as gp
import numpy as np
import pytest
import stand_in
from groundpose._writing import only_writer
from groundpose.camera_profile import CameraProfile
from groundpose.cli.box_choice import BoxChoice
from groundpose.cli.known_camera import KnownCamera
from groundpose.cli.main import app
from groundpose.cli.track import track_frames
from test_cli_images import BOX, CALIBRATION, SIZE, VIEW, car_places, picture
from typer.testing import CliRunner

FRAMES = 24


def run(*arguments):
    return CliRunner().invoke(app, ["track", *map(str, arguments)])


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    """Sees a car in whatever box."""
    return stand_in.write(tmp_path_factory.mktemp("network") / "car.onnx", 0, car_places())


@pytest.fixture
def street(tmp_path):
    """Pictures in which a box comes nearer."""
    (tmp_path / "boxes").mkdir()
    for k in range(FRAMES):
        picture(tmp_path / "pictures" / f"{k:06d}.png")
        scale = 1.0 + 0.01 * k
        middle, half = 0.5 * (BOX[:2] + BOX[2:]), 0.5 * scale * (BOX[2:] - BOX[:2])
        box = np.concatenate([middle - half, middle + half]).round(2).tolist()
        (tmp_path / "boxes" / f"{k:06d}.json").write_text(json.dumps([box]))
    (tmp_path / "camera.json").write_text(json.dumps({**CALIBRATION, "camera_height": 1.6}))
    return tmp_path


def inputs(street, network, camera="camera.json"):
    return (
        *(street / "pictures", "--boxes", street / "boxes", "--camera", street / camera),
        *("--network", network, "--fps", 10),
    )


def save_profile(path):
    covariance = np.diag([0.01, 0.02, 0.03]) ** 2
    profile = CameraProfile(VIEW, covariance, class_scales={"car": (0.2, 0.01)})
    profile.save(path)
    return profile


def test_poses_of_images_use_all_of_a_profile(street, network):
    profile = save_profile(street / "profile.json")
    known = KnownCamera.read(street / "profile.json", None)
    assert known.view == profile.view
    frame = known.mounting.arguments(known.view)["frame"]
    assert (frame.pitch_sigma, frame.roll_sigma, frame.height_sigma) == pytest.approx((0.01, 0.02, 0.03))
    boxes = BoxChoice(street / "boxes", None, None)
    with track_frames(street / "pictures", known, street / "profile.json", boxes, network) as frames:
        seen = [found.seen for found in frames]
    pipeline = gp.Pipeline(network)
    box = json.loads((street / "boxes" / "000003.json").read_text())
    pixels = np.asarray(picture_of(street, 3))
    poses = pipeline(pixels, box, profile.view, frame=profile.priors())
    assert np.array_equal(seen[3].t, poses.t)
    assert np.array_equal(seen[3].size, gp.SeenVehicles.of(poses).size)
    other = pipeline(pixels, box, profile.view, frame=gp.FramePriors())
    assert abs(np.linalg.norm(other.t) / np.linalg.norm(poses.t) - 1.0) > 0.01, "sizes count"


def picture_of(street, number):
    from PIL import Image

    with Image.open(street / "pictures" / f"{number:06d}.png") as image:
        return image.convert("RGB")


def test_a_profile_says_the_height(street, network):
    save_profile(street / "profile.json")
    result = run(*inputs(street, network, "profile.json"), "-o", street / "t.csv", "--height", 2)
    assert result.exit_code == 2
    assert "--camera: a profile says camera, tilt and height; leave out --height" in result.output
    assert run(*inputs(street, network, "profile.json"), "-o", street / "t.csv").exit_code == 0


def test_a_camera_file_may_leave_the_size_to_the_pictures(street, network):
    assert "image_size" not in CALIBRATION
    result = run(*inputs(street, network), "-o", street / "t.csv")
    assert result.exit_code == 0, result.output
    assert len((street / "t.csv").read_text().splitlines()) == FRAMES + 1


def test_pictures_of_another_size_are_left_out(street, network):
    camera = {**CALIBRATION, "image_size": list(SIZE)}
    (street / "camera.json").write_text(json.dumps(camera))
    picture(street / "pictures" / "000005.png", (SIZE[0] + 2, SIZE[1]))
    result = run(*inputs(street, network), "-o", street / "t.csv")
    assert result.exit_code == 1
    assert "000005.png: image: expected the camera's size (640, 300)" in " ".join(result.output.split())
    assert len((street / "t.csv").read_text().splitlines()) > FRAMES - 3


def test_poses_of_another_camera_are_refused(tmp_path):
    from test_tracks import line

    camera, poses = tmp_path / "camera.json", tmp_path / "poses.jsonl"
    camera.write_text(json.dumps({"fx": 1000, "fy": 1000, "cx": 640, "cy": 360, "image_size": [1280, 720]}))
    same = {"fx": 1010, "fy": 1010, "cx": 640, "cy": 360, "image_size": [1280, 720]}
    wrong = [{**same, "fx": 700}, {**same, "image_size": [640, 480]}]
    given = [*(line(k, [[0.0, 20.0]], [0.0], time=0.1 * k, camera=same) for k in range(5))]
    given += [line(9, [], [], time=0.9, camera=other) for other in wrong]
    poses.write_text("\n".join(given))
    result = run(poses, "--camera", camera, "-o", tmp_path / "t.csv")
    assert result.exit_code == 1
    said = " ".join(result.output.split())
    assert "poses.jsonl:6: camera.fx: expected that of the camera that is given, 1000 within 5 %" in said
    assert "poses.jsonl:7: camera.image_size: expected that of the camera that is given, (1280, 720)" in said


class Counting:
    """Counts the images that a pipeline looks at; at `last` it is interrupted."""

    def __init__(self, monkeypatch, last=None):
        self.count, call = 0, gp.Pipeline.__call__

        def counted(pipeline, *args, **more):
            if self.count == last:
                raise KeyboardInterrupt
            self.count += 1
            return call(pipeline, *args, **more)

        monkeypatch.setattr(gp.Pipeline, "__call__", counted)


def hidden(folder):
    return sorted(path.name for path in folder.iterdir() if path.name.startswith("."))


def test_an_interrupted_run_goes_on_to_the_same_rows(street, network, monkeypatch):
    whole, out = street / "whole.csv", street / "tracks.csv"
    given = inputs(street, network)
    assert run(*given, "-o", whole).exit_code == 0
    assert hidden(street) == []
    with monkeypatch.context() as patch:
        Counting(patch, last=9)
        result = run(*given, "-o", out)
    assert result.exit_code == 130
    assert "frames followed: 9; the same command goes on" in result.output
    assert len(out.read_text().splitlines()) == 10, "what was found so far"
    with monkeypatch.context() as patch:
        counting = Counting(patch, last=5)
        assert run(*given, "-o", out).exit_code == 130
        assert counting.count == 5
    with monkeypatch.context() as patch:
        counting = Counting(patch)
        result = run(*given, "-o", out)
    assert result.exit_code == 0, result.output
    assert "going on: the poses of 14 images are there" in result.output
    assert counting.count == FRAMES - 14
    assert out.read_bytes() == whole.read_bytes()
    assert hidden(street) == []


def test_a_killed_run_goes_on_to_the_same_rows(street, network):
    whole, out = street / "whole.csv", street / "tracks.csv"
    given = [*map(str, inputs(street, network)), "-o"]
    assert run(*given, whole).exit_code == 0
    killed = f"""
import os, groundpose as gp
call, count = gp.Pipeline.__call__, [0]
def counted(*args, **more):
    count[0] += 1
    if count[0] > 11:
        os._exit(9)
    return call(*args, **more)
gp.Pipeline.__call__ = counted
from groundpose.cli.main import app
app({["track", *given, str(out)]!r})
"""
    assert subprocess.run([sys.executable, "-c", killed], check=False, capture_output=True).returncode == 9
    assert not out.exists()
    result = run(*given, out)
    assert result.exit_code == 0, result.output
    assert "going on: the poses of 11 images are there" in result.output
    assert out.read_bytes() == whole.read_bytes()
    assert hidden(street) == []


def test_poses_of_another_command_are_not_gone_on_with(street, network, monkeypatch):
    out = street / "tracks.csv"
    with monkeypatch.context() as patch:
        Counting(patch, last=9)
        assert run(*inputs(street, network), "-o", out).exit_code == 130
    counting = Counting(monkeypatch)
    result = run(*inputs(street, network), "-o", out, "--height", 2)
    assert result.exit_code == 0, result.output
    assert "begun anew" in result.output
    assert counting.count == FRAMES
    assert hidden(street) == []


def test_one_run_writes_a_file(street, network):
    out = street / "tracks.csv"
    with only_writer(out):
        result = run(*inputs(street, network), "-o", out)
    assert result.exit_code == 2
    assert "expected no other run that writes there" in result.output
    assert run(*inputs(street, network), "-o", "/dev/null", "--format", "csv").exit_code == 0
