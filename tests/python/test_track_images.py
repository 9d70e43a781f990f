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
from PIL import Image
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
        self.count, call = 0, gp.Pipeline.solve

        def counted(pipeline, *args, **more):
            if self.count == last:
                raise KeyboardInterrupt
            self.count += 1
            return call(pipeline, *args, **more)

        monkeypatch.setattr(gp.Pipeline, "solve", counted)


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
call, count = gp.Pipeline.solve, [0]
def counted(*args, **more):
    count[0] += 1
    if count[0] > 11:
        os._exit(9)
    return call(*args, **more)
gp.Pipeline.solve = counted
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


def film_of(path):
    av = pytest.importorskip("av")
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        return [
            (float(frame.pts * stream.time_base), frame.to_ndarray(format="rgb24"))
            for frame in film.decode(video=0)
        ]


def test_a_film_has_the_drawn_frames_at_their_times(street, network):
    pytest.importorskip("av")
    given, film = inputs(street, network), street / "tracks.mp4"
    (street / "boxes" / "000007.json").write_text("{")
    result = run(*given, "-o", street / "t.csv", "--draw", film)
    assert result.exit_code == 1, result.output
    result = run(*given, "-o", street / "t.csv", "--draw", street / "drawn" / "{id}.png")
    assert result.exit_code == 1
    frames = film_of(film)
    numbers = [k for k in range(FRAMES) if k != 7]
    assert [time for time, _ in frames] == pytest.approx([0.1 * k for k in numbers], abs=2e-3)
    with Image.open(street / "drawn" / f"{FRAMES - 1:06d}.png") as last:
        drawn = np.asarray(last.convert("RGB")).astype(float)
    assert frames[-1][1].shape == drawn.shape
    assert np.abs(frames[-1][1] - drawn).mean() < 12.0
    plain = np.asarray(picture_of(street, FRAMES - 1)).astype(float)
    assert (np.abs(drawn - plain).max(axis=2) > 60.0).sum() > 300, "a box is drawn"
    assert np.abs(frames[-1][1] - drawn)[np.abs(drawn - plain).max(axis=2) > 60.0].mean() < 60.0


def test_a_film_is_whole_or_not_there(street, network, monkeypatch):
    pytest.importorskip("av")
    film = street / "tracks.mp4"
    film.write_bytes(b"of before")
    (street / "camera.json").write_text(json.dumps({**CALIBRATION, "image_size": [10, 10]}))
    result = run(*inputs(street, network), "-o", street / "t.csv", "--draw", film)
    assert result.exit_code == 2, "no frame can be used"
    assert film.read_bytes() == b"of before"
    assert hidden(street) == []
    (street / "camera.json").write_text(json.dumps({**CALIBRATION, "camera_height": 1.6}))
    with monkeypatch.context() as patch:
        Counting(patch, last=9)
        assert run(*inputs(street, network), "-o", street / "t.csv", "--draw", film).exit_code == 130
    assert len(film_of(film)) == 9, "what was drawn so far"
    result = run(*inputs(street, network), "-o", street / "t.csv", "--draw", film)
    assert result.exit_code == 0, result.output
    assert len(film_of(film)) == FRAMES, "the frames of before are drawn too"


def test_images_are_never_drawn_over(street, network):
    before = (street / "pictures" / "000003.png").read_bytes()
    result = run(*inputs(street, network), "-o", street / "t.csv", "--draw", street / "pictures" / "{id}.png")
    assert result.exit_code == 1
    assert "--draw: expected a name that is not the image's" in " ".join(result.output.split())
    assert (street / "pictures" / "000003.png").read_bytes() == before
    result = run(*inputs(street, network), "-o", street / "t.csv", "--draw", street / "a.mov")
    assert result.exit_code == 2
    assert "--draw: expected a name that ends in .png, .jpg or .mp4" in " ".join(result.output.split())


def test_a_map_of_many_vehicles_is_bounded(tmp_path):
    from groundpose.draw.track_map import TrackMap
    from test_traffic import straight

    drawn = TrackMap(tmp_path / "map.png")
    for number in range(1200):
        for part in range(2):
            drawn.add(straight(number, 1.0, 4.0 * part, 1.0, begin=4.0 * part), 0)
    assert len(drawn._ways) == 1000
    way = drawn._ways[1199]
    assert len(way) < 20
    assert (way[0, 1], way[-1, 1]) == pytest.approx((0.0, 7.9))
    assert np.diff(way[:, 1]).max() < 0.71
