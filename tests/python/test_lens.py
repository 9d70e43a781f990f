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
