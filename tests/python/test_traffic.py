"""Lines and lanes: made tracks whose crossings are known, files of lines, intervals."""

import math

import groundpose as gp
import numpy as np
import pytest
from groundpose.formats.site import read_site
from test_tracks import CAMERA

GATE = gp.Line("gate", [-6.0, 20.0], [6.0, 20.0])
VIEW = gp.View(CAMERA, pitch=math.radians(-20.0), roll=0.02, height=8.0)


def drive(number, times, places, name="car", speed=None, sigma=0.2, spread=0.04):
    """Rows of a vehicle at times (N,) and places (N, 2); its frames are tenths of seconds."""
    times, places = np.asarray(times, float), np.asarray(places, float)
    n = len(times)
    steps = np.gradient(places, times, axis=0) if n > 1 else np.zeros((1, 2))
    return gp.Tracks(
        id=np.full(n, number),
        name=np.full(n, name),
        frame=np.round(times * 10).astype(np.int64),
        time=times,
        index=np.zeros(n, np.int64),
        place=places,
        place_covariance=np.tile(np.diag([0.01, spread]), (n, 1, 1)),
        heading=np.arctan2(steps[:, 0], steps[:, 1]),
        heading_sigma=np.full(n, 0.02),
        facing_probability=np.ones(n),
        speed=np.hypot(*steps.T) if speed is None else np.full(n, speed),
        speed_sigma=np.full(n, sigma),
        yaw_rate=np.zeros(n),
        yaw_rate_sigma=np.zeros(n),
        acceleration=np.zeros(n),
        acceleration_sigma=np.zeros(n),
        size=np.tile([4.3, 1.5, 1.8], (n, 1)),
        size_sigma=np.full((n, 3), 0.1),
        standing=np.zeros(n, bool),
        seen_from=np.zeros((n, 3)),
    )


def straight(number, x, z, speed, begin=0.0, frames=40, **more):
    """Along z from `z` at `begin`."""
    times = begin + 0.1 * np.arange(frames)
    return drive(number, times, [[x, z + speed * (t - begin)] for t in times], **more)


def test_a_crossing_has_the_time_place_speed_and_direction_of_the_motion():
    there, back = straight(1, 2.0, 10.03, 10.0), straight(2, -3.0, 30.0, -8.0, name="van_bus")
    crossings = gp.CrossingCounter([GATE]).of(gp.Tracks.join([there, back]))
    assert [(c.id, c.name, c.line, c.lane) for c in crossings] == [
        (1, "car", "gate", ""),
        (2, "van_bus", "gate", ""),
    ]
    first, second = crossings
    assert first.time == pytest.approx(0.997)
    assert second.time == pytest.approx(1.25)
    assert first.frame == 10
    assert first.place == pytest.approx((2.0, 20.0))
    assert (first.speed, first.speed_sigma, second.speed) == pytest.approx((10.0, 0.2, 8.0))
    assert first.time_sigma == pytest.approx(0.02), "20 cm at 10 m/s"
    assert (first.direction, second.direction) == ("right_to_left", "left_to_right")
    assert first.heading == pytest.approx(0.0)
    assert abs(second.heading) == pytest.approx(math.pi)
    assert math.isnan(first.headway)


def test_directions_are_those_of_somebody_who_looks_along_the_line():
    """From (0, 0) forward, x grows to the right."""
    line = gp.Line("l", [0.0, 0.0], [0.0, 50.0], ("rightwards", "leftwards"))
    times = 0.1 * np.arange(20)
    to_right = drive(1, times, [[-5.0 + 10.0 * t, 20.0] for t in times])
    assert [c.direction for c in gp.CrossingCounter([line]).of(to_right)] == ["rightwards"]


NOT_CROSSED = {
    "beside the line": straight(1, 7.0, 10.0, 10.0),
    "ends on the line": straight(1, 0.0, 15.0, 5.0, frames=11),
    "begins on the line": straight(1, 0.0, 19.8, 5.0),
    "ends within the margin": straight(1, 0.0, 15.0, 4.8, frames=12),
    "one row": straight(1, 0.0, 20.0, 5.0, frames=1),
    "turns on the line": drive(
        1, 0.1 * np.arange(41), [[0.0, 20.2 - abs(t - 2.0)] for t in 0.1 * np.arange(41)]
    ),
    "stands on the line": drive(
        1,
        0.1 * np.arange(200),
        [[0.0, 20.0 + 0.3 * math.sin(2.2 * k)] for k in range(200)],
    ),
}


@pytest.mark.parametrize("name", NOT_CROSSED)
def test_a_crossing_needs_both_sides(name):
    assert gp.CrossingCounter([GATE]).of(NOT_CROSSED[name]) == []


def test_one_that_waits_on_the_line_crosses_it_once():
    z = np.concatenate(
        [np.linspace(15, 20.1, 30), np.full(50, 20.1), np.full(50, 19.9), np.linspace(19.9, 26, 30)]
    )
    z += 0.05 * np.sin(1.7 * np.arange(160))
    waits = drive(1, 0.1 * np.arange(160), np.column_stack([np.zeros(160), z]))
    crossings = gp.CrossingCounter([GATE]).of(waits)
    assert [c.direction for c in crossings] == ["right_to_left"]
    assert 12.9 < crossings[0].time < 13.6, "when it left the line for good"


def test_one_that_drives_back_crosses_twice():
    z = [15.0 + 10.0 * min(k, 40 - k) / 20.0 for k in range(41)]
    crossings = gp.CrossingCounter([GATE]).of(drive(1, 0.1 * np.arange(41), [[0.0, v] for v in z]))
    assert [c.direction for c in crossings] == ["right_to_left", "left_to_right"]
    assert [c.time for c in crossings] == pytest.approx([1.0, 3.0])


def test_headways_are_those_of_the_lane_and_the_direction():
    lanes = [gp.Lane.along(name, [[x, 0.0], [x, 60.0]], 3.5) for name, x in (("a", -2.0), ("b", 2.0))]
    cars = [
        straight(1, -2.0, 10.0, 10.0),
        straight(2, 2.0, 12.0, 10.0),
        straight(3, -2.0, 10.0, 12.5, begin=2.0),
        straight(4, -2.0, 25.0, -5.0, begin=2.0),
    ]
    crossings = gp.CrossingCounter([GATE], lanes).of(gp.Tracks.join(cars))
    gate = {c.id: c for c in crossings if c.line == "gate"}
    assert [gate[k].lane for k in (1, 2, 3, 4)] == ["a", "b", "a", "a"]
    assert gate[3].headway == pytest.approx(1.8)
    assert gate[3].spacing == pytest.approx(18.0), "as far as the one before has come"
    assert all(math.isnan(gate[k].headway) for k in (1, 2, 4))
    assert [c.time for c in crossings] == sorted(c.time for c in crossings)


def test_lanes_are_counted_across_their_middle():
    lane = gp.Lane.along("north", [[2.0, 10.0], [2.0, 50.0]], 4.0)
    assert (lane.section.start.tolist(), lane.section.end.tolist()) == ([4.0, 30.0], [0.0, 30.0])
    cars = [straight(1, 1.0, 20.0, 10.0), straight(2, 5.0, 20.0, 10.0), straight(3, 2.0, 40.0, -8.0)]
    crossings = gp.CrossingCounter(lanes=[lane]).of(gp.Tracks.join(cars))
    assert [(c.id, c.line, c.lane, c.direction) for c in crossings] == [
        (1, "north", "north", "forward"),
        (3, "north", "north", "backward"),
    ]


def test_polygons_and_bent_centre_lines():
    bay = gp.Lane("bay", [[-8.0, 20.0], [-5.0, 20.0], [-5.0, 32.0], [-8.0, 32.0]])
    assert bay.contains([[-6.0, 21.0], [-4.0, 21.0], [-6.0, 33.0]]).tolist() == [True, False, False]
    assert sorted([bay.section.start.tolist(), bay.section.end.tolist()]) == [[-8.0, 26.0], [-5.0, 26.0]]
    assert [c.direction for c in gp.CrossingCounter(lanes=[bay]).of(straight(1, -6.5, 20.0, 8.0))] == [
        "forward"
    ]
    bent = gp.Lane.along("bent", [[0.0, 0.0], [0.0, 20.0], [20.0, 20.0]], 4.0)
    inside = [[1.9, 5.0], [-1.9, 21.9], [10.0, 18.1], [19.9, 21.9]]
    assert bent.contains(inside).all()
    assert not bent.contains([[2.1, 5.0], [-2.1, 20.0], [10.0, 22.1], [20.1, 20.0], [0.0, -0.1]]).any()
    clockwise = gp.Lane("c", bay.polygon[::-1])
    assert clockwise.contains([[-6.0, 21.0]]).all()


def test_pieces_give_what_the_whole_gives():
    rng = np.random.default_rng(5)
    tracks = []
    for number in range(60):
        begin = 0.1 * rng.integers(0, 600)
        n = int(rng.integers(5, 200))
        speed, x = rng.uniform(-12.0, 12.0), rng.uniform(-8.0, 8.0)
        if number % 5 == 0:
            speed = 0.05
        times = np.round(begin + 0.1 * np.arange(n), 1)
        z = rng.uniform(15.0, 25.0) + speed * (times - begin) + 0.2 * rng.normal(size=n)
        tracks.append(drive(number, times, np.column_stack([np.full(n, x), z])))
    lane = gp.Lane.along("lane", [[0.0, 10.0], [0.0, 34.0]], 6.0)
    whole = gp.CrossingCounter([GATE], [lane]).of(gp.Tracks.join(tracks))
    assert len(whole) > 20
    counter, found, early = gp.CrossingCounter([GATE], [lane]), [], 0
    rows = gp.Tracks.join(tracks)
    for complete in range(1, 900):
        found += counter.add(rows[rows.frame == complete - 1], complete)
        early += len(found)
        assert all(c.frame <= counter.settled for c in found)
        assert len(counter._followed) <= 60
    assert early > 0
    found += counter.finish()
    assert found == whole or str(found) == str(whole)


def test_intervals():
    cars = [
        straight(1, 0.0, 10.0, 10.0),
        straight(2, 0.0, 10.0, 20.0, begin=2.0, name="van_bus", sigma=0.4),
        straight(3, 0.0, 10.0, 10.0, begin=14.0),
    ]
    counter = gp.CrossingCounter([GATE])
    crossings = counter.of(gp.Tracks.join(cars))
    times = 0.5 + 0.1 * np.arange(350)
    flows = gp.TrafficSummary(counter, every=10.0).of(crossings, times)
    ways = ("left_to_right", "right_to_left")
    assert [(f.begin, f.direction, f.count) for f in flows] == [
        (begin, way, count if way == ways[1] else 0)
        for begin, count in ((0.5, 2), (10.0, 1), (20.0, 0), (30.0, 0))
        for way in ways
    ]
    first = flows[1]
    assert (first.begin, first.end, flows[-1].end) == pytest.approx((0.5, 10.0, 35.4))
    assert first.counts == {"car": 1, "van_bus": 1}
    assert first.flow == pytest.approx(3600.0 * 2 / 9.5)
    assert first.mean_speed == pytest.approx(15.0)
    assert first.mean_speed_sigma == pytest.approx(math.hypot(0.2, 0.4) / 2)
    assert first.speed_deviation == pytest.approx(math.sqrt(50.0))
    assert (first.mean_headway, first.least_headway) == pytest.approx((1.5, 1.5))
    assert first.mean_spacing == pytest.approx(15.0)
    assert math.isnan(flows[0].mean_speed)
    assert flows[3].mean_headway == pytest.approx(12.5), "the one before may be of the interval before"
    whole = gp.TrafficSummary(counter).of(crossings, times)
    assert [(f.begin, f.end, f.count) for f in whole] == [(0.5, pytest.approx(35.4), n) for n in (0, 3)]


def test_pixels_are_laid_on_the_road(tmp_path):
    pixels = VIEW.project(np.array([[-6.0, 8.0, 20.0], [6.0, 8.0, 20.0]]) @ VIEW.R_camera_from_ground.T)
    path = tmp_path / "lanes.yaml"
    path.write_text(f"lines: [{{name: gate, pixels: {pixels.tolist()}}}]")
    line = read_site(path, VIEW).lines[0]
    assert np.allclose([line.start, line.end], [GATE.start, GATE.end], atol=1e-6)
    assert np.isnan(VIEW.ground_of([[640.0, -50.0]])).all(), "the sky"
    with pytest.raises(gp.InputError, match="height: expected metres"):
        gp.View(CAMERA).ground_of([[1.0, 2.0]])


def test_points_on_maps(tmp_path):
    path = tmp_path / "world.yaml"
    path.write_text(
        "map: {east: 100, north: 200, heading_deg: 90}\n"
        "lines: [{name: 7, map: [[120, 206], [120, 194]], directions: [in, out]}]\n"
        "lanes: [{name: a, ground: [[0, 0], [0, 30]], width: 3}]\n"
    )
    site = read_site(path)
    assert site.lines[0].name == "7"
    assert site.lines[0].directions == ("in", "out")
    assert np.allclose(site.lines[0].start, [-6.0, 20.0])
    world = gp.World.at(48.0, 11.0, 0.4)
    earth = world.geographic_of([[-6.0, 20.0], [6.0, 20.0]])
    path.write_text(f"lines: [{{name: gate, geographic: {earth.tolist()}}}]")
    assert np.allclose(read_site(path, world=world).lines[0].end, [6.0, 20.0], atol=1e-5)


MISTAKES = {
    "lines: [{ground: [[0, 1], [2, 3]]}]": "lines[0].name: expected a value, got none",
    "lines: [{name: a}]": "lines[0]: expected points in one of ground, map, geographic, pixels, got 0",
    "lines: [{name: a, ground: [[0, 1]]}]": "lines[0]: expected two points, got 1",
    "lines: [{name: a, ground: [[0, 1], [2]]}]": "lines[0].ground[1]: expected a list of 2 numbers",
    "lines: [{name: a, ground: [[0, 1], [0, 1]]}]": "lines[0]: end: expected a point 0.1 m or more",
    "lines: [{name: a, grund: []}]": "lines[0].grund: expected 'ground', got an unknown field",
    "lines: [{name: a, map: [[0, 1], [2, 3]]}]": "lines[0].map: expected the map of the file",
    "lines: [{name: a, geographic: [[0, 1], [2, 3]]}]": "lines[0].geographic: expected the file's",
    "lines: [{name: a, pixels: [[640, 600], [640, 1]]}]": "lines[0].pixels[1]: expected a pixel that shows",
    "lines: [{name: a, ground: [[0, 1], [2, 3]], directions: [in]}]": "directions: expected two words",
    "lines: [{name: a, ground: [[0, 1], [2, 3]], directions: [in, in]}]": "two different words",
    "lines: 3": "lines: expected a list",
    "lanes: [{name: a, ground: [[0, 1], [2, 3]]}]": "lanes[0]: polygon: expected three corners or more",
    "lanes: [{name: a, ground: [[0, 1], [2, 3]], width: 0}]": "lanes[0]: width: expected metres from 0.1",
    "lanes: [{name: ' ', ground: [[0, 1], [2, 3]], width: 3}]": "lanes[0]: name: expected a name",
    "lanes: [{name: a, ground: [[0, 1], [2, 3]], width: 3}]\n"
    "lines: [{name: a, ground: [[0, 1], [2, 3]]}]": "all different, got 'a' twice",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_mistakes_in_files_are_named(text, tmp_path):
    path = tmp_path / "lanes.yaml"
    path.write_text(text)
    with pytest.raises(gp.InputError) as error:
        read_site(path, VIEW)
    assert str(error.value).count("lanes.yaml") == 1
    assert MISTAKES[text] in str(error.value)


def test_what_counters_refuse():
    with pytest.raises(gp.InputError, match="lines: expected a line or a lane"):
        gp.CrossingCounter()
    with pytest.raises(gp.InputError, match="'gate' twice"):
        gp.CrossingCounter([GATE, GATE])
    with pytest.raises(gp.InputError, match="margin: expected metres above 0"):
        gp.CrossingCounter([GATE], margin=0.0)
    with pytest.raises(TypeError, match="lines: expected a Line"):
        gp.CrossingCounter(["gate"])
    with pytest.raises(gp.InputError, match="every: expected seconds above 0"):
        gp.TrafficSummary(gp.CrossingCounter([GATE]), every=0.0)
    with pytest.raises(TypeError, match="tracks: expected Tracks"):
        gp.CrossingCounter([GATE]).of([])
