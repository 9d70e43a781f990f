"""The measures of `groundpose evaluate tracks`."""

import json
from dataclasses import replace

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab.evaluate.tracks.calibrated import mean_view, road_view, view_of
from groundpose.lab.evaluate.tracks.drive import DriveVideo, moved, without_motion
from groundpose.lab.evaluate.tracks.errors import PASSAGE, Said, passages
from groundpose.lab.evaluate.tracks.measure import drive_sets
from groundpose.lab.evaluate.tracks.rivals import Kalman, Plain, see_from
from groundpose.lab.evaluate.tracks.sequence import Sequence, SequenceFrame, Truth


def said(speeds):
    n = len(speeds)
    unknown = np.zeros((n, 3))
    return Said(
        frame=np.arange(n),
        index=np.zeros(n, int),
        place=unknown[:, :2],
        place_covariance=np.tile(np.eye(2), (n, 1, 1)),
        heading=unknown[:, 0],
        heading_sigma=unknown[:, 0],
        speed=np.array(speeds, dtype=float),
        speed_sigma=unknown[:, 0],
        size=unknown,
        size_sigma=unknown,
        dof=unknown[:, 0],
        id=np.zeros(n, int),
    )


def truth(vehicles, speeds):
    n = len(speeds)
    unknown = np.zeros((n, 4))
    return Truth(
        id=np.array(vehicles),
        place=unknown[:, :2],
        heading=unknown[:, 0],
        size=unknown[:, :3],
        bbox=unknown,
        speed=np.array(speeds, dtype=float),
    )


def test_a_passage_is_the_mean_of_a_vehicle_that_drives_and_is_seen_often():
    long, short = [1] * PASSAGE, [2] * (PASSAGE - 1)
    slow, lost = [3] * PASSAGE, [4] * PASSAGE
    vehicles = [*long, *short, *slow, *lost]
    true = [10.0] * len(vehicles)
    given = [9.0 if k % 2 else 13.0 for k in range(len(vehicles))]
    for k, vehicle in enumerate(vehicles):
        if vehicle == 3:
            true[k] = 1.0
        if vehicle == 4:
            given[k] = np.nan
    found = passages(said(given), truth(vehicles, true))
    np.testing.assert_allclose(found, [3.6 * 1.0])


def frame(time, ids, places, ego=(0.0, 0.0, 0.0)):
    known = truth(ids, [20.0] * len(ids))
    return SequenceFrame(time, None, None, None, replace(known, place=np.array(places, float)), ego)


def test_speeds_are_relative_to_a_camera_whose_motion_is_not_known():
    # The first drives 5 m/s faster than the camera, the second comes nearer, the third is seen once.
    frames = [frame(0.5 * k, [1, 2], [[0.0, 20.0 + 2.5 * k], [3.0, 60.0 - 10.0 * k]]) for k in range(3)]
    frames.append(frame(1.5, [1, 2, 3], [[0.0, 27.5], [3.0, 30.0], [9.0, 9.0]]))
    view = gp.View(gp.Camera(fx=1000.0, fy=1000.0, cx=640.0, cy=360.0))
    found = without_motion(Sequence("drive", view, frames, "odometry"))
    assert found.camera_motion == "unknown"
    for made in found.frames:
        np.testing.assert_allclose(made.truth.speed[:2], [5.0, -20.0])
    assert np.isnan(found.frames[3].truth.speed[2])
    assert frames[0].truth.speed[0] == 20.0, "the sequence itself stays as it is"


def test_the_plain_filter_has_the_odometry_too():
    where, velocity, heading = np.array([4.0, 30.0]), np.array([2.0, 9.0]), 0.3
    ego = (1.0, 5.0, 0.2)
    spread = np.diag([1.0, 4.0, 0.1, 0.2])
    track = Plain(
        Kalman(np.concatenate([where, velocity]), spread), Kalman(np.array([heading, 0.1]), np.eye(2)), 1, 0.0
    )
    see_from(track, ego)
    before = moved((0.0, 0.0, 0.0), ego)
    assert before == pytest.approx(ego)
    right, forward = track.place.x[:2]
    s, c = np.sin(ego[2]), np.cos(ego[2])
    # Back in the plane of before.
    back = np.array([ego[0] + right * c + forward * s, ego[1] + forward * c - right * s])
    np.testing.assert_allclose(back, where)
    vx, vz = track.place.x[2:]
    np.testing.assert_allclose([vx * c + vz * s, vz * c - vx * s], velocity)
    assert track.heading.x[0] == pytest.approx(heading - ego[2])
    assert np.linalg.det(track.place.P) == pytest.approx(np.linalg.det(spread))


@pytest.mark.parametrize("standing", [True, False])
def test_a_video_of_a_moving_camera_is_measured_with_odometry_and_without(tmp_path, standing):
    record = {"_time": 0.0, "_odometry": {"standing": standing}}
    (tmp_path / "labels.jsonl").write_text(json.dumps(record) + "\n")
    names = [
        name.removeprefix(f"drive {tmp_path.name}, ") for name, _ in drive_sets(DriveVideo(tmp_path, None))
    ]
    if standing:
        assert names == ["vehicles alone", "vehicles height known", "camera calibrated"]
    else:
        known = "vehicles height known"
        assert names == ["vehicles alone, odometry", f"{known}, odometry", f"{known}, motion unknown"]


def test_a_calibration_knows_the_road_that_vehicles_stand_on():
    # Seen from 8 m above a road that falls away: 1 m in 50 forward, 1 m in 40 to the right.
    tilt = {"pitch_deg": -20.0, "roll_deg": 2.0, "camera_height": 8.0}
    camera = {"fx": 1000.0, "fy": 1000.0, "cx": 640.0, "cy": 360.0, "image_size": [1280, 720]}
    ground = view_of({"camera": camera}, tilt, None).R_camera_from_ground
    places = [(-5.0, 20.0), (6.0, 40.0), (-8.0, 60.0), (3.0, 75.0), (4.0, 500.0)]
    box = [[-1.0, -1.5, -2.0], [1.0, 0.0, 2.0]]
    items = [
        {
            "_bbox_3d": box,
            "truth": {"R": ground.tolist(), "t": (ground @ [x, 8.0 + x / 40 + z / 50, z]).tolist()},
        }
        for x, z in places
    ]
    items[-1]["truth"]["t"] = (ground @ [4.0, -30.0, 500.0]).tolist()  # too far to be seen
    view = road_view([{"camera": camera, "_tilt": tilt, "objects": items}])
    assert view.height == pytest.approx(8.0 / np.sqrt(1 + 1 / 40**2 + 1 / 50**2))
    down = ground.T @ view.R_camera_from_ground[:, 1]
    np.testing.assert_allclose(down / down[1], [-1 / 40, 1.0, -1 / 50], atol=1e-9)


def test_a_moving_camera_was_calibrated_as_it_is_mounted():
    camera = gp.Camera(fx=1000.0, fy=1000.0, cx=640.0, cy=360.0)
    mean = mean_view([gp.View(camera, -0.03, 0.01, 1.4), gp.View(camera, 0.01, 0.03, 1.4)])
    assert (mean.pitch, mean.roll, mean.height) == pytest.approx((-0.01, 0.02, 1.4))


def test_a_folder_that_is_no_video_is_an_error(tmp_path):
    (tmp_path / "labels.jsonl").write_text("{}\n")
    with pytest.raises(gp.InputError, match="a video of groundpose simulate --video"):
        next(drive_sets(DriveVideo(tmp_path, None)))
