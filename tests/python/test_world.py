"""Where the ground lies: exact formulas on the ellipsoid, a geodesic along its way, files, rows."""

import csv
import json
import math
import pickle

import groundpose as gp
import numpy as np
import pytest
from groundpose.cli.main import app
from groundpose.formats.site import read_site
from groundpose.formats.tracks import COLUMNS, csv_text, jsonl_text
from test_tracks import VIEW, line, seen
from typer.testing import CliRunner

A, F = 6378137.0, 1.0 / 298.257223563
E2 = F * (2.0 - F)
PLACES = [(48.137, 11.575), (-33.9, 151.2), (0.0, -179.9999), (71.0, 25.8), (-89.0, 3.0)]


def on_the_earth(latitude, longitude):
    n = A / math.sqrt(1.0 - E2 * math.sin(latitude) ** 2)
    ring = n * math.cos(latitude)
    return np.array(
        [ring * math.cos(longitude), ring * math.sin(longitude), n * (1 - E2) * math.sin(latitude)]
    )


def geodesic(latitude_deg, longitude_deg, azimuth, distance, steps=200):
    """The end of the shortest way along the ellipsoid, by Runge and Kutta: no line of ECEF in it."""

    def slope(state):
        latitude, _, heading = state
        w = 1.0 - E2 * np.sin(latitude) ** 2
        meridian, across = A * (1.0 - E2) / w**1.5, A / np.sqrt(w)
        turn = np.sin(heading) / across
        return np.array([np.cos(heading) / meridian, turn / np.cos(latitude), turn * np.tan(latitude)])

    state, h = np.array([*np.radians([latitude_deg, longitude_deg]), azimuth]), distance / steps
    for _ in range(steps):
        k1 = slope(state)
        k2 = slope(state + 0.5 * h * k1)
        k3 = slope(state + 0.5 * h * k2)
        k4 = slope(state + h * k3)
        state = state + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4)
    return state[0], state[1]


def ground(distance, angle):
    return [distance * math.sin(angle), distance * math.cos(angle)]


@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
def test_geographic_places_are_those_of_the_geodesic_within_a_centimetre(latitude, longitude):
    heading = 0.7
    world = gp.World.at(latitude, longitude, heading)
    for distance in (1.0, 60.0, 500.0):
        for angle in np.linspace(-3.0, 3.0, 7):
            found = np.radians(world.geographic_of(ground(distance, angle)))
            exact = geodesic(latitude, longitude, heading + angle, distance)
            gap = np.linalg.norm(on_the_earth(*found) - on_the_earth(*exact))
            assert gap < 1e-4, (distance, angle, gap)


@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
def test_there_and_back(latitude, longitude):
    rng = np.random.default_rng(2)
    world = gp.World.at(latitude, longitude, -2.0)
    places = rng.uniform(-350.0, 350.0, (50, 2))
    assert np.allclose(world.ground_of_geographic(world.geographic_of(places)), places, atol=1e-5)
    flat = gp.World(1e6, -2e6, 1.1)
    assert np.allclose(flat.ground_of(flat.map_of(places)), places, atol=1e-8)


def test_headings_and_places_turn_as_a_compass():
    east = gp.World(10.0, 20.0, math.pi / 2)
    assert np.allclose(east.map_of([[0.0, 5.0], [5.0, 0.0]]), [[15.0, 20.0], [10.0, 15.0]])
    assert np.allclose(np.degrees(east.heading_of([0.0, math.pi / 2, -math.pi])), [90.0, 180.0, 270.0])
    stretched = east.covariance_of([[[4.0, 0.0], [0.0, 1.0]]])
    assert np.allclose(stretched, [[[1.0, 0.0], [0.0, 4.0]]])
    assert pickle.loads(pickle.dumps(gp.World.at(1.0, 2.0, 3.0))) == gp.World.at(1.0, 2.0, 3.0)


def test_what_a_world_refuses():
    with pytest.raises(gp.InputError, match="latitude_deg: expected degrees from"):
        gp.World.at(90.0, 0.0)
    with pytest.raises(gp.InputError, match="longitude_deg: expected degrees"):
        gp.World.at(0.0, float("nan"))
    with pytest.raises(gp.InputError, match="north: expected a finite number"):
        gp.World(north=float("inf"))
    with pytest.raises(gp.InputError, match="both latitude_deg and longitude_deg"):
        gp.World(latitude_deg=3.0)
    with pytest.raises(TypeError, match="east: expected a number"):
        gp.World(east="3")
    with pytest.raises(gp.InputError, match="world: expected one with latitude"):
        gp.World().geographic_of([[0.0, 1.0]])
    with pytest.raises(gp.InputError, match="within 100 km"):
        gp.World.at(1.0, 2.0).geographic_of([[0.0, 2e5]])
    with pytest.raises(gp.InputError, match=r"ground: expected shape \(..., 2\)"):
        gp.World().map_of([1.0, 2.0, 3.0])


FILES = {
    "map: {east: 1, north: 2, heading_deg: 90}": gp.World(1.0, 2.0, math.pi / 2),
    "geographic:\n  latitude: 48.1\n  longitude: 11.5\n  heading_deg: -10\n": gp.World.at(
        48.1, 11.5, math.radians(-10)
    ),
    "_note: of the mast\nmap: {east: 0, north: 0, heading_deg: 0}\n": gp.World(),
}


@pytest.mark.parametrize("text", FILES)
def test_files_of_worlds(text, tmp_path):
    path = tmp_path / "world.yaml"
    path.write_text(text)
    assert read_site(path).world == FILES[text]


def test_a_world_as_json(tmp_path):
    path = tmp_path / "world.json"
    path.write_text('{\t"map": {"east": 1, "north": 2.5, "heading_deg": 0}}')
    assert read_site(path).world == gp.World(1.0, 2.5, 0.0)


MISTAKES = {
    "map: {east: 1, nort: 2, heading_deg: 90}": "map.nort: expected 'north', got an unknown field",
    "map: {east: 1, heading_deg: 90}": "map.north: expected a value, got none",
    "map: {east: far, north: 2, heading_deg: 90}": 'map.east: expected a finite number, got "far"',
    "map: 3": "map: expected an object",
    "geographic: {latitude: 91, longitude: 2, heading_deg: 0}": "latitude: expected a number from -89.999",
    "geographic: {latitude: 1, longitude: 181, heading_deg: 0}": "longitude: expected a number from -180 to",
    "map: {east: 1, north: 2, heading_deg: 361}": "heading_deg: expected a number from -360 to 360, got 361",
    "map: {east: 1, north: 2, heading_deg: 0}\ngeographic: {}": "geographic: expected no geographic beside",
    "mapp: {}": "mapp: expected 'map', got an unknown field",
    "": "expected a mapping of map, geographic",
    "a: [": "expected YAML",
    "- 1": "expected an object",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_mistakes_in_files_are_named(text, tmp_path):
    path = tmp_path / "world.yaml"
    path.write_text(text)
    with pytest.raises(gp.InputError) as error:
        read_site(path)
    assert "world.yaml" in str(error.value)
    assert MISTAKES[text] in str(error.value)


def tracks_of_a_car():
    tracker = gp.Tracker(VIEW)
    for k in range(8):
        tracker.update(seen([[2.0, 20.0 + k]], [0.0]), 0.1 * k)
    return tracker.finish()


def test_rows_have_places_on_the_map_after_their_own():
    tracks, world = tracks_of_a_car(), gp.World(100.0, 200.0, math.pi / 2)
    plain = list(csv.DictReader(csv_text(tracks).splitlines()))
    both = list(csv.DictReader(csv_text(tracks, world=world).splitlines()))
    assert list(plain[0]) == list(COLUMNS)
    added = ["map_x", "map_y", "east_sigma", "north_sigma", "map_heading_deg"]
    assert list(both[0]) == [*COLUMNS, *added]
    for mine, theirs in zip(both, plain, strict=True):
        assert {name: mine[name] for name in COLUMNS} == theirs
        assert float(mine["map_x"]) == pytest.approx(100.0 + float(mine["z"]), abs=2e-6)
        assert float(mine["map_y"]) == pytest.approx(200.0 - float(mine["x"]), abs=2e-6)
        assert (mine["east_sigma"], mine["north_sigma"]) == (mine["z_sigma"], mine["x_sigma"])
        assert float(mine["map_heading_deg"]) == pytest.approx(90.0, abs=5.0)
    earth = json.loads(jsonl_text(tracks, world=gp.World.at(48.0, 11.0)).splitlines()[0])
    back = gp.World.at(48.0, 11.0).ground_of_geographic([earth["latitude"], earth["longitude"]])
    assert np.allclose(back, [earth["x"], earth["z"]], atol=1e-3), "digits for a millimetre"


def run(*arguments):
    return CliRunner().invoke(app, ["track", *map(str, arguments)])


def test_command_adds_the_map(tmp_path):
    camera, poses, world = (tmp_path / name for name in ("camera.json", "poses.jsonl", "world.yaml"))
    camera.write_text(json.dumps({"fx": 1000, "fy": 1000, "cx": 640, "cy": 360, "image_size": [1280, 720]}))
    poses.write_text("\n".join(line(k, [[0.0, 20.0 + k]], [0.0], time=0.1 * k) for k in range(8)))
    world.write_text("geographic: {latitude: 48.0, longitude: 11.0, heading_deg: 0}")
    plain, placed = tmp_path / "plain.csv", tmp_path / "placed.csv"
    assert run(poses, "--camera", camera, "-o", plain).exit_code == 0
    assert run(poses, "--camera", camera, "-o", placed, "--world", world).exit_code == 0
    before, after = (list(csv.DictReader(path.read_text().splitlines())) for path in (plain, placed))
    assert [{name: row[name] for name in COLUMNS} for row in after] == before
    assert float(after[0]["latitude"]) > 48.0001
    moving = run(poses, "--camera", camera, "--world", world, "--camera-motion", "unknown")
    assert moving.exit_code == 2
    assert "--world: expected a camera that stands" in moving.output
    kitti = run(poses, "--camera", camera, "--world", world, "-o", tmp_path / "a.txt")
    assert kitti.exit_code == 2
    overwrites = run(poses, "--camera", camera, "-o", world)
    assert overwrites.exit_code == 2
