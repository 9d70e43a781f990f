"""Camera and view: constructors and geometry against their definitions."""

import dataclasses

import groundpose as gp
import numpy as np
import pytest
from conftest import CAMERA


def test_camera_constructors(tmp_path):
    camera = gp.Camera(fx=700, fy=710.5, cx=np.float32(320.5), cy=240, image_size=(640, 480))
    np.testing.assert_array_equal(camera.K, [[700, 0, 320.5], [0, 710.5, 240], [0, 0, 1]])
    assert gp.Camera.from_K(camera.K, image_size=(640, 480)) == camera
    assert hash(gp.Camera.from_K(camera.K.tolist(), image_size=[640, 480])) == hash(camera)
    wide = gp.Camera.from_fov(640, 480, np.radians(90.0))
    assert (wide.fx, wide.cx, wide.cy, wide.image_size) == (pytest.approx(320.0), 319.5, 239.5, (640, 480))

    kitti = tmp_path / "000001.txt"
    kitti.write_text("P0: 1 0 0 0 0 1 0 0 0 0 1 0\nP2: 721.5 0 609.6 44.9 0 721.5 172.9 0.2 0 0 1 0.003\n")
    camera = gp.Camera.from_kitti(kitti, image_size=(1242, 375))
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (721.5, 721.5, 609.6, 172.9)
    raw = tmp_path / "calib_cam_to_cam.txt"
    raw.write_text("calib_time: 09-Jan\nP_rect_02: 7.2e+02 0 6.1e+02 4 0 7.2e+02 1.7e+02 0 0 0 1 0\n")
    assert gp.Camera.from_kitti(raw).fx == 720.0


OPENCV_YAML = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.1e+02, 0., 319., 0., 5.2e+02,
       239.5, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.2, 0.05, 1.0e-03, 0., 0.01 ]
"""


def test_camera_from_opencv_yaml(tmp_path):
    file = tmp_path / "camera.yml"
    file.write_text(OPENCV_YAML)
    camera = gp.Camera.from_opencv_yaml(file)
    assert camera == gp.Camera(510.0, 520.0, 319.0, 239.5, (-0.2, 0.05, 0.001, 0.0, 0.01), (640, 480))
    cv2 = pytest.importorskip("cv2")
    writer = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
    writer.write("camera_matrix", camera.K)
    writer.write("distortion_coefficients", np.array([-0.2, 0.05, 0.001, 0.0, 0.01]))
    writer.release()
    assert gp.Camera.from_opencv_yaml(file) == dataclasses.replace(camera, image_size=None)


def test_view_geometry():
    pitch, roll = 0.2, -0.1
    view = gp.View(CAMERA, pitch, roll, height=2.0)
    c, s = np.cos, np.sin
    R_z = np.array([[c(roll), -s(roll), 0], [s(roll), c(roll), 0], [0, 0, 1]])
    R_x = np.array([[1, 0, 0], [0, c(-pitch), -s(-pitch)], [0, s(-pitch), c(-pitch)]])
    R = view.R_camera_from_ground
    np.testing.assert_allclose(R, R_z @ R_x, atol=1e-12)
    again = gp.View.from_gravity(CAMERA, 9.81 * R[:, 1], height=2.0)
    assert (again.pitch, again.roll, again.height) == (pytest.approx(pitch), pytest.approx(roll), 2.0)

    # Directions along the ground end on the horizon.
    far = np.stack([[s(a), 0.0, c(a)] for a in (-0.4, 0.0, 0.3)]) @ R.T
    a, b, k = view.horizon()
    np.testing.assert_allclose(view.project(far) @ (a, b) + k, 0.0, atol=1e-8)
    level = gp.View(CAMERA, pitch)
    assert level.horizon()[2] / level.horizon()[1] == pytest.approx(-(CAMERA.cy + CAMERA.fy * np.tan(pitch)))

    # Points of the planes through two columns project to these columns; inside is between them.
    left, right = view.side_planes(200.0, 900.0)
    for column, normal in ((200.0, left), (900.0, right)):
        rays = np.array([[(column - CAMERA.cx) / CAMERA.fx, y, 1.0] for y in (-0.3, 0.4)])
        np.testing.assert_allclose(rays @ R @ normal, 0.0, atol=1e-12)
        assert np.linalg.norm(normal) == pytest.approx(1.0)
    inside = np.array([(550.0 - CAMERA.cx) / CAMERA.fx, 0.1, 1.0]) @ R
    assert inside @ left > 0.0
    assert inside @ right > 0.0
    assert np.isnan(view.project([[0.0, 0.0, -1.0]])).all()


@pytest.mark.parametrize("leading", [(), (1,), (0,), (4,), (2, 0, 3), (2, 3, 4)])
def test_rays_are_the_inverse_of_project(leading):
    rng = np.random.default_rng(5)
    points = rng.normal(size=(*leading, 3)) * [3.0, 1.0, 5.0] + [0.0, 0.0, 30.0]
    pixels = CAMERA.project(points)
    assert pixels.shape == (*leading, 2)
    homogeneous = points @ CAMERA.K.T
    np.testing.assert_allclose(pixels, homogeneous[..., :2] / homogeneous[..., 2:], rtol=1e-12)
    rays = CAMERA.rays(pixels)
    assert rays.shape == (*leading, 3)
    np.testing.assert_allclose(rays * points[..., 2:], points, rtol=1e-9, atol=1e-9)


def test_project_takes_lists_and_views_of_arrays():
    points = np.random.default_rng(6).uniform(1.0, 9.0, (5, 3, 2))
    turned = np.moveaxis(points, 1, 2)
    np.testing.assert_array_equal(CAMERA.project(turned), CAMERA.project(turned.tolist()))
    np.testing.assert_array_equal(CAMERA.project(turned[1]), gp.View(CAMERA).project(turned[1]))
    behind = CAMERA.project([[[0.0, 0.0, 2.0]], [[0.0, 0.0, -2.0]]])
    np.testing.assert_array_equal(behind, [[[CAMERA.cx, CAMERA.cy]], [[np.nan, np.nan]]])


def test_project_and_rays_are_those_of_an_ideal_lens():
    bent = dataclasses.replace(CAMERA, distortion=(-0.3, 0.1, 0.0, 0.0))
    assert bent.distortion == (-0.3, 0.1, 0.0, 0.0, 0.0)
    np.testing.assert_array_equal(bent.project([1.0, 0.5, 4.0]), CAMERA.project([1.0, 0.5, 4.0]))
    np.testing.assert_array_equal(bent.rays([100.0, 50.0]), CAMERA.rays([100.0, 50.0]))


def test_the_name_of_a_lens_is_a_part_of_the_camera():
    named = gp.Camera(500.0, 500.0, 320.0, 240.0, (-0.3, 0.1, 0.0, 0.0), lens="brown_conrady")
    assert named == gp.Camera.from_K(named.K, (-0.3, 0.1, 0.0, 0.0), lens=named.lens)
    assert named.lens == CAMERA.lens
    with pytest.raises(TypeError, match="lens: expected a str"):
        gp.Camera(500.0, 500.0, 320.0, 240.0, lens=None)
