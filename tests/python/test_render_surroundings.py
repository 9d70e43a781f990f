"""Skies, lights and things beside the road; no OpenGL needed."""

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab.bodies import MATERIALS, body
from groundpose.lab.drive import props
from groundpose.lab.drive.assets import SKIES, environments, skies
from groundpose.lab.drive.render import textures
from groundpose.lab.drive.render.levels import BODY_LEVELS, level_of, prop_levels, vehicle_levels
from groundpose.lab.drive.render.lighting import KINDS, illumination
from groundpose.lab.drive.render.look import PAINTS, SURFACES, look, surface_tables
from groundpose.lab.drive.render.pictures import SIZE
from groundpose.lab.drive.road_kinds import ROAD_KINDS, make_road
from groundpose.lab.drive.surroundings import light
from groundpose.lab.drive.surroundings import props as beside
from groundpose.vehicles import CLASSES


def test_no_sky_is_in_two_splits():
    indices = [i for split in SKIES for i in skies(split)]
    assert sorted(indices) == list(range(len(environments())))


def test_skies_light_level_ground_with_one():
    for environment in environments():
        h = environment.harmonics
        assert 0.282095 * h[0, 1] + 0.488603 * h[1, 1] - 0.315392 * h[6, 1] - 0.546274 * h[
            8, 1
        ] == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("split", list(SKIES))
def test_light_stays_in_its_table(split):
    rng = np.random.default_rng(4)
    for _ in range(50):
        made = light(rng, split)
        kind = KINDS[made.kind]
        elevation = np.degrees(np.arcsin(-made.sun_direction[1]))
        assert np.linalg.norm(made.sun_direction) == pytest.approx(1.0)
        assert kind.elevation[0] <= elevation <= kind.elevation[1]
        assert kind.strength[0] <= made.sun_strength <= kind.strength[1]
        assert made.sky in skies(split)
        assert all(np.isfinite(np.asarray(v, float)).all() for v in illumination(made).values())


def test_light_refuses_an_unknown_split():
    with pytest.raises(gp.InputError, match="split: expected one of train"):
        light(np.random.default_rng(0), "dev")


@pytest.mark.parametrize("kind", list(ROAD_KINDS))
def test_props_stand_beside_the_road(kind):
    road = make_road(np.random.default_rng(1), kind, 150.0)
    made, again = (beside(road, np.random.default_rng(2)) for _ in range(2))
    assert len(made) > 5
    for a, b in zip(made, again, strict=True):
        assert (a.kind, a.seed, a.yaw) == (b.kind, b.seed, b.yaw)
        np.testing.assert_array_equal(a.position, b.position)
    _, d = road.locate([p.position[0] for p in made], [p.position[2] for p in made])
    beside_the_road = np.where(d > 0, d - road.layout.right, -d - road.layout.left) > 0.2
    in_the_middle = np.abs(d) < road.layout.median - 0.1
    assert (beside_the_road | in_the_middle).all()
    assert {p.kind for p in made} <= set(props.MAKERS)


def test_a_road_with_two_carriageways_has_something_between_them():
    found = set()
    for seed in range(30):
        road = make_road(np.random.default_rng(seed), "avenue", 150.0)
        made = beside(road, np.random.default_rng(seed))
        _, d = road.locate([p.position[0] for p in made], [p.position[2] for p in made])
        middle = [p for p, at in zip(made, d, strict=True) if abs(at) < 0.25]
        assert not middle or road.layout.median > 0.0
        assert all(p.size[1] < 1.7 for p in middle)  # oncoming roofs stay visible
        found |= {p.kind for p in middle}
    assert found == {"fence", "hedge", "rail"}


def test_cars_of_a_car_park_are_seen_over_or_through_what_is_before_them():
    found = set()
    for seed in range(40):
        road = make_road(np.random.default_rng(seed), "yard", 150.0)
        for p in beside(road, np.random.default_rng(seed)) if road.lots else ():
            s, d = (float(a[0]) for a in road.locate(*p.position[[0, 2]]))
            for lot in road.lots:
                side = lot.rows[0].side
                if lot.start + 16.0 < s < lot.end - 16.0 and 0.0 < side * d < abs(lot.rows[0].d):
                    found.add(p.kind)
    assert {"fence", "hedge", "wall"} <= found


def test_fences_of_bars_cover_a_part():
    covers = {name: props.cover("fence", i) for i, name in enumerate(props.FENCES)}
    assert covers["planks"] == 1.0
    assert 0.05 < covers["wire"] < covers["railing"] < covers["pickets"] < 0.8
    assert props.mesh("fence", props.FENCES.index("railing")).solid == 0
    assert props.mesh("fence", props.FENCES.index("planks")).solid > 0


@pytest.mark.parametrize("kind", list(props.MAKERS))
def test_prop_meshes(kind):
    for variant in range(len(props.MAKERS[kind])):
        mesh = props.mesh(kind, variant)
        assert np.isfinite(mesh.vertices).all()
        assert mesh.faces.max() < len(mesh.vertices)
        top, bottom = -mesh.vertices[:, 1].min(), -mesh.vertices[:, 1].max()
        assert 0.9 < top < 1.2
        assert bottom > -0.2  # twigs reach into the ground
        assert 0 <= mesh.solid <= len(mesh.faces)
        sizes = [len(faces) for _, faces, _ in prop_levels(kind, variant)]
        assert sizes == sorted(sizes, reverse=True)


def test_every_material_has_a_surface():
    assert set(SURFACES) == set(MATERIALS)
    base, layer = surface_tables()
    assert np.isfinite(base).all()
    assert np.isfinite(layer).all()


def test_paints_have_the_shares_of_the_street():
    looks = [look("car", seed) for seed in range(1500)]
    shares = np.array([share for *_, share in PAINTS])
    colourless = sum(max(p.paint) - min(p.paint) < 0.35 * max(p.paint) for p in looks) / len(looks)
    assert 0.6 < colourless < 0.9
    assert shares.sum() > 99.0
    assert look("car", 3) == look("car", 3)


def test_levels_of_a_body_keep_its_extent():
    made = body("car", 0)
    levels = vehicle_levels(made)
    low, high = made.vertices.min(axis=0), made.vertices.max(axis=0)
    counts = [len(faces) for _, faces, _ in levels]
    assert counts == sorted(counts, reverse=True)
    for (_, cell), (vertices, faces, _) in zip(BODY_LEVELS, levels, strict=True):
        used = vertices[np.unique(faces), :3]
        assert np.abs(used.min(axis=0) - low).max() <= cell + 1e-5
        assert np.abs(used.max(axis=0) - high).max() <= cell + 1e-5
    assert level_of(BODY_LEVELS, 1000.0) == 0
    assert level_of(BODY_LEVELS, 1.0) == len(BODY_LEVELS) - 1


@pytest.mark.parametrize("class_name", CLASSES)
def test_both_front_wheels_steer_at_every_level(class_name):
    made = body(class_name, 1)
    for vertices, faces, _ in vehicle_levels(made):
        used = vertices[np.unique(faces)]
        turning = used[used[:, 10] != 0.0]
        assert len(np.unique(turning[:, 10:], axis=0)) == 2
        away = np.abs(turning[:, None, :3] - made.wheels[:2, :3]).min(axis=1)
        assert np.all(away < [0.25, made.wheels[0, 3] + 0.02, made.wheels[0, 3] + 0.02])
        tyre = used[np.abs(used[:, 9] - MATERIALS.index("tyre")) < 0.5]
        front = np.abs(tyre[:, 2] - made.wheels[0, 2]) < 1.1 * made.wheels[0, 3]
        np.testing.assert_array_equal(tyre[:, 10] != 0.0, front)


def test_textures_have_all_layers():
    assert textures.layers().shape == (len(textures.LAYERS), SIZE, SIZE, 4)
    assert textures.layer("asphalt") == 1
