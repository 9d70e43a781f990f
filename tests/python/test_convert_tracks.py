"""`groundpose convert` of tracks: what a tracker says of a drive stands in the formats of other tools, as
their own libraries read it."""

import csv
import json
import math
import re
import shutil
import types
import xml.etree.ElementTree as ET
from pathlib import Path

import groundpose as gp
import mutations
import numpy as np
import pytest
from groundpose.cli.main import app
from groundpose.formats.calibrations import read_calibration
from groundpose.formats.neighbours import Context, write_scenes
from groundpose.formats.neighbours import fiftyone as our_fiftyone
from groundpose.formats.neighbours.ros import SIGN_UNKNOWN, UNAVAILABLE, orientation_availability
from groundpose.formats.track_files import is_tracks, read_tracks
from groundpose.formats.track_scenes import NO_SIZE, track_scenes
from groundpose.formats.tracks import COLUMNS, csv_text, jsonl_text
from PIL import Image
from test_neighbours import TABLES, Made, _turn, own
from test_tracks import CAMERA, VIEW, line, seen
from typer.testing import CliRunner

FRAMES, STEP = 24, 0.1
WALK, TURN = 0.8, 0.02
"""Metres forward and radians to the right of a camera that moves, from frame to frame."""
CAMERA_FILE = {
    **{"fx": 1000, "fy": 1000, "cx": 640, "cy": 360, "image_size": [1280, 720]},
    **{"pitch_deg": math.degrees(VIEW.pitch), "camera_height": VIEW.height},
}


def drive(k):
    """Places and headings of two vehicles at frame `k`: one drives away, one crosses from the right."""
    return np.array([[-3.0, 20.0 + 0.8 * k], [8.0 - 0.9 * k, 32.0]]), np.array([0.0, -0.5 * np.pi])


def camera_at(k, moving=True):
    """Where the camera is at frame `k`, right and forward of the first, and how far it has turned: an arc."""
    turned = TURN * np.arange(k * moving)
    way = WALK * np.stack([np.sin(turned), np.cos(turned)], axis=1).sum(axis=0)
    return np.array([*way, k * moving * TURN])


def before_camera(k, moving):
    """`drive` as the camera sees it."""
    (places, headings), at = drive(k), camera_at(k, moving)
    s, c = math.sin(at[2]), math.cos(at[2])
    return (places - at[:2]) @ np.array([[c, s], [-s, c]]), headings - at[2]


def followed(moving=False):
    """Tracks of the drive, before a camera that stands or one that moves along an arc."""
    tracker = gp.Tracker(VIEW, gp.TrackOptions(camera_motion="odometry" if moving else "static"))
    for k in range(FRAMES):
        step = (0.0, WALK, TURN) if moving and k else None
        tracker.update(seen(*before_camera(k, moving)), STEP * k, step)
    return tracker.finish()


TRACKS = {moving: followed(moving) for moving in (False, True)}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with what `groundpose track` wrote of poses, its camera and pictures."""
    folder = tmp_path_factory.mktemp("street")
    (folder / "camera.json").write_text(json.dumps(CAMERA_FILE))
    (folder / "poses.jsonl").write_text("".join(map(poses_of, range(FRAMES))))
    for out in ("tracks.csv", "tracks.jsonl", "tracks.txt"):
        follow(folder / "poses.jsonl", folder / "camera.json", folder / out)
    (folder / "pictures").mkdir()
    for k in range(FRAMES):
        Image.new("RGB", CAMERA.image_size, (k, 120, 90)).save(folder / f"pictures/{k:06d}.png")
    return folder


def poses_of(k, moving=False):
    """A line as `groundpose estimate` writes it."""
    frame = json.loads(line(f"{k:06d}", *before_camera(k, moving), time=5.0 + STEP * k))
    for item in frame["objects"]:
        item |= {"size": [4.3, 1.5, 1.8], "size_sigma": [0.1, 0.1, 0.1]}
    return json.dumps(frame) + "\n"


def follow(poses, camera, out, *more):
    arguments = ["track", poses, "--camera", camera, "-o", out, *more]
    assert CliRunner().invoke(app, list(map(str, arguments)), catch_exceptions=False).exit_code == 0


@pytest.fixture
def street(made, tmp_path, monkeypatch):
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(app, ["convert", *map(str, arguments)], catch_exceptions=False)


def rows(path="tracks.csv"):
    """The table by (time, id), as any reader of CSV has it."""
    with Path(path).open(newline="") as stream:
        return {(float(row["time"]), int(row["id"])): row for row in csv.DictReader(stream)}


def on_ground(row):
    """Where the table says that the middle of the box is, in the camera frame, and where it looks."""
    x, z, height, heading = (float(row[name]) for name in ("right", "ahead", "height", "heading_deg"))
    turned = math.radians(heading - float(row["camera_heading_deg"]))
    ground = VIEW.R_camera_from_ground
    return ground @ [x, VIEW.height - 0.5 * height, z], ground @ [math.sin(turned), 0.0, math.cos(turned)]


# files of tracks


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("text", [csv_text, jsonl_text])
def test_a_file_is_the_tracks_again(tmp_path, moving, text):
    tracks, path = TRACKS[moving], tmp_path / "tracks.any"
    path.write_text(text(tracks, {k: f"{k:06d}" for k in range(FRAMES)}))
    found = read_tracks(path)
    assert not found.bad
    assert found.frames == {k: f"{k:06d}" for k in range(FRAMES)}
    for name in ("id", "name", "frame", "index", "standing"):
        np.testing.assert_array_equal(getattr(found.tracks, name), getattr(tracks, name), err_msg=name)
    for name in set(vars(tracks)) - {"id", "name", "frame", "index", "standing", "place_covariance"}:
        np.testing.assert_allclose(
            getattr(found.tracks, name), getattr(tracks, name), atol=2e-6, err_msg=name
        )
    np.testing.assert_allclose(found.tracks.place_sigma, tracks.place_sigma, atol=1e-6)


def test_a_camera_that_stands_never_looks_elsewhere():
    stands = [row["camera_heading_deg"] for row in csv.DictReader(csv_text(TRACKS[False]).splitlines())]
    assert set(stands) == {"0.0"}
    turned = [row["camera_heading_deg"] for row in map(json.loads, jsonl_text(TRACKS[True]).splitlines())]
    assert max(turned) == pytest.approx(math.degrees(TURN * (FRAMES - 1)), abs=1e-5)


def test_a_table_without_the_last_column_is_read_if_the_camera_stands(tmp_path):
    for moving, good in ((False, True), (True, False)):
        table = [row[:-1] for row in csv.reader(csv_text(TRACKS[moving]).splitlines())]
        path = tmp_path / f"{moving}.csv"
        path.write_text("\n".join(",".join(row) for row in table))
        found = read_tracks(path)
        assert (len(found.bad) == 0) is good
        if not good:
            assert "camera_heading_deg: expected the direction of a camera that moves" in str(found.bad[0])


def test_columns_of_a_map_and_others_change_nothing(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text(csv_text(TRACKS[False], world=gp.World.at(48.1, 11.5, 0.3)))
    assert len(read_tracks(path).tracks) == len(TRACKS[False])


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("id", "0", "id: expected a whole number from 1"),
        ("id", "1.5", "id: expected a whole number from 1"),
        ("id", "1e20", "id: expected a whole number from 1"),
        ("x", "far", "x: expected a finite number"),
        ("x", "1e300", "x: expected a number up to 1e+12"),
        ("time", "", "time: expected a value, got none"),
        ("time", "nan", "time: expected a finite number"),
        ("x_sigma", "-1", "x_sigma: expected a standard deviation from 0"),
        ("heading_sigma_deg", "-1", "heading_sigma_deg: expected a standard deviation from 0"),
        ("length", "0", "length: expected metres above 0"),
        ("facing_probability", "1.2", "facing_probability: expected a probability from 0 to 1"),
        ("standing", "perhaps", "standing: expected true or false"),
        ("object", "-4", "object: expected a whole number from 0"),
        ("time", "0.1", "time: expected one time for each frame"),
        ("frame", "1", "time: expected one time for each frame"),
    ],
)
def test_a_bad_row_is_named_and_costs_only_itself(tmp_path, column, value, said):
    table = list(csv.reader(csv_text(TRACKS[False]).splitlines()))
    table[1][COLUMNS.index(column)] = value
    table[2:] = table[2:5]
    path = tmp_path / "tracks.csv"
    path.write_text("\n".join(",".join(row) for row in table))
    found = read_tracks(path)
    # a time that two frames have is the second one's mistake
    assert len(found.tracks) == 3
    (error,) = found.bad
    assert re.match(rf"{re.escape(str(path))}:[23]: ", str(error))
    assert said in str(error)


def test_lines_that_are_no_rows_are_named(tmp_path):
    good = jsonl_text(TRACKS[False]).splitlines()[:3]
    path = tmp_path / "tracks.jsonl"
    path.write_text("\n".join(["{broken", *good, good[0], "[1]", '{"id": 1}', good[2][:40]]))
    assert is_tracks(path)
    found = read_tracks(path)
    assert len(found.tracks) == 3
    said = [str(error).removeprefix(f"{path}:") for error in found.bad]
    assert said[0].startswith("1: expected JSON")
    assert said[1].startswith("5: id: expected one row of a vehicle in each frame")
    assert said[2].startswith("6: expected an object")
    assert said[3].startswith("7: expected the columns that groundpose track writes, got none called class")
    assert said[4].startswith("8: expected JSON")
    table = tmp_path / "tracks.csv"
    table.write_text(csv_text(TRACKS[False]) + "1,car\n")
    assert "cells, as in the first line, got 2" in str(read_tracks(table).bad[0])


def test_files_that_hold_no_tracks_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    for text in ("", "id,x\n1,2\n", '{"id": 1, "objects": []}\n', "\x00\x01"):
        path.write_text(text)
        assert not is_tracks(path)
        with pytest.raises(gp.InputError, match=r"a\.csv: expected tracks as groundpose track writes them"):
            read_tracks(path)
    path.write_text("id,class,heading_deg\n1,car,3\n")
    with pytest.raises(gp.InputError, match=r"a\.csv: expected the columns .* none called frame, time"):
        read_tracks(path)
    with pytest.raises(OSError, match="nothing"):
        read_tracks(tmp_path / "nothing.csv")


@pytest.mark.parametrize("text", [csv_text, jsonl_text])
def test_damaged_files_are_read_or_refused(tmp_path, text):
    def read(path):
        table = read_tracks(path)
        for scene in track_scenes(table.tracks, VIEW, table.frames):
            assert scene.corner_pixels.shape == (len(scene), 8, 2)
        for error in table.bad:
            assert str(error).startswith(f"{path}:")

    kind = mutations.Kind([text(TRACKS[True]).encode()], mutations.text, read)
    found = mutations.attempt(kind, 100, 5, tmp_path)
    assert not found.untyped, found.examples
    assert not found.unnamed, found.examples
    assert found.read > 50


# scenes


@pytest.mark.parametrize("moving", [False, True])
def test_vehicles_stand_on_the_ground_before_the_camera_of_that_time(moving):
    tracks = TRACKS[moving]
    scenes = list(track_scenes(tracks, VIEW))
    assert [scene.id for scene in scenes] == list(range(FRAMES))
    ground = VIEW.R_camera_from_ground
    for scene in scenes:
        now = tracks[tracks.frame == scene.id]
        now = now[np.argsort(now.id)]
        assert scene.ids == tuple(now.id)
        assert scene.time == now.time[0]
        right, forward, turned = scene.motion.camera
        s, c = math.sin(turned), math.cos(turned)
        below = scene.t @ ground  # in the ground frame of the camera now
        np.testing.assert_allclose(below[:, 1], VIEW.height)
        placed = below[:, [0, 2]] @ [[c, -s], [s, c]] + [right, forward]
        np.testing.assert_allclose(placed, now.place, atol=1e-9)
        moved = scene.velocity @ ground
        np.testing.assert_allclose(np.hypot(moved[:, 0], moved[:, 2]), np.abs(now.speed), atol=1e-9)
        faced = np.arctan2(moved[:, 0], moved[:, 2]) + turned
        np.testing.assert_allclose(np.sin(faced - now.heading), 0.0, atol=1e-9)
        np.testing.assert_allclose(scene.size, now.size)
    last = scenes[-1].motion.camera
    assert last[2] == pytest.approx(moving * TURN * (FRAMES - 1), abs=1e-9)
    assert bool(np.hypot(*last[:2]) > 15.0) is moving


def test_scenes_stand_where_kittis_text_of_the_same_run_puts_them(street):
    table = read_tracks("tracks.csv")
    text = [row.split() for row in Path("tracks.txt").read_text().splitlines()]
    kitti = {(int(row[0]), int(row[1])): np.array(row[10:17], dtype=float) for row in text}
    scenes = list(track_scenes(table.tracks, read_calibration("camera.json"), table.frames))
    assert len(kitti) == sum(map(len, scenes))
    for number, scene in enumerate(scenes):
        for k, vehicle in enumerate(scene.ids):
            height, width, length, x, y, z, rotation_y = kitti[number, vehicle]
            np.testing.assert_allclose(scene.size[k], [length, height, width], atol=1e-4)
            np.testing.assert_allclose(scene.t[k], [x, y, z], atol=1e-4)
            assert math.sin(scene.yaw[k] - rotation_y - 0.5 * math.pi) == pytest.approx(0.0, abs=1e-4)


def test_the_covariance_of_a_scene_is_that_of_the_place_and_the_heading():
    rng = np.random.default_rng(3)
    tracks = TRACKS[True]
    now = tracks[tracks.frame == 15][:1]
    (scene,) = track_scenes(now, VIEW)
    turned = scene.motion.camera[2]
    errors = rng.multivariate_normal(np.zeros(2), now.place_covariance[0], 40_000)
    s, c = math.sin(turned), math.cos(turned)
    seen_now = errors @ np.array([[c, s], [-s, c]])
    wanted = np.cov((np.insert(seen_now, 1, 0.0, axis=1) @ VIEW.R_camera_from_ground.T).T)
    np.testing.assert_allclose(scene.covariance[0, 3:, 3:], wanted, atol=0.03 * np.abs(wanted).max())
    normal = VIEW.R_camera_from_ground[:, 1]
    about = normal @ scene.covariance[0, :3, :3] @ normal
    assert about == pytest.approx(now.heading_sigma[0] ** 2)


def test_the_2d_box_is_what_the_picture_shows():
    for scene in track_scenes(TRACKS[False], VIEW):
        pixels = CAMERA.image_of(scene.corners)
        for box, points in zip(scene.bboxes, pixels, strict=True):
            low, high = points.min(axis=0), points.max(axis=0)
            if (high < 0.0).any() or (low > np.array(CAMERA.image_size) - 1.0).any():
                assert np.isnan(box).all()
                continue
            np.testing.assert_allclose(box[:2], np.maximum(low, 0.0))
            np.testing.assert_allclose(box[2:], np.minimum(high, np.array(CAMERA.image_size) - 1.0))


def without_size(tracks):
    return gp.Tracks(**vars(tracks) | {"size": np.where(tracks.id[:, None] == 1, np.nan, tracks.size)})


def test_a_vehicle_without_a_size_has_no_box():
    (scene, *_) = track_scenes(without_size(TRACKS[False]), VIEW)
    assert scene.status == (NO_SIZE, "ok")
    assert np.isnan(scene.bboxes[0]).all()


def test_scenes_need_a_height_and_names_of_pictures():
    with pytest.raises(gp.InputError, match="view: expected one with the camera's height"):
        track_scenes(TRACKS[False], gp.View(CAMERA))
    with pytest.raises(gp.InputError, match=r"images: expected a name with \{id\}"):
        track_scenes(TRACKS[False], VIEW, images="a.png")
    with pytest.raises(TypeError, match="tracks: expected Tracks"):
        track_scenes([], VIEW)
    named = next(track_scenes(TRACKS[False], VIEW, {0: "a"}, "p/{id}.png"))
    assert (named.id, named.image) == ("a", Path("p/a.png"))
    assert next(track_scenes(TRACKS[False], VIEW, images="p/{id}.png")).image == Path("p/000000.png")
    assert list(track_scenes(TRACKS[False][:0], VIEW)) == []


# formats by their own libraries


@pytest.mark.parametrize("source", ["tracks.csv", "tracks.jsonl"])
def test_mcap_reads_the_table_again(street, source):
    own("foxglove", "foxglove-sdk")
    reader, decoder = own("mcap.reader", "mcap"), own("mcap_protobuf.decoder", "mcap-protobuf-support")
    result = run(source, "a.mcap", "--camera", "camera.json", "--images", "pictures/{id}.png")
    assert result.exit_code == 0, result.stderr
    table = rows()
    assert result.stdout == f"{FRAMES} frames, {len(table)} poses: a.mcap\n"
    found, pictures = {}, {}
    with Path("a.mcap").open("rb") as stream:
        made = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        for _, channel, message, said in made.iter_decoded_messages():
            time = round(message.log_time * 1e-9, 6)
            if channel.topic == "/vehicles":
                found |= {(time, int(entity.id)): entity for entity in said.entities}
            if channel.topic == "/camera/image":
                pictures[time] = said.data
    assert found.keys() == table.keys()
    assert pictures[5.3] == Path("pictures/000003.png").read_bytes()
    for key, row in table.items():
        cube = found[key].cubes[0]
        middle, ahead = on_ground(row)
        place = cube.pose.position
        np.testing.assert_allclose([place.x, place.y, place.z], middle, atol=1e-5)
        np.testing.assert_allclose(_turn(cube.pose.orientation) @ [1, 0, 0], ahead, atol=1e-6)
        size = [float(row[name]) for name in ("length", "width", "height")]
        np.testing.assert_allclose([cube.size.x, cube.size.y, cube.size.z], size, atol=1e-9)
        said = {pair.key: pair.value for pair in found[key].metadata}
        assert float(said["speed_kmh"]) == pytest.approx(float(row["speed_kmh"]), abs=0.006)
        assert (said["class"], said["frame"], said["seen"]) == (row["class"], row["frame"], "true")
        assert "nan" not in said.values()


def test_foxgloves_camera_moves_with_the_odometry(street):
    own("foxglove", "foxglove-sdk")
    reader, decoder = own("mcap.reader", "mcap"), own("mcap_protobuf.decoder", "mcap-protobuf-support")
    Path("poses.jsonl").write_text("".join(poses_of(k, moving=True) for k in range(FRAMES)))
    odometry = [",".join(map(str, camera_at(k))) for k in range(FRAMES)]
    Path("odometry.csv").write_text("\n".join(["x,z,heading", *odometry]))
    follow("poses.jsonl", "camera.json", "moved.csv", "--odometry", "odometry.csv")
    assert run("moved.csv", "a.mcap", "--camera", "camera.json").exit_code == 0
    table, found = rows("moved.csv"), 0
    with Path("a.mcap").open("rb") as stream:
        made = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        decoded = [
            (round(m.log_time * 1e-9, 6), c.topic, said) for _, c, m, said in made.iter_decoded_messages()
        ]
    cameras = {time: said for time, topic, said in decoded if topic == "/tf"}
    for time, said in cameras.items():
        x, z, _ = camera_at(round((time - 5.0) / STEP))
        at = said.translation  # of the frame `ground`: x forward, y left
        np.testing.assert_allclose([-at.y, at.x, at.z], [x, z, VIEW.height], atol=1e-5)
    for time, topic, said in decoded:
        for entity in said.entities if topic == "/vehicles" else ():
            place, at = entity.cubes[0].pose.position, cameras[time].translation
            turned = _turn(cameras[time].rotation) @ [place.x, place.y, place.z]
            row = table[time, int(entity.id)]
            wanted = [float(row["z"]), -float(row["x"]), 0.5 * float(row["height"])]
            np.testing.assert_allclose(np.add(turned, [at.x, at.y, at.z]), wanted, atol=1e-5)
            found += 1
    assert found == len(table) > FRAMES


def test_rosbags_reads_the_table_again(street):
    own("rosbags")
    from rosbags.highlevel import AnyReader

    assert run("tracks.csv", "a.ros2", "--camera", "camera.json").exit_code == 0
    table, counted = rows(), 0
    with AnyReader([Path("a.ros2")]) as bag:
        for connection, stamp, raw in bag.messages():
            said, time = bag.deserialize(raw, connection.msgtype), round(stamp * 1e-9, 6)
            if connection.topic == "/detections":
                numbers = [int(item.id) for item in said.detections]
                now = [table[time, number] for number in numbers]
                for row, item in zip(now, said.detections, strict=True):
                    place = item.bbox.center.position
                    np.testing.assert_allclose([place.x, place.y, place.z], on_ground(row)[0], atol=1e-5)
            elif connection.topic == "/objects":
                for row, item in zip(now, said.objects, strict=True):
                    check_kinematics(row, item.kinematics)
                    assert item.kinematics.has_twist
                    assert item.kinematics.has_twist_covariance
                    assert item.classification[0].label == item.classification[0].CAR
            elif connection.topic == "/tracks":
                for number, row, item in zip(numbers, now, said.objects, strict=True):
                    check_kinematics(row, item.kinematics)
                    assert int.from_bytes(item.object_id.uuid.tobytes(), "big") == number
                    accel = item.kinematics.acceleration_with_covariance
                    assert accel.accel.linear.x == pytest.approx(float(row["acceleration"]), abs=1e-5)
                    assert item.kinematics.is_stationary is (row["standing"] == "True")
                    counted += 1
    assert counted == len(table)


def check_kinematics(row, found):
    pose, twist = found.pose_with_covariance, found.twist_with_covariance
    middle, ahead = on_ground(row)
    np.testing.assert_allclose(_turn(pose.pose.orientation) @ [1, 0, 0], ahead, atol=1e-6)
    assert twist.twist.linear.x == pytest.approx(float(row["speed_kmh"]) / 3.6, abs=1e-5)
    assert twist.twist.angular.z == pytest.approx(-math.radians(float(row["yaw_rate_deg"])), abs=1e-6)
    spread = twist.covariance.reshape(6, 6)
    assert math.sqrt(spread[0, 0]) == pytest.approx(float(row["speed_sigma_kmh"]) / 3.6, abs=1e-5)
    covariance = pose.covariance.reshape(6, 6)[:3, :3]
    right = VIEW.R_camera_from_ground[:, 0]
    assert right @ covariance @ right == pytest.approx(float(row["x_sigma"]) ** 2, rel=1e-3)
    assert found.orientation_availability == (1 if float(row["facing_probability"]) <= 0.8 else 2)
    assert middle[2] > 0.0


def test_orientations_of_tracks_are_as_available_as_their_front():
    now = TRACKS[False][TRACKS[False].frame == 5]
    for changes, wanted in (
        ({"facing_probability": np.full(2, 0.7)}, SIGN_UNKNOWN),
        ({"heading_sigma": np.full(2, 1.0)}, UNAVAILABLE),
    ):
        (scene,) = track_scenes(gp.Tracks(**vars(now) | changes), VIEW)
        assert orientation_availability(scene, 0) == wanted


def test_speeds_that_are_not_known_are_no_twist(tmp_path):
    own("rosbags")
    from rosbags.highlevel import AnyReader

    now = TRACKS[False][TRACKS[False].frame == 5]
    unknown = gp.Tracks(**vars(now) | {"speed": np.full(2, np.nan)})
    write_scenes(tmp_path / "a.ros2", track_scenes(unknown, VIEW))
    with AnyReader([tmp_path / "a.ros2"]) as bag:
        (said,) = (bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages() if c.topic == "/objects")
    assert [item.kinematics.has_twist for item in said.objects] == [False, False]
    assert said.objects[0].kinematics.twist_with_covariance.twist.linear.x == 0.0


@pytest.fixture
def tables(tmp_path):
    """nuScenes' tables for the pictures 000000.png and so on; the camera looks north at (100, 201.7)."""
    folder = tmp_path / "v1.0-mini"
    folder.mkdir()
    shot = TABLES["sample_data"][0]
    shots = [
        shot | {"filename": f"samples/CAM_FRONT/{k:06d}.png", "sample_token": f"s{k}"} for k in range(FRAMES)
    ]
    for name, entries in (TABLES | {"sample_data": shots}).items():
        (folder / f"{name}.json").write_text(json.dumps(entries))
    return folder


def test_nuscenes_boxes_have_velocities_on_the_map_and_are_tracks(street, tables):
    wanted = ("tracks.csv", "r.nuscenes.json", "--camera", "camera.json", "--tables", tables)
    assert run(*wanted).exit_code == 0
    data, table = json.loads(Path("r.nuscenes.json").read_text()), rows()
    assert sum(map(len, data["results"].values())) == len(table)
    for sample, boxes in data["results"].items():
        for box in boxes:
            row = table[round(5.0 + STEP * int(sample[1:]), 6), int(box["tracking_id"])]
            x, y, z = on_ground(row)[0]
            np.testing.assert_allclose(box["translation"], [100 + x, 201.7 + z, 1.5 - y], atol=1e-5)
            ahead = on_ground(row)[1] * float(row["speed_kmh"]) / 3.6
            np.testing.assert_allclose(box["velocity"], ahead[[0, 2]], atol=1e-5)
            assert box["tracking_name"] == box["detection_name"] == "car"
    classes = own("nuscenes.eval.common.data_classes", "nuscenes-devkit")
    own("nuscenes.eval.common.config").config_factory("tracking_nips_2019")  # which says what can be tracked
    for module, kind in (("detection", "DetectionBox"), ("tracking", "TrackingBox")):
        made = own(f"nuscenes.eval.{module}.data_classes", "nuscenes-devkit")
        read = classes.EvalBoxes.deserialize(data["results"], getattr(made, kind))
        assert len(read.all) == len(table)


def test_coco_has_the_numbers_of_the_vehicles_and_their_boxes(street):
    assert run("tracks.csv", "a.coco.json", "--camera", "camera.json").exit_code == 0
    data, table = json.loads(Path("a.coco.json").read_text()), rows()
    names = {image["id"]: image["frame"] for image in data["images"]}
    by_frame = {(row["frame"], number): row for (_, number), row in table.items()}
    seen_boxes = [item for item in data["annotations"] if item["valid3D"]]
    for item in seen_boxes:
        row = by_frame[names[item["image_id"]], item["track_id"]]
        np.testing.assert_allclose(item["center_cam"], on_ground(row)[0], atol=1e-5)
        left, top, right, bottom = item["bbox2D_tight"]
        assert 0 <= left < right <= CAMERA.image_size[0] - 1
        assert 0 <= top < bottom <= CAMERA.image_size[1] - 1
    assert len(seen_boxes) > 0.8 * len(table)


def test_cvats_cuboids_have_the_numbers_of_the_vehicles(street):
    assert (
        run("tracks.csv", "a.xml", "--camera", "camera.json", "--images", "pictures/{id}.png").exit_code == 0
    )
    root = ET.parse("a.xml").getroot()
    images = list(root.iter("image"))
    assert [image.get("name") for image in images] == [f"{k:06d}.png" for k in range(FRAMES)]
    numbers = {a.text for a in root.iter("attribute") if a.get("name") == "object"}
    assert numbers == {"1", "2"}


@pytest.mark.filterwarnings("ignore")  # datumaro's own
def test_datumaro_reads_cvats_images_and_labels(street):
    """It passes over cuboids, which nothing but CVAT itself reads."""
    data = own("datumaro.components.dataset", "datumaro")
    Path("pictures").rename("images")  # where it looks for them
    wanted = ("tracks.csv", "a.xml", "--camera", "camera.json", "--images", "images/{id}.png")
    assert run(*wanted).exit_code == 0
    read = data.Dataset.import_from("a.xml", "cvat")
    assert {item.id for item in read} == {f"{k:06d}" for k in range(FRAMES)}
    labels = next(kind for kind in read.categories().values() if hasattr(kind, "find"))
    assert labels.find("car")[1].attributes == {"object", "end", "yaw_deg", "probability"}


def test_label_studios_own_checker_takes_tracks(street):
    assert run("tracks.csv", "a.label-studio.json", "--camera", "camera.json").exit_code == 0
    tasks = json.loads(Path("a.label-studio.json").read_text())
    assert len(tasks) == FRAMES
    ids = {region["id"] for region in tasks[0]["predictions"][0]["result"]}
    assert {"1-box", "1-bottom"} <= ids
    module = own("label_studio_sdk.label_interface", "label-studio-sdk")
    from groundpose.formats.neighbours.label_studio import CONFIG

    assert module.LabelInterface(CONFIG).validate_prediction(tasks[0]["predictions"][0])


def test_fiftyones_labels_have_an_index(street):
    names = ("Sample", "Detection", "Detections", "Polyline", "Polylines")
    scene = next(track_scenes(TRACKS[False], VIEW, {0: "000000"}, "pictures/{id}.png"))
    made = our_fiftyone.sample(types.SimpleNamespace(**dict.fromkeys(names, Made)), scene, Context())
    solid = made["vehicles"]["detections"]
    assert [item["index"] for item in solid] == list(scene.ids)
    assert solid[0]["speed_kmh"] == pytest.approx(3.6 * scene.motion.speed[0])
    assert len(made["boxes"]["detections"]) == len(scene)
    real = our_fiftyone.sample(own("fiftyone"), scene, Context())
    assert [label.index for label in real["boxes"].detections] == list(scene.ids)


def test_trimesh_reads_boxes_of_a_time(street):
    trimesh = own("trimesh")
    result = run("tracks.csv", "{id}.glb", "--camera", "camera.json")
    assert result.exit_code == 0
    assert "shape, which tracks do not have" in result.stderr
    read = trimesh.load("000007.glb")
    table = {number: row for (time, number), row in rows().items() if row["frame"] == "000007"}
    assert len(read.geometry) == len(table)
    for number, row in table.items():
        transform, key = read.graph[f"car {number} box"]
        middle = trimesh.transform_points(read.geometry[key].vertices, transform).mean(axis=0)
        x, height, z = (float(row[name]) for name in ("right", "height", "ahead"))
        np.testing.assert_allclose(middle, [x, 0.5 * height - VIEW.height, -z], atol=1e-5)


# the command


def test_tracks_of_python_are_written_as_those_of_the_file(street):
    table = read_tracks("tracks.csv")
    scenes = track_scenes(table.tracks, read_calibration("camera.json"), table.frames)
    write_scenes("python.coco.json", scenes)
    assert run("tracks.csv", "command.coco.json", "--camera", "camera.json").exit_code == 0
    assert Path("python.coco.json").read_text() == Path("command.coco.json").read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("tracks.csv", "a.mcap"), "--camera: expected the camera of the tracks in tracks.csv"),
        (
            ("tracks.csv", "a.mcap", "--camera", "flat.json"),
            "flat.json: expected camera_height, metres above",
        ),
        (("tracks.csv", "a.xml", "--camera", "sizeless.json"), "sizeless.json: expected image_size"),
        (("tracks.csv", "a.coco.json", "--camera", "sizeless.json"), "pictures, for coco, got none"),
        (("tracks.csv", "a.fiftyone", "--camera", "camera.json"), "--images: expected the pictures"),
        (("tracks.csv", "a.xml", "--camera", "camera.json", "--images", "a.png"), "a name with {id}"),
        (("tracks.csv", "a.nuscenes.json", "--camera", "camera.json"), "the folder of nuScenes' tables"),
        (("tracks.csv", "a.mcap", "--camera", "nowhere.json"), "nowhere.json: No such file"),
        (("tracks.csv", "camera.json", "--to", "coco", "--camera", "camera.json"), "is an input"),
        (("tracks.txt", "a.mcap", "--camera", "camera.json"), "KITTI's text, which has neither times"),
        (("poses.jsonl", "a.mcap", "--camera", "camera.json"), "--camera: poses.jsonl has no tracks"),
        (("poses.jsonl", "a.mcap", "--height", "2"), "--height: poses.jsonl has no tracks"),
        (("empty.csv", "a.mcap", "--camera", "camera.json"), "empty.csv: expected frames, got none"),
        (("moved.csv", "a.mcap", "--camera", "camera.json"), "the direction of a camera that moves"),
    ],
)
def test_what_is_missing_is_said(street, arguments, said):
    Path("flat.json").write_text(json.dumps({k: v for k, v in CAMERA_FILE.items() if k != "camera_height"}))
    Path("sizeless.json").write_text(json.dumps({k: v for k, v in CAMERA_FILE.items() if k != "image_size"}))
    Path("empty.csv").write_text(",".join(COLUMNS) + "\n")
    moved = [row[:-1] for row in csv.reader(csv_text(TRACKS[True]).splitlines())]
    one_frame = [row for row in moved if row[2] in ("frame", "9")]
    Path("moved.csv").write_text("\n".join(",".join(row) for row in one_frame))
    if "a.mcap" in arguments:
        own("foxglove", "foxglove-sdk")
    result = run(*arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert said in " ".join(result.stderr.split())
    assert not Path("a.mcap").exists()


def test_a_height_can_be_given_and_bad_rows_cost_themselves(street):
    Path("flat.json").write_text(json.dumps({k: v for k, v in CAMERA_FILE.items() if k != "camera_height"}))
    text = Path("tracks.csv").read_text().splitlines()
    Path("tracks.csv").write_text("\n".join([*text, "1,car,9"]))
    result = run("tracks.csv", "a.coco.json", "--camera", "flat.json", "--height", 1.5)
    assert result.exit_code == 1
    assert f"tracks.csv:{len(text) + 1}: expected {len(COLUMNS)} cells" in result.stderr
    assert len(json.loads(Path("a.coco.json").read_text())["images"]) == FRAMES


def test_vehicles_without_a_size_are_counted(street):
    Path("sizeless.csv").write_text(csv_text(without_size(TRACKS[False])))
    result = run("sizeless.csv", "a.coco.json", "--camera", "camera.json")
    assert result.exit_code == 0
    assert f"left out: {FRAMES} x vehicle whose size is not known" in result.stderr
    data = json.loads(Path("a.coco.json").read_text())
    assert {item["track_id"] for item in data["annotations"]} == {2}


def test_a_time_that_recordings_cannot_hold_costs_its_frame(street):
    own("foxglove", "foxglove-sdk")
    tracks = TRACKS[False]
    Path("early.csv").write_text(csv_text(gp.Tracks(**vars(tracks) | {"time": tracks.time - 0.15})))
    result = run("early.csv", "a.mcap", "--camera", "camera.json")
    assert result.exit_code == 1
    assert f"{FRAMES - 2} frames" in result.stdout


def test_live_rows_are_taken_too(street):
    follow("poses.jsonl", "camera.json", "live.jsonl", "--live")
    assert run("live.jsonl", "a.coco.json", "--camera", "camera.json").exit_code == 0
    assert len(json.loads(Path("a.coco.json").read_text())["images"]) == len(
        {json.loads(text)["time"] for text in Path("live.jsonl").read_text().splitlines()}
    )
