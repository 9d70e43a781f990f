"""Vehicles drawn by hand: size, keypoints on the surface, only for training, as the converter makes them."""

import os
from pathlib import Path

import numpy as np
import pytest
from groundpose.lab.bodies import MATERIALS, STYLES, body, catalogue, keypoints_of, make_real_meshes, real
from groundpose.lab.bodies.real_keypoints import _nearest
from groundpose.lab.drive.splits import random_body
from groundpose.vehicles import CLASSES
from groundpose.vehicles.keypoints import flip_indices, keypoint_indices, keypoint_names

ALL = [(class_name, seed) for class_name in CLASSES for seed in real.seeds(class_name)]
SOURCE = Path(os.environ.get("GROUNDPOSE_DATA", Path(__file__).parents[3] / "shared" / "data"))
each = pytest.mark.parametrize(("class_name", "seed"), ALL)


@each
def test_keypoints_lie_on_the_surface_and_on_their_sides(class_name, seed):
    b = body(class_name, seed)
    triangles = b.vertices[b.faces]
    for point in b.keypoints_3d:
        assert np.linalg.norm(_nearest(triangles, point) - point) < 1e-3
    rows = keypoint_indices(class_name)
    partner = np.searchsorted(rows, flip_indices()[rows])
    np.testing.assert_allclose(b.keypoints_3d[partner] * [-1.0, 1.0, 1.0], b.keypoints_3d, atol=0.06)
    left = [i for i, name in enumerate(keypoint_names(class_name)) if name.startswith("left_")]
    assert np.all(b.keypoints_3d[left, 0] < 0.0)


@each
def test_keypoints_lie_on_the_parts_that_they_name(class_name, seed):
    b = body(class_name, seed)
    names = keypoint_names(class_name)
    for name, materials in {
        "headlamp": ("headlamp",),
        "taillamp": ("taillamp", "indicator"),
        "windscreen_top": ("glass",),
        "windscreen_bottom": ("glass",),
        "front_wheel": ("rim",),
        "rear_wheel": ("rim",),
        "mirror": ("plastic",),
    }.items():
        mine = np.isin(b.materials, [MATERIALS.index(m) for m in materials])
        for side in ("left", "right"):
            point = b.keypoints_3d[names.index(f"{side}_{name}")]
            away = np.linalg.norm(_nearest(b.vertices[b.faces[mine]], point) - point)
            assert away < make_real_meshes._TOLERANCE, (side, name)


@each
def test_size_is_that_of_real_vehicles(class_name, seed):
    b = body(class_name, seed)
    length, height, width = b.size
    assert catalogue.style_of(class_name, seed) == b.style
    assert b.style in STYLES[class_name]
    assert 1.6 < width < 2.15
    assert {"car": 3.5, "van_bus": 4.4, "pickup": 4.8}[class_name] < length < 7.3
    assert 1.3 < height < 2.6
    np.testing.assert_allclose(b.bbox_3d.sum(axis=0), [0.0, -height, 0.0], atol=1e-3)
    assert abs(b.vertices[:, 1].max()) < 0.01
    np.testing.assert_array_equal(keypoints_of(class_name, seed), b.keypoints_3d)
    np.testing.assert_allclose(np.linalg.norm(b.normals, axis=1), 1.0, atol=1e-3)


def test_only_training_uses_them_and_seldom():
    rng = np.random.default_rng(0)
    for class_name in CLASSES:
        for split in ("train", "validation", "test"):
            drawn = np.array([random_body(rng, class_name, split) for _ in range(2000)])
            fraction = np.isin(drawn, real.seeds(class_name)).mean()
            expected = split == "train" and len(real.seeds(class_name)) > 0
            assert (0.01 < fraction < 0.06) if expected else fraction == 0.0


def test_the_bundled_file_is_what_the_converter_makes():
    source = SOURCE / "vehicle_meshes.npz"
    if not source.exists():
        pytest.skip(f"{source} is missing")
    with np.load(source) as loaded, np.load(real.ASSET) as bundled:
        arrays = dict(loaded)
        for name in make_real_meshes.USES:
            for key, value in make_real_meshes.convert(arrays, name).items():
                np.testing.assert_allclose(bundled[f"{name}_{key}"], value, atol=1e-6)
    assert real.ASSET.stat().st_size < 300_000
