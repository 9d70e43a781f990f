"""Cameras of other tools: there and back, and what is refused."""

import json
import math

import groundpose as gp
import numpy as np
import pytest
from groundpose.formats.boxes import read_boxes
from groundpose.formats.calibrations import read_calibration
from groundpose.formats.camera_files import format_camera_info, format_nuscenes, format_opencv_yaml

CAMERAS = [
    gp.Camera(1000.5, 990.25, 640.125, 360.0),
    gp.Camera(721.5377, 721.5377, 609.5593, 172.854, image_size=(1242, 375)),
    gp.Camera(1e3 / 3, 400.0, 319.5, 239.5, (-0.31, 0.12, 1e-3, -2e-5, -0.02), (640, 480)),
    gp.Camera(500.0, 500.0, 319.5, 239.5, (0.4, -0.1, 1e-3, 0, 0.02, 0.7, 0.1, 0.01), (640, 480), "rational"),
    gp.Camera(300.0, 300.0, 319.5, 239.5, (-0.02, 0.01, -0.008, 0.002), (640, 480), "equidistant"),
    gp.Camera(300.0, 300.0, 319.5, 239.5, (0.0, 0.0, 0.0, 0.0), (640, 480), "equidistant"),
]
ROS2 = """header:
  frame_id: camera
height: 480
width: 640
distortion_model: plumb_bob
d:
- -0.31
- 0.12
- 0.001
- 0.0
- 0.0
k:
- 500.0
- 0.0
- 319.5
- 0.0
- 510.0
- 239.5
- 0.0
- 0.0
- 1.0
r:
- 1.0
p:
- 480.0
"""
# as nuScenes has it for CAM_FRONT
SENSOR = {
    "token": "1d31c729b073425e8e0202c5c6e66ee1",
    "sensor_token": "725903f5b62f56118f4094b46a4470d8",
    "translation": [1.70079118954, 0.0159456324149, 1.51095763913],
    "rotation": [0.4998015430569128, -0.5030316162024876, 0.4997798114386805, -0.49737083824542755],
    "camera_intrinsic": [
        [1266.417203046554, 0.0, 816.2670197447984],
        [0.0, 1266.417203046554, 491.50706579294757],
        [0.0, 0.0, 1.0],
    ],
}
LIDAR = {"token": "a", "translation": [0, 0, 1.8], "rotation": [1, 0, 0, 0], "camera_intrinsic": []}


def read(folder, text, name=None):
    path = folder / "camera"
    path.write_text(text if isinstance(text, str) else json.dumps(text))
    return read_calibration(path, name)


@pytest.mark.parametrize("camera", CAMERAS)
def test_yaml_round_trips(tmp_path, camera):
    for write in (format_opencv_yaml, format_camera_info):
        assert read(tmp_path, write(camera)) == gp.View(camera)


@pytest.mark.parametrize("camera", CAMERAS)
def test_opencv_reads_what_is_written(tmp_path, camera):
    cv2 = pytest.importorskip("cv2")
    path = tmp_path / "camera.yml"
    path.write_text(format_opencv_yaml(camera))
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(file.getNode("camera_matrix").mat(), camera.K)
    given = file.getNode("distortion_coefficients").mat().ravel()
    expected = camera.distortion or (0.0,) * 5
    np.testing.assert_array_equal(given, expected[: len(given)])
    assert not any(expected[len(given) :])


def test_a_message_of_ros_2_is_read(tmp_path):
    view = read(tmp_path, ROS2)
    expected = gp.Camera(500.0, 510.0, 319.5, 239.5, (-0.31, 0.12, 0.001, 0.0, 0.0), (640, 480))
    assert view == gp.View(expected)
    lines = ROS2.replace("k:\n- 500.0\n- 0.0\n", "k: [500.0, 0.0,\n  ").replace(
        "- 319.5\n- 0.0\n", "319.5, 0.0, "
    )
    lines = lines.replace("- 510.0\n- 239.5\n- 0.0\n- 0.0\n- 1.0\n", "510, 239.5, 0., 0., 1.]\n")
    assert read(tmp_path, lines) == view
    assert read(tmp_path, ROS2.replace("\n", "\r\n")) == view


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            ROS2.replace("plumb_bob", "equidistant").replace("- 0.0\nk", "- 0.1\nk"),
            "camera: d: expected four coefficients of a fisheye, got 5",
        ),
        (
            ROS2.replace("plumb_bob", "ftheta"),
            "camera: distortion_model: expected one of plumb_bob, .* or none",
        ),
        (ROS2.replace("- 510.0\n", ""), "camera: k: expected a 3 x 3 matrix, nine numbers, got 8 numbers"),
        (ROS2.replace("- 0.12\n", "- 0.12\n" * 4), "camera: d: expected none, 4 or 5 numbers .*, got 8"),
        (ROS2.replace("- 510.0", "- five"), r"camera: k\[4\]: expected numbers"),
        (ROS2.replace("- 510.0", "- -1.0"), "camera: k: fy"),
        (
            ROS2.replace("height: 480", "height: 480\nheight: 481"),
            "camera:4: expected YAML, got the key 'height' twice",
        ),
    ],
)
def test_bad_messages_are_refused(tmp_path, text, message):
    with pytest.raises(gp.InputError, match=message):
        read(tmp_path, text)


def test_nuscenes_cameras_are_read(tmp_path):
    for given in (SENSOR, [SENSOR], [LIDAR, SENSOR]):
        view = read(tmp_path, given)
        assert view.camera.fx == pytest.approx(1266.417203046554)
        assert view.height == pytest.approx(1.51095763913)
        assert abs(math.degrees(view.pitch)) < 1.0  # mounted almost level
        assert abs(math.degrees(view.roll)) < 1.0
    two = [SENSOR, {**SENSOR, "token": "other"}]
    with pytest.raises(gp.InputError, match=r"camera: expected the name of one of 1d31c.*, other, got none"):
        read(tmp_path, two)
    assert read(tmp_path, two, "other") == view
    with pytest.raises(gp.InputError, match="which 2 of them are called"):
        read(tmp_path, two, SENSOR["sensor_token"])


@pytest.mark.parametrize(("pitch", "roll"), [(0.0, 0.0), (-0.2, 0.03), (0.1, -0.4), (1.2, 0.0)])
def test_nuscenes_tilt_round_trips(tmp_path, pitch, roll):
    view = gp.View(CAMERAS[1], pitch, roll, 1.6)
    again = read(tmp_path, format_nuscenes(view))
    assert again.camera == view.camera
    assert (again.pitch, again.roll, again.height) == pytest.approx((pitch, roll, 1.6))
    bare = json.loads(format_nuscenes(view))
    del bare["rotation"], bare["translation"]
    assert read(tmp_path, bare) == gp.View(view.camera)


def test_every_format_is_told_by_its_content(tmp_path):
    view = gp.View(CAMERAS[1], -0.1, 0.02, 1.6)
    path = tmp_path / "any name"
    for text, expected in (
        (format_opencv_yaml(CAMERAS[2]), gp.View(CAMERAS[2])),
        (format_camera_info(CAMERAS[2]), gp.View(CAMERAS[2])),
        (ROS2, gp.View(gp.Camera(500.0, 510.0, 319.5, 239.5, (-0.31, 0.12, 0.001, 0.0, 0.0), (640, 480)))),
        (format_nuscenes(view), view),
    ):
        path.write_text(text)
        found = read_calibration(path)
        assert found.camera == expected.camera
        assert (found.pitch, found.roll) == pytest.approx((expected.pitch, expected.roll))


def test_boxes_of_nuscenes(tmp_path):
    rows = [
        {"filename": "samples/a.jpg", "bbox_corners": [1.5, 2, 30, 40], "category_name": "vehicle.car"},
        {
            "filename": "samples/a.jpg",
            "bbox_corners": [5, 6, 7, 8],
            "category_name": "human.pedestrian.adult",
        },
        {
            "filename": "samples/b.jpg",
            "bbox_corners": [0, 0, 9, 9],
            "category_name": "vehicle.bus.bendy",
            "sample_annotation_token": "abc",
        },
        {"filename": "samples/b.jpg", "bbox_corners": [0, 0, 9, 9], "category_name": "vehicle.bicycle"},
    ]
    path = tmp_path / "image_annotations.json"
    path.write_text(json.dumps(rows))
    found = read_boxes(path)
    assert [box.bbox for box in found.of("a.jpg").boxes] == [(1.5, 2, 30, 40), (5, 6, 7, 8)]
    assert [box.is_vehicle for box in found.of("a.jpg").boxes] == [True, False]
    assert [(box.name, box.id, box.is_vehicle) for box in found.of("samples/b.jpg").boxes] == [
        ("bus", "abc", True),
        ("bicycle", 1, False),
    ]
    rows[1]["bbox_corners"] = [1, 2]
    path.write_text(json.dumps(rows))
    assert "[1].bbox_corners: expected a list of 4" in read_boxes(path).skipped.lines()[0]


ROS_CALIBRATION = """image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [500.0, 0.0, 319.5, 0.0, 510.0, 239.5, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.31, 0.12, 0.001, 0.0, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [480, 0, 320, 0, 0, 480, 240, 0, 0, 0, 1, 0]
"""


def test_a_calibration_file_of_ros_is_read(tmp_path):
    path = tmp_path / "head_camera.yaml"
    expected = gp.Camera(500.0, 510.0, 319.5, 239.5, (-0.31, 0.12, 0.001, 0.0, 0.0), (640, 480))
    path.write_text(ROS_CALIBRATION)
    assert read_calibration(path) == gp.View(expected)
    path.write_text(ROS_CALIBRATION.replace("plumb_bob", "rational_polynomial"))
    assert read_calibration(path) == gp.View(expected), "three of its coefficients are 0"
    assert gp.Camera.from_file(path, "raw") == expected
    assert gp.Camera.from_file(path, "rectified") == gp.Camera(
        480.0, 480.0, 320.0, 240.0, image_size=(640, 480)
    )
    with pytest.raises(gp.InputError, match="one of narrow_stereo, narrow_stereo rectified, got 'left'"):
        gp.Camera.from_file(path, "left")
