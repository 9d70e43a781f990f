"""Frames of the virtual drive: same arguments, same frame; no overlaps; everything stands on the road."""

import itertools

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab.drive import SPLITS, scene, scene_seed, split_of
from groundpose.lab.drive import ego as car
from groundpose.lab.drive.body_cache import body
from groundpose.lab.drive.ego import FRAMES_PER_DRIVE, drive_along
from groundpose.lab.drive.footprints import Footprints, overlapping
from groundpose.lab.drive.road_kinds import ROAD_KINDS, make_road
from groundpose.lab.drive.road_mesh import road_mesh
from groundpose.lab.drive.splits import random_body
from groundpose.lab.drive.steering import LIMIT, steering
from groundpose.lab.drive.traffic import Actor
from groundpose.vehicles import CLASSES

SEED = scene_seed(9, "validation")
FRAMES = [0, 7, 19, 12, 13]


@pytest.fixture(scope="module")
def scenes():
    return [scene(SEED, number) for number in FRAMES]


def corners(vehicle):
    """(4, 2) of the footprint in the world, seen from above."""
    (x0, _, z0), (x1, _, z1) = body(vehicle.class_name, vehicle.seed).bbox_3d
    local = np.array([(x0, 0, z0), (x1, 0, z0), (x1, 0, z1), (x0, 0, z1)])
    return (local @ vehicle.R_world.T + vehicle.t_world)[:, [0, 2]]


def apart(a, b):
    """Whether a side of one of two convex polygons separates them."""
    for points in (a, b):
        for p, q in itertools.pairwise([*points, points[0]]):
            normal = np.array([q[1] - p[1], p[0] - q[0]])
            if (a @ normal).max() <= (b @ normal).min() or (b @ normal).max() <= (a @ normal).min():
                return True
    return False


def test_car_parks_lie_beside_the_pavement_and_not_in_the_crossing_street():
    found = 0
    for seed in range(30):
        road = make_road(np.random.default_rng(seed), "street", 150.0)
        for lot in road.lots:
            found += 1
            edge = road.layout.edge(lot.rows[0].side) + road.layout.pavement
            for row in lot.rows:
                assert abs(row.d) - 0.5 * row.depth > edge
                assert abs(row.d) + 0.5 * row.depth < road.layout.extent
            if road.junction is not None:
                assert not lot.start < road.junction.s < lot.end
    assert found > 5


def test_cars_stand_in_car_parks():
    parked = 0
    for index in range(12):
        made = scene(SEED, FRAMES_PER_DRIVE * index + 10)
        places = np.array([v.t_world for v in made.vehicles]).reshape(-1, 3)
        s, d = made.road.locate(places[:, 0], places[:, 2])
        for lot in made.road.lots:
            rows = [row.d for row in lot.rows]
            for vehicle, at, across in zip(made.vehicles, s, d, strict=True):
                if lot.start - 3.0 < at < lot.end and np.abs(across - rows).min() < 1.0:
                    assert vehicle.state == "parked"
                    parked += 1
    assert parked > 5


def test_a_frame_depends_on_its_arguments_only(scenes):
    again = scene(SEED, FRAMES[2])
    before = scenes[2]
    np.testing.assert_array_equal(again.R_camera_from_world, before.R_camera_from_world)
    np.testing.assert_array_equal(again.t_camera_from_world, before.t_camera_from_world)
    assert len(again.vehicles) == len(before.vehicles) > 0
    for a, b in zip(again.vehicles, before.vehicles, strict=True):
        assert (a.class_name, a.seed, a.look_seed, a.state, a.braking) == (
            b.class_name,
            b.seed,
            b.look_seed,
            b.state,
            b.braking,
        )
        np.testing.assert_array_equal(a.R_world, b.R_world)
        np.testing.assert_array_equal(a.t_world, b.t_world)


def test_vehicles_and_camera_car_do_not_overlap(scenes):
    pairs = 0
    for frame in scenes:
        shapes = [corners(v) for v in frame.vehicles]
        R, at = frame.R_camera_from_world, frame.camera_position
        forward, right = R[2, [0, 2]], R[0, [0, 2]]
        ends = (car.CAMERA_TO_FRONT, car.CAMERA_TO_FRONT - car.LENGTH)
        own = [at[[0, 2]] + z * forward + x * right for z, x in itertools.product(ends, (-0.9, 0.9))]
        for i, j in itertools.combinations(range(len(shapes)), 2):
            pairs += 1
            assert apart(shapes[i], shapes[j])
        for shape in shapes:
            assert apart(np.array([own[0], own[1], own[3], own[2]]), shape)
    assert pairs > 100


def test_wheels_stand_on_the_road(scenes):
    wheels = 0
    for frame in scenes:
        for v in frame.vehicles:
            centres = body(v.class_name, v.seed).wheels[:, :3] * [1.0, 0.0, 1.0]
            x, y, z = (centres @ v.R_world.T + v.t_world).T
            ground, _ = frame.road.surface(x, z)
            assert np.abs(y - ground).max() < 0.01
            wheels += len(x)
    assert wheels > 100


def test_camera_stands_above_its_road(scenes):
    for frame in scenes:
        position = frame.camera_position
        down = frame.view.R_camera_from_ground.T @ frame.R_camera_from_world  # rows of ground_from_world
        foot = position + frame.height * down[1]
        ground, normal = frame.road.surface(foot[0], foot[2])
        assert abs(ground[0] - foot[1]) < 1e-6
        np.testing.assert_allclose(normal[0], -down[1], atol=1e-9)
        assert 1.2 <= frame.height <= 1.8


def test_tilt_between_frames_is_that_of_real_drives():
    rows = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        kind = list(ROAD_KINDS)[seed % len(ROAD_KINDS)]
        road = make_road(rng, kind, 600.0)
        lane = next(lane for lane in road.layout.lanes if lane.direction > 0)
        ego = drive_along(rng, road, lane.d, lane.speed)
        rows.append(np.degrees([ego.pitch, ego.roll]))
    tilt = np.array(rows)  # (drives, 2, frames)
    pitch, roll = tilt.transpose(1, 0, 2).reshape(2, -1).std(axis=1)
    within = tilt.std(axis=2).mean(axis=0)
    assert 0.7 < pitch < 1.6
    assert 0.5 < roll < 1.6
    assert 0.6 < within[0] < 1.4
    assert np.abs(tilt).max() < 12.0


@pytest.mark.parametrize("kind", ROAD_KINDS)
def test_road_coordinates_and_surface_agree(kind):
    for seed in range(4):
        rng = np.random.default_rng(seed)
        road = make_road(rng, kind, 200.0)
        s, d = rng.uniform(-40.0, 180.0, 100), rng.uniform(-9.0, 9.0, 100)
        points = road.world(s, d)
        np.testing.assert_allclose(road.locate(points[:, 0], points[:, 2]), [s, d], atol=1e-6)
        y, normal = road.surface(points[:, 0], points[:, 2])
        np.testing.assert_allclose(y, points[:, 1] - road.lift(s, d), atol=1e-9)
        np.testing.assert_allclose(road.frame(s, d)[:, :, 1], -normal, atol=1e-12)
        # the normal is that of the surface, by differences over a metre away from kerbs
        flat = np.abs(d) < 2.0
        steps = [road.world(s + a, d + b) - road.world(s - a, d - b) for a, b in ((0.5, 0.0), (0.0, 0.5))]
        for step in steps:
            assert np.abs(np.sum(step * normal, axis=1))[flat].max() < 2e-3


def test_road_mesh_lies_on_the_surface_and_looks_up():
    road = make_road(np.random.default_rng(1), "street", 200.0)
    assert road.junction is not None
    mesh = road_mesh(road, 0.0, 150.0)
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    assert (np.sum(normals * mesh.normals[mesh.faces[:, 0]], axis=1) > 0).all()
    road_only = (np.abs(mesh.uv[:, 0]) < road.layout.right) & (mesh.uv[:, 0] > -road.layout.left)
    y, _ = road.surface(mesh.vertices[road_only, 0], mesh.vertices[road_only, 2])
    np.testing.assert_allclose(y, mesh.vertices[road_only, 1], atol=1e-6)
    assert road.surface(*road.world(road.junction.s, 12.0)[0, [0, 2]])[0] == pytest.approx(
        road.world(road.junction.s, 12.0)[0, 1]
    )


def test_splits_share_neither_seeds_nor_bodies():
    seeds = [scene_seed(7, split) for split in SPLITS]
    assert len(set(seeds)) == 3
    assert [split_of(seed) for seed in seeds] == list(SPLITS)
    assert split_of(scene_seed(2**32 - 1, "train")) == "train"
    rng = np.random.default_rng(0)
    for kind in CLASSES:
        pools = [{random_body(rng, kind, split) for _ in range(500)} for split in SPLITS]
        assert not pools[0] & pools[1]
        assert not pools[0] & pools[2]
        assert not pools[1] & pools[2]


def test_wheels_follow_the_turn_and_some_parked_ones_are_turned():
    made = [scene(scene_seed(seed), number) for seed in range(6) for number in range(0, 40, 4)]
    angles = {state: [] for state in ("moving", "parked", "turning", "crossing")}
    for vehicle in (v for s in made for v in s.vehicles):
        angles[vehicle.state].append(vehicle.steering)
    assert all(abs(a) <= LIMIT for values in angles.values() for a in values)
    assert not any(angles["moving"] + angles["crossing"])
    assert 0.2 < np.mean(np.abs(angles["parked"]) > 0.02) < 0.6
    assert np.mean(np.abs(angles["turning"]) > 0.1) > 0.1


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_circle_is_driven_with_its_steering_angle(side):
    road = make_road(np.random.default_rng(0), "street", 300.0)
    radius, turn = 12.0, np.linspace(0.0, 0.4, 5)
    path = 30.0 + radius * np.sin(turn), side * radius * (1.0 - np.cos(turn))
    actor = Actor("car", 7, 0, *path, side * turn, ("turning",) * 5, np.zeros(5, bool), 0.0, 50.0)
    wheelbase = np.ptp(body("car", 7).wheels[:, 2])
    for frame in range(5):
        assert steering(actor, frame, road) == pytest.approx(side * np.arctan(wheelbase / radius), rel=0.1)


def test_bad_arguments_are_named():
    with pytest.raises(gp.InputError, match="split: expected one of train, validation, test"):
        scene_seed(0, "dev")
    with pytest.raises(gp.InputError, match="seed: expected 0 to 4294967295"):
        scene_seed(2**32, "train")
    with pytest.raises(gp.InputError, match="seed: expected"):
        split_of(3 * 2**32)
    with pytest.raises(gp.InputError, match="number: expected"):
        scene(SEED, -1)
    with pytest.raises(gp.InputError, match="seed: expected"):
        scene(-1, 0)


def test_overlap_of_rectangles_is_exact():
    rng = np.random.default_rng(3)
    n = 40
    origin, heading = rng.uniform(-6.0, 6.0, (n, 2)), rng.uniform(-4.0, 4.0, n)
    box = np.stack([-rng.uniform(0.3, 2.0, (n, 2)), rng.uniform(0.3, 2.0, (n, 2))], axis=1)
    found = overlapping(Footprints.of(origin, heading, box))
    shapes = []
    for o, a, ((x0, z0), (x1, z1)) in zip(origin, heading, box, strict=True):
        turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        shapes.append(np.array([(x0, z0), (x1, z0), (x1, z1), (x0, z1)]) @ turn + o)
    for i, j in itertools.combinations(range(n), 2):
        assert found[i, j] == found[j, i] == (not apart(shapes[i], shapes[j]))
    assert found.any()
    assert not found.all()


def test_other_seeds_and_drives_are_others(scenes):
    other = scene_seed(12, "validation")
    heights = [scenes[0].height, scene(other, 0).height, scene(other, FRAMES_PER_DRIVE).height]
    assert len(set(heights)) == 3
