"""Vehicles over time: exact motions, mistakes of the caller, an independent filter, files."""

import json

import groundpose as gp
import numpy as np
import pytest
from groundpose.formats.pose_lines import PoseLines
from groundpose.formats.tracks import COLUMNS, csv_text, jsonl_text, kitti_text
from groundpose.lab.evaluate.tracks.made import seen_once
from typer.testing import CliRunner

CAMERA = gp.Camera(fx=1000.0, fy=1000.0, cx=640.0, cy=360.0, image_size=(1280, 720))
VIEW = gp.View(CAMERA, pitch=-0.1, height=1.5)
DISTANCE, BEARING, HEADING = 0.04, 0.003, 0.05


def seen(places, headings, view=VIEW, names=None, turned=0.1):
    """Vehicles at places (N, 2) with headings (N,), sigmas in proportion to the distance."""
    places, n = np.asarray(places, float).reshape(-1, 2), len(headings)
    G = view.R_camera_from_ground
    R, t, covariance = np.empty((n, 3, 3)), np.empty((n, 3)), np.zeros((n, 6, 6))
    for k, ((x, z), angle) in enumerate(zip(places, headings, strict=True)):
        s, c = np.sin(angle), np.cos(angle)
        R[k] = G @ [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
        t[k] = G @ [x, 1.5, z]
        ray = np.array([x, 0.0, z])
        d = np.linalg.norm(ray)
        ray /= d
        side, down = np.array([ray[2], 0.0, -ray[0]]), np.array([0.0, 1.0, 0.0])
        on_ground = (DISTANCE * d) ** 2 * np.outer(ray, ray) + (BEARING * d) ** 2 * np.outer(side, side)
        covariance[k, 3:, 3:] = G @ (on_ground + 1e-4 * np.outer(down, down)) @ G.T
        covariance[k, :3, :3] = HEADING**2 * G @ np.outer(down, down) @ G.T + 1e-8 * np.eye(3)

    return seen_once(view, tuple(names or ["car"] * n), R, t, covariance, turned)


def test_two_cars_keep_their_numbers_and_speeds():
    tracker = gp.Tracker(VIEW)
    for k in range(30):
        order = [0, 1] if k % 2 else [1, 0]
        places = np.array([[-3.0, 20.0 + 0.8 * k], [4.0 - 1.2 * k, 35.0]])[order]
        now = tracker.update(seen(places, np.array([0.0, -np.pi / 2])[order]), 0.1 * k)
    assert len(now) == 2
    tracks = tracker.finish()
    assert len(tracks) == 60
    assert set(tracks.id) == {1, 2}
    for vehicle in tracks.vehicles():
        speed = 8.0 if abs(vehicle.heading[0]) < 0.5 else 12.0
        assert np.allclose(vehicle.speed, speed, atol=0.3)
        assert (np.diff(vehicle.frame) == 1).all()
        assert (vehicle.index >= 0).all()
    assert len(tracker.finish()) == 0


def test_a_front_that_every_picture_takes_for_the_rear_is_where_the_vehicle_drives():
    tracker = gp.Tracker(VIEW)
    for k in range(20):
        tracker.update(seen([[-8.0 + 0.8 * k, 25.0]], [-np.pi / 2]), 0.1 * k)
    tracks = tracker.finish()
    assert np.allclose(tracks.heading, np.pi / 2, atol=0.1)
    assert (tracks.speed > 6.0).all()
    assert (tracks.facing_probability > 0.9).all()


def test_mistakes_name_what_is_wrong_and_change_nothing():
    tracker = gp.Tracker(VIEW)
    one = seen([[0.0, 20.0]], [0.0])
    tracker.update(one, 1.0)
    for time in (1.0, 0.5, float("nan"), float("inf")):
        with pytest.raises(gp.InputError, match="time: expected"):
            tracker.update(one, time)
    other = gp.View(gp.Camera(fx=900.0, fy=900.0, cx=640.0, cy=360.0, image_size=(1280, 720)))
    with pytest.raises(gp.InputError, match="poses: expected those of Camera"):
        tracker.update(seen([[0.0, 20.0]], [0.0], other), 2.0)
    with pytest.raises(gp.InputError, match="ego_motion"):
        tracker.update(one, 2.0, (0.0, 1.0, 0.0))
    with pytest.raises(TypeError, match="poses: expected a PoseBatch"):
        tracker.update(None, 2.0)
    with pytest.raises(gp.InputError, match="longest_gap"):
        gp.TrackOptions(longest_gap=-1.0)
    with pytest.raises(gp.InputError, match="camera_motion"):
        gp.TrackOptions(camera_motion="by train")
    assert tracker.frames == 1


def test_poses_that_cannot_be_are_left_out_and_counted():
    tracker = gp.Tracker(VIEW)
    three = seen([[0.0, 20.0], [5.0, 30.0], [-5.0, 30.0]], [0.0, 0.0, 0.0])
    three.t[1] = np.nan
    three.covariance[2] = -np.eye(6)
    for k in range(5):
        tracker.update(three, 0.1 * k)
    tracker.update(seen(np.empty((0, 2)), []), 0.5)
    assert set(tracker.skipped) == {"no pose", "covariance: expected positive variances, got -1"}
    tracks = tracker.finish()
    assert set(tracks.id) == {1}
    assert (tracks.index == 0).all()
    assert len(tracks) == 5


def test_thousands_of_vehicles():
    rng = np.random.default_rng(0)
    places = np.stack([rng.uniform(-500, 500, 2000), rng.uniform(10, 2000, 2000)], axis=1)
    tracker = gp.Tracker(VIEW)
    for k in range(4):
        now = tracker.update(seen(places, np.zeros(2000)), 0.1 * k)
    assert len(now) > 1900


def test_smoothed_answers_are_those_of_an_independent_filter():
    """Forward filter and smoother in NumPy, of a vehicle before a camera whose motion is not known."""
    rng = np.random.default_rng(1)
    options = gp.TrackOptions(camera_motion="unknown")
    places = np.array([[-6.0 + 0.5 * k, 30.0 - 0.3 * k] for k in range(25)])
    places *= 1.0 + 0.01 * rng.normal(size=(25, 1))
    headings = 2.1 + 0.02 * rng.normal(size=25)
    tracker, frames = gp.Tracker(VIEW, options), []
    for k in range(25):
        one = seen(places[k : k + 1], headings[k : k + 1])
        tracker.update(one, 0.1 * k)
        frames.append((places[k], headings[k]))
    tracks = tracker.finish()
    expected = independent(frames, options)
    assert np.allclose(tracks.place, expected[0], atol=2e-3)
    assert np.allclose(np.sin(tracks.heading - expected[1]), 0.0, atol=1e-3)
    assert np.allclose(tracks.place_covariance, expected[2], rtol=0.02, atol=1e-4)


def independent(frames, options, dt=0.1):
    """Places, axes and covariances of places: textbook matrices, dense, without a line of the tracker."""
    n = 11  # x z vx vz axis turning acceleration scale distance bearing heading
    slow, own = options.slow_fraction, options.own_fraction
    errors = np.array([0.25 * slow * DISTANCE**2, slow * BEARING**2, slow * HEADING**2])
    scale = options.constant_fraction * DISTANCE**2
    x = np.zeros(n)
    x[[0, 1]], x[4] = frames[0][0], frames[0][1]
    P = np.diag([1e6, 1e6, *[options.speed_sigma**2] * 2, 1.5**2, 0.3**2, options.acceleration_sigma**2])
    P = np.block([[P, np.zeros((7, 4))], [np.zeros((4, 7)), np.diag([scale, *errors])]])
    steps = []
    for k, (place, heading) in enumerate(frames):
        F = np.eye(n)
        if k:
            x, F, Q = later(x, dt, options, errors)
            P = F @ P @ F.T + Q
        before = x.copy(), P.copy()
        away = np.linalg.norm(x[:2])
        ray = x[:2] / away
        side = np.array([ray[1], -ray[0]])
        H = np.zeros((3, n))
        H[:2, :2], H[:2, 8], H[:2, 9], H[2, 4], H[2, 10] = np.eye(2), ray * away, side * away, 1.0, 1.0
        R = np.zeros((3, 3))
        R[:2, :2] = (
            away**2 * own * (0.5 * DISTANCE**2 * np.outer(ray, ray) + BEARING**2 * np.outer(side, side))
        )
        R[2, 2] = own * HEADING**2
        residual = np.array([*place, heading]) - H @ x
        residual[2] = 0.5 * np.arctan2(np.sin(2 * residual[2]), np.cos(2 * residual[2]))
        S = H @ P @ H.T + R
        d2 = residual[:2] @ np.linalg.solve(S[:2, :2], residual[:2])
        weights = [min(1.0, 10.0 / (8.0 + d2))] * 2 + [min(1.0, 9.0 / (8.0 + residual[2] ** 2 / S[2, 2]))]
        R = R / np.sqrt(np.outer(weights, weights))
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x, P = x + K @ residual, (np.eye(n) - K @ H) @ P
        steps.append((F, before, (x.copy(), P.copy())))
    found = [steps[-1][2]]
    for (_, _, now), (F, before, _) in zip(steps[-2::-1], steps[:0:-1], strict=True):
        G = now[1] @ F.T @ np.linalg.inv(before[1])
        mean, covariance = found[-1]
        found.append((now[0] + G @ (mean - before[0]), now[1] + G @ (covariance - before[1]) @ G.T))
    found.reverse()
    J = [np.hstack([np.eye(2), np.zeros((2, 5)), -m[:2, None], np.zeros((2, 3))]) for m, _ in found]
    spread = [j @ c @ j.T for j, (_, c) in zip(J, found, strict=True)]
    return np.array([m[:2] for m, _ in found]), np.array([m[4] for m, _ in found]), np.array(spread)


def later(x, dt, options, errors):
    keep = np.exp(-dt / 2.0)
    faster, farther = 2.0 * (1.0 - keep), 2.0 * (dt - 2.0 * (1.0 - keep))
    s, c, a = np.sin(x[4]), np.cos(x[4]), x[6]
    F = np.eye(len(x))
    F[0, 2] = F[1, 3] = F[4, 5] = dt
    F[:4, 6] = farther * s, farther * c, faster * s, faster * c
    F[:4, 4] = farther * a * c, -farther * a * s, faster * a * c, -faster * a * s
    F[6, 6] = keep
    y = x.copy()
    y[:2] += dt * x[2:4] + farther * a * np.array([s, c])
    y[2:4] += faster * a * np.array([s, c])
    y[4] += dt * x[5]
    y[6] *= keep
    seen_before, seen_now = x[4] - np.arctan2(x[0], x[1]), y[4] - np.arctan2(y[0], y[1])
    turned = abs(np.arctan2(np.sin(seen_now - seen_before), np.cos(seen_now - seen_before)))
    nearer = abs(np.log(np.hypot(*y[:2]) / np.hypot(*x[:2])))
    same = np.exp(-(turned / 0.35 + nearer / 0.35 + dt / options.error_time))
    F[range(8, 11), range(8, 11)] = same
    y[8:] *= same
    Q, q = np.zeros_like(F), options.acceleration_sigma**2
    for i in range(2):
        Q[i, i], Q[i, i + 2], Q[i + 2, i], Q[i + 2, i + 2] = q * np.array(
            [dt**3 / 3, dt**2 / 2, dt**2 / 2, dt]
        )
    r = options.turning_sigma**2
    Q[4:6, 4:6] = [[r * dt**3 / 3 + 1e-4 * dt, r * dt**2 / 2], [r * dt**2 / 2, r * dt]]
    Q[6, 6], Q[7, 7] = q * (1.0 - keep**2), 1e-8 * dt + 0.1 * errors[0] * (1.0 - same**2)
    Q[range(8, 11), range(8, 11)] = errors * (1.0 - same**2)
    return y, F, Q


def line(number, places, headings, **more):
    one = seen(places, headings)
    objects = [
        {
            "id": k,
            "model": "car",
            "status": "ok",
            "R": one.R[k].tolist(),
            "t": one.t[k].tolist(),
            "covariance": one.covariance[k].tolist(),
            "ambiguity": 0.1,
            "probability": 0.9,
            "alternative_R": [[None] * 3] * 3,
            "alternative_t": [None] * 3,
            "alternative_probability": None,
            "shape_coefficients": [],
        }
        for k in range(len(one))
    ]
    return json.dumps({"id": number, **more, "objects": objects})


def test_lines_of_poses_are_read_and_bad_ones_named():
    text = [line(0, [[0.0, 20.0]], [0.3]), "{", line(2, [], [], time=0.2), '{"id": 3}']
    found = list(PoseLines(text, "poses.jsonl", VIEW))
    assert np.allclose(found[0].seen.t, seen([[0.0, 20.0]], [0.3]).t)
    assert found[0].time is None
    assert "poses.jsonl:2" in str(found[1])
    assert found[2].time == 0.2
    assert len(found[2].seen) == 0
    assert "poses.jsonl:4: objects" in str(found[3])


def test_formats_have_a_row_for_each_sighting():
    tracker = gp.Tracker(VIEW)
    for k in range(6):
        tracker.update(seen([[0.0, 20.0 + k]], [0.0]), 0.1 * k)
    tracks = tracker.finish()
    lines = csv_text(tracks).splitlines()
    assert lines[0] == ",".join(COLUMNS)
    assert len(lines) == 7
    assert [json.loads(text)["id"] for text in jsonl_text(tracks).splitlines()] == [1] * 6
    first = kitti_text(tracks, view=VIEW).splitlines()[0].split()
    assert first[:3] == ["0", "1", "Car"]
    assert len(first) == 17
    placed = VIEW.R_camera_from_ground.T @ [float(value) for value in first[13:16]]
    assert np.allclose(placed, [tracks.place[0, 0], 1.5, tracks.place[0, 1]], atol=1e-3)


def test_command_follows_lines_and_never_loses_what_it_has(tmp_path):
    from groundpose.cli.main import app

    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps({"fx": 1000, "fy": 1000, "cx": 640, "cy": 360, "image_size": [1280, 720]}))
    poses, out = tmp_path / "poses.jsonl", tmp_path / "tracks.csv"
    good = [line(k, [[0.0, 20.0 + k]], [0.0], time=0.1 * k) for k in range(8)]
    poses.write_text("\n".join([*good[:4], "broken", good[2], *good[4:]]) + "\n")
    result = CliRunner().invoke(app, ["track", str(poses), "--camera", str(camera), "-o", str(out)])
    assert result.exit_code == 1, result.output
    assert "poses.jsonl:5" in result.output
    assert "time: expected" in result.output
    assert len(out.read_text().splitlines()) == 9
    no_time = tmp_path / "no_time.jsonl"
    no_time.write_text(line(0, [[0.0, 20.0]], [0.0]) + "\n")
    result = CliRunner().invoke(app, ["track", str(no_time), "--camera", str(camera), "-o", str(out)])
    assert result.exit_code == 2
    assert "--fps" in result.output
    assert len(out.read_text().splitlines()) == 9, "the file of before"


def test_live_rows_come_from_standard_input(tmp_path):
    from groundpose.cli.main import app

    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps({"fx": 1000, "fy": 1000, "cx": 640, "cy": 360, "image_size": [1280, 720]}))
    text = "\n".join(line(k, [[0.0, 20.0 + k]], [0.0]) for k in range(6))
    result = CliRunner().invoke(app, ["track", "-", "--camera", str(camera), "--fps", "10", "--live"], text)
    assert result.exit_code == 0, result.output
    rows = [json.loads(row) for row in result.stdout.splitlines()]
    assert [row["frame"] for row in rows] == [2, 3, 4, 5]
