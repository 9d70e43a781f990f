"""The drive as video: nobody passes through anybody or slides; labels agree with the motion."""

import csv
import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from groundpose.cli.main import app
from groundpose.formats.kitti.labels import read_tracking
from groundpose.lab.drive import labels, scene_seed
from groundpose.lab.drive.body_cache import measures
from groundpose.lab.drive.footprints import Footprints, overlapping, touching
from groundpose.lab.drive.rigs import rigs
from groundpose.lab.drive.traffic import DEFAULT_SHARES
from groundpose.lab.drive.video.clip import make_clip, video_frame
from groundpose.lab.drive.video.film import write_film
from groundpose.lab.drive.video.mover import Driver
from groundpose.lab.drive.workers import Settings
from groundpose.lab.drive.write import write_drive
from PIL import Image
from typer.testing import CliRunner

FPS = 10.0
SHARES = tuple(DEFAULT_SHARES.items())
FRAMES = 5
SETTINGS = Settings(3, "validation", images=None, rig="mast", fps=5.0, frames=FRAMES)


@cache
def made(seed, rig, frames=120, fps=FPS):
    return make_clip(scene_seed(seed, "validation"), frames, fps, SHARES, rigs(rig))


@pytest.fixture(scope="module", params=[(0, "mast"), (1, "car")], ids=["mast", "car"])
def clip(request):
    return made(*request.param)


def tracks(clip):
    """Rows (frame, x, z, heading, speed, acceleration, yaw rate, steering) of each track."""
    found = {}
    for frame, moment in enumerate(clip.moments):
        columns = (moment.heading, moment.speed, moment.acceleration, moment.yaw_rate, moment.steering)
        for i, track in enumerate(moment.track.tolist()):
            found.setdefault(track, []).append((frame, *moment.place[i], *(c[i] for c in columns)))
    return {track: np.array(rows) for track, rows in found.items()}


def test_vehicles_never_touch(clip):
    parked = clip.parked.footprints()
    for moment in clip.moments:
        boxes = np.array([clip.chassis[t].box for t in moment.track.tolist()])
        moving = Footprints.of(moment.place, moment.heading, boxes)
        assert not overlapping(moving).any()
        assert parked is None or not overlapping(moving, parked).any()
    assert parked is None or not overlapping(parked).any()


def test_rear_wheels_never_slide(clip):
    """The rear axle moves along the heading; in curves, stops and changes of lanes."""
    turned = 0.0
    for track, rows in tracks(clip).items():
        chassis = clip.chassis[track]
        heading = np.unwrap(rows[:, 3])
        forward = np.stack([np.sin(heading), np.cos(heading)], axis=1)
        rear = rows[:, 1:3] + chassis.rear * forward
        moved = np.diff(rear, axis=0)
        middle = 0.5 * (heading[1:] + heading[:-1])
        along = moved[:, 0] * np.sin(middle) + moved[:, 1] * np.cos(middle)
        across = moved[:, 0] * np.cos(middle) - moved[:, 1] * np.sin(middle)
        assert np.abs(across).max(initial=0.0) < 0.02
        assert along.min(initial=0.0) > -0.01
        turned = max(turned, np.ptp(heading))
    assert turned > 0.02


def test_speeds_and_yaw_rates_are_those_of_the_motion(clip):
    for rows in tracks(clip).values():
        heading = np.unwrap(rows[:, 3])
        middle = 0.5 * (heading[1:] + heading[:-1])
        moved = np.diff(rows[:, 1:3], axis=0)
        along = (moved[:, 0] * np.sin(middle) + moved[:, 1] * np.cos(middle)) * FPS
        np.testing.assert_allclose(along, 0.5 * (rows[1:, 4] + rows[:-1, 4]), atol=0.12)
        rate = np.diff(heading) * FPS
        np.testing.assert_allclose(rate, 0.5 * (rows[1:, 6] + rows[:-1, 6]), atol=0.05)
        assert np.abs(np.diff(rows[:, 4])).max(initial=0.0) * FPS < 9.0


def test_tracks_have_no_gaps(clip):
    for rows in tracks(clip).values():
        assert (np.diff(rows[:, 0]) == 1).all()


def test_vehicles_stop_turn_and_follow():
    clip = made(0, "mast")
    rows = tracks(clip)
    assert any((r[:, 4] > 3.0).any() and (r[:, 4] < 0.1).any() for r in rows.values())
    assert {"moving", "turning", "crossing"} <= {s for m in clip.moments for s in m.state}
    assert max(np.ptp(np.unwrap(r[:, 3])) for r in rows.values()) > math.radians(60)


def test_scenes_have_the_motion_of_their_vehicles(clip):
    frame = video_frame(clip, 50)
    assert len(frame.track) == len(set(frame.track.tolist())) == len(frame.scene.vehicles)
    moment = clip.moments[50]
    for track, vehicle, speed, heading in zip(
        frame.track.tolist(), frame.scene.vehicles, frame.speed, frame.heading, strict=True
    ):
        at = np.flatnonzero(moment.track == track)
        place = moment.place[at[0]] if len(at) else clip.parked.place[clip.parked.track == track][0]
        np.testing.assert_allclose(vehicle.t_world[[0, 2]], place)
        assert speed == (moment.speed[at[0]] if len(at) else 0.0)
        forward = vehicle.R_world[:, 2]
        assert abs(math.remainder(math.atan2(forward[0], forward[2]) - heading, 2 * math.pi)) < 0.01
        assert measures(vehicle.class_name, vehicle.seed).size[0] > 2.0
    assert labels(frame.scene)


def test_odometry_is_the_motion_of_the_camera():
    clip = made(1, "car")
    poses = [video_frame(clip, k).scene for k in range(20, 40)]
    x, z = np.array([p.camera_position[[0, 2]] for p in poses]).T
    moved = np.hypot(np.diff(x), np.diff(z)) * FPS
    speeds = np.array([p.speed for p in poses])
    np.testing.assert_allclose(moved, 0.5 * (speeds[1:] + speeds[:-1]), rtol=0.03, atol=0.1)


def test_the_camera_of_a_mast_does_not_move():
    clip = made(0, "mast")
    assert clip.own is None
    places = np.array([video_frame(clip, k).scene.camera_position for k in (0, 60, 119)])
    assert np.ptp(places, axis=0).max() < 1e-9


def test_same_arguments_same_video():
    a = made(0, "mast", 15)
    make_clip.cache_clear()
    b = make_clip.__wrapped__(scene_seed(0, "validation"), 15, FPS, SHARES, rigs("mast"))
    for one, other in zip(a.moments, b.moments, strict=True):
        assert (one.track == other.track).all()
        assert (one.place == other.place).all()
    other = made(1, "car").moments[0]
    assert other.place.shape != a.moments[0].place.shape or (other.place != a.moments[0].place).any()


def test_touching_is_overlapping_row_by_row():
    rng = np.random.default_rng(0)
    box = np.stack([-rng.uniform(0.5, 2, (60, 2)), rng.uniform(0.5, 2, (60, 2))], axis=1)
    a = Footprints.of(rng.uniform(-4, 4, (60, 2)), rng.uniform(-4, 4, 60), box)
    b = a[rng.permutation(60)]
    np.testing.assert_array_equal(touching(a, b), np.diag(overlapping(a, b)))


def test_drivers_keep_their_distance():
    driver = Driver(15.0, 1.5, 2.0, 1.5, 2.0)
    v, gap, slowest = 15.0, 80.0, 0.0
    for _ in range(600):
        a = driver.behind(v, gap, 0.0)
        v, gap = max(v + 0.1 * a, 0.0), gap - 0.1 * v
        slowest = min(slowest, a)
    assert gap > 1.0
    assert v < 0.05
    assert slowest > -5.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("video") / "out"
    write_drive(out, FRAMES, SETTINGS)
    return out


def records(folder):
    return [json.loads(line) for line in (folder / "labels.jsonl").read_text().splitlines()]


def test_files_of_a_video_agree(folder):
    found, tracked = records(folder), read_tracking(folder / "training" / "label_02" / "0000.txt")
    assert [frame["_time"] for frame in found] == pytest.approx([k / 5.0 for k in range(FRAMES)])
    for frame in found:
        rows = tracked.get(frame["id"], [])
        assert [row.track for row in rows] == [item["id"] for item in frame["objects"]]
        for row, item in zip(rows, frame["objects"], strict=True):
            assert row.label.length == pytest.approx(item["_size"][0], abs=1e-3)
            assert {"_place", "_heading", "_speed", "_acceleration", "_yaw_rate"} <= set(item)
    with (folder / "odometry.csv").open() as file:
        odometry = list(csv.DictReader(file))
    assert [float(row["time"]) for row in odometry] == [frame["_time"] for frame in found]
    assert {float(row["speed"]) for row in odometry} == {0.0}


def test_an_interrupted_video_goes_on(folder, tmp_path):
    write_drive(tmp_path / "v", FRAMES, SETTINGS)
    lines = (tmp_path / "v" / "labels.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "v" / "labels.jsonl").write_text("".join(lines[:3]) + lines[3][:40])
    write_drive(tmp_path / "v", FRAMES, SETTINGS)
    for name in ("labels.jsonl", "odometry.csv", "training/label_02/0000.txt", "tilt.csv"):
        assert (tmp_path / "v" / name).read_bytes() == (folder / name).read_bytes()


def run(*arguments):
    return CliRunner().invoke(app, ["simulate", *map(str, arguments)])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--static"], "--static"),
        (["--video", "--static", "--rig", "truck"], "--rig mast"),
        (["--format", "mp4"], "--video"),
        (["--video", "--fps", "0"], "fps"),
        (["--video", "--fps", "nan"], "fps"),
        (["--video", "--first", "3"], "first"),
        (["--video", "--frames", "36001"], "frames"),
    ],
)
def test_mistakes_are_one_line(arguments, says, tmp_path):
    result = run("--frames", 4, "--out", tmp_path / "v", "--labels-only", *arguments)
    assert result.exit_code == 2
    assert says in result.stderr
    assert "Traceback" not in result.output
    assert not (tmp_path / "v").exists()


def test_another_number_of_frames_is_another_video(folder):
    with pytest.raises(ValueError, match="frames 5, with which the folder was begun"):
        write_drive(folder, 13, replace(SETTINGS, frames=13))


def test_film_holds_the_pictures(tmp_path):
    av = pytest.importorskip("av")
    pictures = []
    for k in range(5):
        pictures.append(tmp_path / f"{k}.png")
        Image.new("RGB", (161, 121), (40 * k, 90, 200 - 40 * k)).save(pictures[-1])
    write_film(tmp_path / "film.mp4", pictures, 12.5)
    with av.open(str(tmp_path / "film.mp4")) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
        assert float(film.streams.video[0].average_rate) == 12.5
    assert [frame.shape for frame in frames] == [(120, 160, 3)] * 5
    for k, frame in enumerate(frames):
        np.testing.assert_allclose(frame[60, 80], (40 * k, 90, 200 - 40 * k), atol=6)


def test_vehicles_of_both_streets_cross_the_junction():
    clip = made(6, "mast")
    junction = clip.road.junction
    along = across = 0
    for rows in tracks(clip).values():
        s, d = clip.road.locate(rows[:, 1], rows[:, 2])
        along += s.min() < junction.s - 4.0 and s.max() > junction.s + 4.0
        across += np.ptp(d) > 10.0
    assert along > 2
    assert across > 0
