"""Lens models against OpenCV, and poses seen through them."""

import math

import groundpose as gp
import numpy as np
import pytest
from conftest import MODEL, rotation_y
from groundpose.lens import LENSES

OPENCV = {
    "brown_conrady of 4": ("brown_conrady", (-0.3, 0.1, 1e-3, -2e-3)),
    "brown_conrady of 5": ("brown_conrady", (-0.3, 0.1, 1e-3, -2e-3, 0.02)),
    "rational of 8": ("rational", (0.4, -0.1, 1e-3, -5e-4, 0.01, 0.3, 0.05, 0.02)),
    "thin prism": ("rational", (-0.2, 0.05, 1e-3, -5e-4, 0.01, 0.1, 0.02, 3e-3, 1e-3, -2e-3, 5e-4, 1e-4)),
    "tilted": (
        "rational",
        (-0.1, 0.05, 1e-3, -5e-4, 0.01, 0.1, 0.02, 3e-3, 1e-3, -2e-3, 5e-4, 1e-4, 0.03, -0.02),
    ),
    "fisheye": ("equidistant", (-0.02, 0.01, -0.008, 0.002)),
}
K = np.array([[600.0, 0.0, 640.0], [0.0, 610.0, 360.0], [0.0, 0.0, 1.0]])


def points(largest: float) -> np.ndarray:
    """Normalised coordinates (N, 2) up to this distance from the middle."""
    rng = np.random.default_rng(3)
    r, angle = largest * np.sqrt(rng.uniform(size=2000)), rng.uniform(0.0, 2.0 * np.pi, 2000)
    return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)


@pytest.mark.parametrize("case", OPENCV)
def test_lenses_are_those_of_opencv(case):
    cv2 = pytest.importorskip("cv2")
    lens, k = OPENCV[case]
    camera = gp.Camera.from_K(K, k, lens=lens)
    ideal = points(math.tan(math.radians(80.0)) if lens == "equidistant" else 0.9)
    pixels = ideal * K[[0, 1], [0, 1]] + K[:2, 2]
    if lens == "equidistant":
        seen = cv2.fisheye.distortPoints(ideal[:, None], K, np.array(k))[:, 0]
    else:
        rays = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1)
        seen = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array(k))[0][:, 0]
    focal = K[[0, 1], [0, 1]]
    assert np.abs((camera.distort(pixels) - seen) / focal).max() < 1e-9
    assert np.abs((camera.undistort(seen) - pixels) / focal).max() < 1e-9


def equidistant(ray, k1, k2, k3, k4):
    angle = math.atan2(math.hypot(ray[0], ray[1]), ray[2])
    return angle + k1 * angle**3 + k2 * angle**5 + k3 * angle**7 + k4 * angle**9


def double_sphere(ray, xi, alpha):
    z = xi + ray[2]
    return math.hypot(ray[0], ray[1]) / (alpha * math.hypot(ray[0], ray[1], z) + (1.0 - alpha) * z)


def omnidirectional(ray, xi, k1, k2, p1, p2):
    r = math.hypot(ray[0], ray[1]) / (ray[2] + xi)
    return r * (1.0 + k1 * r**2 + k2 * r**4)


def field_of_view(ray, omega):
    return math.atan(2.0 * math.tan(0.5 * omega) * math.hypot(ray[0], ray[1]) / ray[2]) / omega


WIDE = {
    "equidistant": (equidistant, (-0.01, 0.004, -0.002, 0.0003), 110.0),
    "double_sphere": (double_sphere, (-0.18, 0.59), 110.0),
    "omnidirectional": (omnidirectional, (1.4, -0.1, 0.05, 0.0, 0.0), 110.0),
    "field_of_view": (field_of_view, (0.9,), 88.0),
}
"""How far from the middle a direction of length 1 is seen, as the papers say it; coefficients; degrees from
the axis."""


def directions(degrees: float) -> np.ndarray:
    """Directions (N, 3) of length 1 up to this angle from the axis."""
    rng = np.random.default_rng(4)
    angle, around = np.radians(rng.uniform(0.0, degrees, 1000)), rng.uniform(0.0, 2.0 * np.pi, 1000)
    x, y = np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around)
    return np.stack([x, y, np.cos(angle)], axis=1)


@pytest.mark.parametrize("name", WIDE)
def test_wide_lenses_are_those_of_the_papers(name):
    distance, k, limit = WIDE[name]
    camera, rays = gp.Camera.from_K(K, k, lens=name), directions(limit)
    seen = (camera.image_of(7.0 * rays) - K[:2, 2]) / K[[0, 1], [0, 1]]
    expected = [distance(ray, *k) / math.hypot(ray[0], ray[1]) * ray[:2] for ray in rays]
    assert np.abs(seen - expected).max() < 1e-12
    assert np.abs(camera.directions_of(camera.image_of(rays)) - rays).max() < 1e-9
    ahead = rays[rays[:, 2] > 0.05]
    np.testing.assert_allclose(camera.distort(camera.project(ahead)), camera.image_of(ahead), atol=1e-9)
    np.testing.assert_allclose(camera.undistort(camera.image_of(ahead)), camera.project(ahead), rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "k"),
    [(name, k) for name, (_, k, _) in WIDE.items()] + [("brown_conrady", (-0.3, 0.0, 0.0, 0.0))],
)
def test_what_a_lens_does_not_show_is_nan_and_never_something_else(name, k):
    camera = gp.Camera.from_K(K, k, lens=name)
    rays = np.concatenate([directions(180.0), [[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [np.nan, 0.0, 1.0]]])
    pixels = camera.image_of(rays)
    shown = np.isfinite(pixels).all(axis=1)
    assert 100 < shown.sum() < len(rays)
    assert not shown[-3:].any()
    assert np.isnan(pixels[~shown]).all()
    np.testing.assert_allclose(camera.directions_of(pixels[shown]), rays[shown], atol=1e-9)
    far = np.array([[1e5, 360.0], [np.nan, 0.0]])
    assert np.isnan(camera.directions_of(far)).all()
    assert camera.image_of(np.zeros((2, 3, 3))).shape == (2, 3, 2)


def test_an_ideal_camera_shows_what_it_projects():
    camera, rays = gp.Camera.from_K(K), directions(180.0)
    np.testing.assert_array_equal(camera.image_of(rays), camera.project(rays))
    seen = camera.image_of(rays)
    shown = np.isfinite(seen).all(axis=1)
    np.testing.assert_allclose(camera.directions_of(seen[shown]), rays[shown], atol=1e-12)


@pytest.mark.parametrize(
    ("name", "k", "text"),
    [
        ("double_sphere", (-1.0, 0.5), "xi > -1"),
        ("double_sphere", (0.0, 1.1), "alpha from 0 to 1"),
        ("field_of_view", (0.0,), "omega between 0 and pi"),
        ("omnidirectional", (-0.1, 0.0, 0.0, 0.0, 0.0), "xi of 0 or more"),
    ],
)
def test_coefficients_that_cannot_be(name, k, text):
    with pytest.raises(gp.InputError, match=f"distortion: expected {text}"):
        gp.Camera.from_K(K, k, lens=name)


def street(lens: str, k: tuple[float, ...]) -> tuple[gp.View, np.ndarray, np.ndarray, np.ndarray]:
    """A view through a lens; keypoints (N, P, 2), boxes (N, 4) and places (N, 3) of cars all round it."""
    camera = gp.Camera(330.0, 330.0, 959.5, 639.5, k, (1920, 1280), lens)
    view = gp.View(camera, pitch=-0.1, roll=0.02, height=1.6)
    bearings = np.radians([-93.0, -70.0, -45.0, -15.0, 20.0, 50.0, 75.0, 94.0])
    distances = np.array([6.0, 8.0, 12.0, 20.0, 15.0, 9.0, 7.0, 5.0])
    places = np.stack([distances * np.sin(bearings), np.full(8, 1.6), distances * np.cos(bearings)], axis=1)
    (low, high), ends = MODEL.bbox_3d, np.linspace(0.0, 1.0, 41)[:, None, None]
    corners = np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    R, pixels, boxes = view.R_camera_from_ground, [], []
    for place, yaw in zip(places, np.linspace(0.3, 6.0, 8), strict=True):
        to_camera = lambda p, yaw=yaw, place=place: (p @ rotation_y(np.array(yaw)).T + place) @ R.T  # noqa: E731
        pixels.append(camera.image_of(to_camera(MODEL.keypoints_3d)))
        edges = camera.image_of(to_camera(corners + ends * (corners[:, None, None] - corners)))
        flat = edges.reshape(-1, 2)
        boxes.append([*flat.min(axis=0), *flat.max(axis=0)])
    return view, np.array(pixels), np.array(boxes), places @ R.T


@pytest.mark.parametrize("name", ["equidistant", "double_sphere", "omnidirectional"])
def test_cars_all_round_a_wide_lens_are_where_they_are(name):
    view, pixels, boxes, places = street(name, WIDE[name][1])
    poses = gp.estimate_poses(view, pixels, boxes, MODEL)
    assert poses.ok.all()
    assert not poses.remarks
    np.testing.assert_allclose(poses.t, places, atol=2e-3)
    assert (poses.t[[0, -1], 2] < 0.0).all(), "behind the plane of the camera"
    one = gp.estimate_poses(view, pixels[-1:], boxes[-1:], MODEL, threads=1)
    np.testing.assert_allclose(one.covariance[0], one.covariance[0].T)
    assert one.covariance[0, 3, 3] > 4.0 * one.covariance[0, 5, 5], "the distance, to the side, is least sure"


@pytest.mark.parametrize("name", LENSES)
def test_coefficients_at_the_end_may_be_left_out(name):
    model = LENSES[name]
    k = tuple(0.01 * (i + 1) for i in range(model.counts[0]))
    camera = gp.Camera.from_K(K, k, lens=name)
    assert len(camera.distortion) == len(model.coefficients)
    assert model.shortest(camera.distortion) == k
    with pytest.raises(gp.InputError, match=r"distortion: expected shape"):
        gp.Camera.from_K(K, k[:-1], lens=name)


@pytest.mark.parametrize(
    ("lens", "degrees"),
    [("rational", 0.0), ("rational", 25.0), ("rational", 40.0)]
    + [("equidistant", angle) for angle in (0.0, 25.0, 40.0, 60.0)],
)
def test_a_car_seen_through_the_lens_is_where_it_is(lens, degrees):
    k = (-0.02, 0.01, -0.008, 0.002) if lens == "equidistant" else (0.4, -0.1, 0, 0, 0.01, 0.3, 0.05, 0.02)
    camera, angle = gp.Camera.from_K(K, k, lens=lens), math.radians(degrees)
    view, yaw = gp.View(camera, pitch=-0.05), 0.7
    ground = rotation_y(np.array(yaw))
    place = np.array([15.0 * math.sin(angle), 1.5, 15.0 * math.cos(angle)])
    corners = np.array([[x, y, z] for x in (-0.9, 0.9) for y in (-1.5, 0.0) for z in (-2.25, 2.25)])
    R = view.R_camera_from_ground
    pixels, outline = (
        camera.distort(camera.project((p @ ground.T + place) @ R.T)) for p in (MODEL.keypoints_3d, corners)
    )
    bbox = [*outline.min(axis=0), *outline.max(axis=0)]
    pose = gp.estimate_poses(view, pixels[None], [bbox], MODEL)[0]
    assert pose.status == "ok"
    np.testing.assert_allclose(pose.t, R @ place, atol=0.05)
