"""Camera files of other tools: each read exactly, or refused with the file, the key, expected and got."""

import json
import math
import time

import groundpose as gp
import numpy as np
import pytest
from groundpose.formats.calibrations import CALIBRATIONS, read_calibration

F, CX, CY, SIZE = 1203.5, 639.25, 361.5, (1280, 720)
K = [[F, 0.0, CX], [0.0, F, CY], [0.0, 0.0, 1.0]]
FLAT = [number for row in K for number in row]
IDEAL = gp.Camera(F, F, CX, CY, image_size=SIZE)
BENT = gp.Camera(F, F, CX, CY, (-0.21, 0.08, 0.001, -0.0005, 0.0), SIZE)
FISHEYE = gp.Camera(F, F, CX, CY, (-0.02, 0.01, -0.008, 0.002), SIZE, "equidistant")
SIDES = "image_width: 1280\nimage_height: 720\n"


def opencv_matrix(name, rows, cols, data):
    return f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: {data}\n"


OPENCV_K = opencv_matrix("camera_matrix", 3, 3, FLAT)
KALIBR = f"""cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.21, 0.08, 0.001, -0.0005]
  distortion_model: radtan
  intrinsics: [{F}, {F}, {CX}, {CY}]
  resolution: [1280, 720]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [-0.02, 0.01, -0.008, 0.002]
  distortion_model: equidistant
  intrinsics: [{F}, {F}, {CX}, {CY}]
  resolution: [1280, 720]
"""
EUROC = f"""sensor_type: camera
comment: VI-Sensor cam0 (MT9M034)
T_BS:
  cols: 4
  rows: 4
  data: [0.01, -0.99, 0.004, -0.02, 0.99, 0.01, 0.02, -0.06, -0.02, 0.003, 0.99, 0.009, 0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [1280, 720]
camera_model: pinhole
intrinsics: [{F}, {F}, {CX}, {CY}] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.21, 0.08, 0.001, -0.0005]
"""
ORB = f"""%YAML:1.0
File.version: "1.0"
Camera.type: "PinHole"
Camera1.fx: {F}
Camera1.fy: {F}
Camera1.cx: {CX}
Camera1.cy: {CY}
Camera1.k1: -0.21
Camera1.k2: 8e-2
Camera1.p1: 1.0e-3
Camera1.p2: -5e-4
Camera.width: 1280
Camera.height: 720
Camera.fps: 20
Camera.RGB: 1
ORBextractor.nFeatures: 1000
"""
ORB_2 = ORB.replace("Camera1", "Camera").replace('File.version: "1.0"\nCamera.type: "PinHole"\n', "")
ORB_FISHEYE = ORB_2.replace("Camera.fx", 'Camera.type: "KannalaBrandt8"\nCamera.fx').replace(
    "Camera.k1: -0.21\nCamera.k2: 8e-2\nCamera.p1: 1.0e-3\nCamera.p2: -5e-4\n",
    "Camera.k1: -0.02\nCamera.k2: 0.01\nCamera.k3: -0.008\nCamera.k4: 0.002\n",
)
STELLA = f"""Camera:
  name: "street"
  setup: "monocular"
  model: "fisheye"
  fx: {F}
  fy: {F}
  cx: {CX}
  cy: {CY}
  k1: -0.02
  k2: 0.01
  k3: -0.008
  k4: 0.002
  fps: 30.0
  cols: 1280
  rows: 720
  color_order: "RGB"
Preprocessing:
  min_size: 800
"""
VINS = f"""%YAML:1.0
---
model_type: PINHOLE
camera_name: camera
image_width: 1280
image_height: 720
distortion_parameters:
   k1: -0.21
   k2: 0.08
   p1: 0.001
   p2: -0.0005
projection_parameters:
   fx: {F}
   fy: {F}
   cx: {CX}
   cy: {CY}
"""
VINS_FISHEYE = f"""%YAML:1.0
---
model_type: KANNALA_BRANDT
image_width: 1280
image_height: 720
projection_parameters:
   k2: -0.02
   k3: 0.01
   k4: -0.008
   k5: 0.002
   mu: {F}
   mv: {F}
   u0: {CX}
   v0: {CY}
"""
MEI = """%YAML:1.0
model_type: MEI
image_width: 1400
image_height: 1400
mirror_parameters:
   xi: 2.2
distortion_parameters: {k1: 0.01, k2: 1.6, p1: 0.0, p2: 0.0}
projection_parameters: {gamma1: 1336, gamma2: 1335, u0: 716, v0: 705}
"""
SPHERES = gp.Camera(160.0, 160.5, 254.0, 257.0, (-0.18, 0.59), (512, 512), "double_sphere")
MIRROR = gp.Camera(1336.0, 1335.0, 716.0, 705.0, (2.2, 0.01, 1.6, 0.0, 0.0), (1400, 1400), "omnidirectional")
KALIBR_DS = """cam0:
  camera_model: ds
  intrinsics: [-0.18, 0.59, 160.0, 160.5, 254.0, 257.0]
  distortion_model: none
  distortion_coeffs: []
  resolution: [512, 512]
"""
KALIBR_OMNI = """cam0:
  camera_model: omni
  intrinsics: [2.2, 1336.0, 1335.0, 716.0, 705.0]
  distortion_model: radtan
  distortion_coeffs: [0.01, 1.6, 0.0, 0.0]
  resolution: [1400, 1400]
"""
_BASALT_DS = {"fx": 160.0, "fy": 160.5, "cx": 254.0, "cy": 257.0, "xi": -0.18, "alpha": 0.59}
_BASALT_KB4 = {"fx": F, "fy": F, "cx": CX, "cy": CY, "k1": -0.02, "k2": 0.01, "k3": -0.008, "k4": 0.002}
BASALT = {
    "value0": {
        "T_imu_cam": [{"px": 0.0, "qw": 1.0}] * 2,
        "intrinsics": [
            {"camera_type": "ds", "intrinsics": _BASALT_DS},
            {"camera_type": "kb4", "intrinsics": _BASALT_KB4},
        ],
        "resolution": [[512, 512], [1280, 720]],
        "calib_accel_bias": [0.0] * 9,
    }
}
AUTOWARE = (
    "%YAML:1.0\n---\n"
    + opencv_matrix("CameraExtrinsicMat", 4, 4, [1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0])
    + opencv_matrix("CameraMat", 3, 3, FLAT)
    + opencv_matrix("DistCoeff", 1, 5, [-0.21, 0.08, 0.001, -0.0005, 0.0])
    + "ImageSize: [ 1280, 720 ]\nReprojectionError: 0.\n"
)
OPENCV_XML = f"""<?xml version="1.0"?>
<opencv_storage>
<calibration_time>"Tue 01 Jan"</calibration_time>
<image_width>1280</image_width>
<image_height>720</image_height>
<camera_matrix type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    {" ".join(map(str, FLAT[:5]))}
    {" ".join(map(str, FLAT[5:]))}</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix">
  <rows>5</rows>
  <cols>1</cols>
  <dt>d</dt>
  <data>
    -2.1e-01 8.0e-02 1e-3 -5e-4 0.</data></distortion_coefficients>
</opencv_storage>
"""
OPENCV_JSON = {
    **{"image_width": 1280, "image_height": 720},
    "camera_matrix": {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d", "data": FLAT},
    "distortion_coefficients": {"rows": 4, "cols": 1, "dt": "d", "data": [-0.21, 0.08, 0.001, -0.0005]},
}
STEREO = (
    "%YAML:1.0\n---\n"
    + opencv_matrix("M1", 3, 3, FLAT)
    + opencv_matrix("D1", 1, 5, [-0.21, 0.08, 0.001, -0.0005, 0.0])
    + opencv_matrix("M2", 3, 3, [900.0, 0.0, 600.0, 0.0, 901.0, 350.0, 0.0, 0.0, 1.0])
    + opencv_matrix("D2", 1, 5, [0.1, 0.0, 0.0, 0.0, 0.0])
)
RAW_KITTI = f"""calib_time: 09-Jan-2012 13:57:47
corner_dist: 9.950000e-02
S_02: 1392 512
K_02: 960 0 690 0 955 240 0 0 1
D_02: -0.36 0.19 0.001 0.0005 -0.06
S_rect_02: 1280 720
P_rect_02: {F} 0 {CX} 44.8 0 {F} {CY} 0.2 0 0 1 0.003
S_rect_03: 1280 720
P_rect_03: 700 0 600 -330 0 700 170 2.3 0 0 1 0.003
"""
KITTI_360 = RAW_KITTI.replace("_03", "_00").replace("_02", "_01")
CITYSCAPES = {
    "extrinsic": {"baseline": 0.2, "pitch": 0.05, "roll": 0.01, "x": 1.7, "y": 0.1, "yaw": -0.02, "z": 1.22},
    "intrinsic": {"fx": F, "fy": F, "u0": CX, "v0": CY},
}
WAYMO = {
    **{"name": "FRONT", "intrinsic": [F, F, CX, CY, -0.21, 0.08, 0.001, -0.0005, 0.0]},
    **{"width": 1280, "height": 720},
    # looks forward and 0.1 rad down: x forward, y left, z up
    "extrinsic": {
        "transform": [
            *(math.cos(0.1), 0.0, math.sin(0.1), 1.5),
            *(0.0, 1.0, 0.0, 0.0, -math.sin(0.1), 0.0, math.cos(0.1), 2.1, 0.0, 0.0, 0.0, 1.0),
        ]
    },
}
ARGOVERSE = {
    "camera_data_": [
        {
            "key": f"image_raw_ring_{name}",
            "value": {
                **{"focal_length_x_px_": F, "focal_length_y_px_": F, "focal_center_x_px_": CX},
                **{"focal_center_y_px_": CY, "skew_": 0, "distortion_coefficients_": [-0.17, 0.12, -0.03]},
                "vehicle_SE3_camera_": {
                    "rotation": {"coefficients": [0.5, -0.5, 0.5, -0.5]},
                    "translation": [1.6, 0.0, 1.4],
                },
            },
        }
        for name in ("front_center", "rear_left")
    ]
}
COLMAP = f"""# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
1 OPENCV 1280 720 {F} {F} {CX + 0.5} {CY + 0.5} -0.21 0.08 0.001 -0.0005
2 OPENCV_FISHEYE 1280 720 {F} {F} {CX + 0.5} {CY + 0.5} -0.02 0.01 -0.008 0.002
7 SIMPLE_RADIAL 1280 720 {F} {CX + 0.5} {CY + 0.5} 0
"""
OPEN3D = {
    "class_name": "PinholeCameraParameters",
    "extrinsic": np.eye(4).ravel().tolist(),
    "intrinsic": {"width": 1280, "height": 720, "intrinsic_matrix": np.array(K).T.ravel().tolist()},
}
REALSENSE = {
    **{"width": 1280, "height": 720, "ppx": CX, "ppy": CY, "fx": F, "fy": F},
    **{"model": "distortion.inverse_brown_conrady", "coeffs": [0.0] * 5},
}
MATLAB = {
    "IntrinsicMatrix": [[F, 0, 0], [0, F, 0], [CX + 1, CY + 1, 1]],
    **{"FocalLength": [F, F], "PrincipalPoint": [CX + 1, CY + 1], "Skew": 0, "ImageSize": [720, 1280]},
    **{"RadialDistortion": [-0.21, 0.08], "TangentialDistortion": [0.001, -0.0005]},
}
CARLA = {"image_size_x": "1280", "image_size_y": "720", "fov": "90", "lens_k": "-1.0", "lens_x_size": "0.08"}

READ = {
    "Kalibr, first": (KALIBR, "cam0", BENT),
    "Kalibr, fisheye": (KALIBR, "cam1", FISHEYE),
    "EuRoC": (EUROC, None, BENT),
    "ORB-SLAM2": (ORB_2, None, BENT),
    "ORB-SLAM2, fisheye": (ORB_FISHEYE, None, FISHEYE),
    "stella_vslam": (STELLA, None, FISHEYE),
    "stella_vslam by its name": (STELLA, "street", FISHEYE),
    "VINS": (VINS, None, BENT),
    "VINS, fisheye": (VINS_FISHEYE, None, FISHEYE),
    "KITTI-360's and camodocal's MEI": (MEI, None, MIRROR),
    "Kalibr, omni": (KALIBR_OMNI, None, MIRROR),
    "Kalibr, ds": (KALIBR_DS, None, SPHERES),
    "Kalibr, fov": (
        KALIBR_DS.replace("ds", "pinhole")
        .replace("[-0.18, 0.59, ", "[")
        .replace("none", "fov")
        .replace("[]", "[0.9]"),
        None,
        gp.Camera(160.0, 160.5, 254.0, 257.0, (0.9,), (512, 512), "field_of_view"),
    ),
    "Basalt, ds": (BASALT, "cam0", SPHERES),
    "Basalt, kb4": (BASALT, "1", FISHEYE),
    "Autoware.AI": (AUTOWARE, None, BENT),
    "OpenCV's XML": (OPENCV_XML, None, BENT),
    "OpenCV's JSON": (OPENCV_JSON, None, BENT),
    "OpenCV's fisheye": (
        f"%YAML:1.0\n---\n{SIDES}fisheye_model: 1\n{OPENCV_K}"
        + opencv_matrix("distortion_coefficients", 4, 1, [-0.02, 0.01, -0.008, 0.002]),
        None,
        FISHEYE,
    ),
    "no fisheye of OpenCV": (f"{SIDES}fisheye_model: 0\n{OPENCV_K}", None, IDEAL),
    "stereo, left": (STEREO, "left", gp.Camera(F, F, CX, CY, BENT.distortion)),
    "stereo, M2": (STEREO, "M2", gp.Camera(900.0, 901.0, 600.0, 350.0, (0.1, 0.0, 0.0, 0.0, 0.0))),
    "raw KITTI": (RAW_KITTI, None, IDEAL),
    "raw KITTI by number": (RAW_KITTI, "03", gp.Camera(700.0, 700.0, 600.0, 170.0, image_size=SIZE)),
    "raw KITTI before rectification": (
        RAW_KITTI,
        "K_02",
        gp.Camera(960.0, 955.0, 690.0, 240.0, (-0.36, 0.19, 0.001, 0.0005, -0.06), (1392, 512)),
    ),
    "KITTI-360": (KITTI_360, "P_rect_01", IDEAL),
    "KITTI with a tab": (
        f"P2:\t{F}\t0\t{CX}\t0\t0\t{F}\t{CY}\t0\t0\t0\t1\t0\n",
        None,
        gp.Camera(F, F, CX, CY),
    ),
    "KITTI without a blank": (f"P2:{F} 0 {CX} 0 0 {F} {CY} 0 0 0 1 0\n", "P2", gp.Camera(F, F, CX, CY)),
    "COLMAP": (COLMAP, "1", BENT),
    "COLMAP, fisheye": (COLMAP, "2", FISHEYE),
    "COLMAP without a lens": (COLMAP, "7", IDEAL),
    "COLMAP, FOV": (
        f"1 FOV 1280 720 {F} {F} {CX + 0.5} {CY + 0.5} 0.9\n",
        None,
        gp.Camera(F, F, CX, CY, (0.9,), SIZE, "field_of_view"),
    ),
    "Open3D": (OPEN3D, None, IDEAL),
    "RealSense": (REALSENSE, None, IDEAL),
    "RealSense's streams": ({"color": REALSENSE, "depth": {**REALSENSE, "fx": 600}}, "color", IDEAL),
    "MATLAB": (MATLAB, None, BENT),
    "CARLA": (CARLA, None, gp.Camera.from_fov(1280, 720, math.radians(90.0))),
    "K": ({"K": K}, None, gp.Camera(F, F, CX, CY)),
    "K, flat, and D": ({"K": FLAT, "D": BENT.distortion, "width": 1280, "height": 720}, None, BENT),
    "camera_matrix": ({"camera_matrix": K, "dist_coeffs": [list(BENT.distortion)]}, None, None),
    "one of several": ({"front": {"K": K}, "rear": {"K": [*FLAT[:-1], 1]}}, "front", gp.Camera(F, F, CX, CY)),
    "fx in YAML": (f"fx: {F}\nfy: {F}\ncx: {CX}\ncy: {CY}\nwidth: 1280\nheight: 720\n", None, IDEAL),
}


def write(folder, content):
    path = folder / "camera.any"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


@pytest.mark.parametrize("case", READ)
def test_files_of_tools_are_read(case, tmp_path):
    content, name, expected = READ[case]
    expected = expected or gp.Camera(F, F, CX, CY, BENT.distortion)
    assert gp.Camera.from_file(write(tmp_path, content), name) == expected


def test_the_table_names_each_format_once():
    assert len({row.name for row in CALIBRATIONS}) == len(CALIBRATIONS)
    assert all((row.in_record is None) != (row.in_text is None) for row in CALIBRATIONS)


@pytest.mark.parametrize(
    ("content", "names"),
    [
        (KALIBR, "cam0, cam1"),
        (BASALT, "value0 cam0, value0 cam1"),
        (KITTI_360, "K_01, P_rect_01, P_rect_00"),
        (COLMAP, "1, 2, 7"),
        (STEREO, "1, 2"),
        (ARGOVERSE, "image_raw_ring_front_center, image_raw_ring_rear_left"),
        ({"left": {"K": K, "P": [[1, 0, 2, 3]] * 3}, "right": {"K": K}}, "left, right"),
        ([{"name": "a", "K": K}, {"name": "b", "K": K}], "a, b"),
    ],
)
def test_several_cameras_are_listed(content, names, tmp_path):
    path = write(tmp_path, content)
    with pytest.raises(
        gp.InputError, match=f"camera.any: camera: expected the name of one of {names}, got none"
    ):
        read_calibration(path)
    with pytest.raises(gp.InputError, match=r"the name of one of .*, got 'nobody'"):
        read_calibration(path, "nobody")


def test_angles_of_data_sets(tmp_path):
    view = read_calibration(write(tmp_path, CITYSCAPES))
    assert (view.pitch, view.height) == (pytest.approx(-0.05, abs=1e-3), 1.22)
    # a positive roll lifts the camera's left side: it turns clockwise, which is negative here
    assert view.roll == pytest.approx(-0.01, abs=1e-3)
    view = read_calibration(write(tmp_path, WAYMO))
    assert (view.camera, view.pitch, view.roll) == (BENT, pytest.approx(-0.1), pytest.approx(0.0))
    view = read_calibration(write(tmp_path, ARGOVERSE), "image_raw_ring_rear_left")
    assert view.camera == gp.Camera(F, F, CX, CY)
    assert (view.pitch, view.roll) == (pytest.approx(0.0), pytest.approx(0.0))


def test_channels_of_nuscenes_stand_in_the_file_beside(tmp_path):
    sensors = [{"token": "s1", "channel": "CAM_FRONT"}, {"token": "s2", "channel": "CAM_BACK"}]
    rows = [{"token": f"c{i}", "sensor_token": f"s{i}", "camera_intrinsic": K} for i in (1, 2)]
    (tmp_path / "sensor.json").write_text(json.dumps(sensors))
    (tmp_path / "calibrated_sensor.json").write_text(json.dumps(rows))
    assert gp.Camera.from_file(tmp_path / "calibrated_sensor.json", "CAM_BACK") == gp.Camera(F, F, CX, CY)
    with pytest.raises(gp.InputError, match="one of CAM_FRONT, CAM_BACK, got none"):
        gp.Camera.from_file(tmp_path / "calibrated_sensor.json")


INFO = f"height: 720\nwidth: 1280\ndistortion_model: plumb_bob\nD: [0, 0, 0, 0, 0]\nK: {FLAT}\n"


def test_regions_and_bins_of_ros(tmp_path):
    roi = "roi: {x_offset: 100, y_offset: 20, width: 640, height: 480, do_rectify: False}\n"
    none = "roi: {x_offset: 0, y_offset: 0, width: 0, height: 0}\nbinning_x: 0\nbinning_y: 1\n"
    assert gp.Camera.from_file(write(tmp_path, INFO + none)) == IDEAL
    cropped = gp.Camera.from_file(write(tmp_path, INFO + roi))
    assert cropped == gp.Camera(F, F, CX - 100, CY - 20, image_size=(640, 480))
    camera = gp.Camera.from_file(write(tmp_path, INFO + roi + "binning_x: 2\nbinning_y: 4\n---\n"))
    assert camera.image_size == (320, 120)
    # the first pixel of two by four has its centre between theirs
    points = np.array([[0.1, -0.05, 1.0], [0.0, 0.0, 1.0]])
    full = IDEAL.project(points) - (100.0, 20.0)
    np.testing.assert_allclose(camera.project(points), (full + 0.5) / (2.0, 4.0) - 0.5, atol=1e-9)


NOTHING_ELSE = f"""{SIDES}camera_matrix: {K}
new_camera_matrix:
  rows: 3
  cols: 3
  data: [700, 0, 640, 0, 700, 360, 0, 0, 1]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
translation: {{rows: 1, cols: 3, data: [0.1, 0.2, 1.5]}}
"""


@pytest.mark.parametrize("matrix", ["nested", "flat", "block", "words"])
@pytest.mark.parametrize("order", [1, -1])
def test_nothing_is_taken_from_another_matrix(matrix, order, tmp_path):
    rows = NOTHING_ELSE.splitlines()
    spelled = {"nested": str(K), "flat": str(FLAT), "words": str(tuple(FLAT))}.get(matrix)
    spelled = spelled or "".join(f"\n- {number}" for number in FLAT)
    own = [f"camera_matrix: {spelled}", "distortion_coefficients: [-0.21, 0.08, 0.001, -0.0005, 0.0]"]
    text = (
        "\n".join([*rows[:2], *[*own, *rows[3:]], ""])
        if order > 0
        else "\n".join([*rows[3:], *own, *rows[:2]])
    )
    assert gp.Camera.from_file(write(tmp_path, text)) == BENT
    assert gp.Camera.from_file(write(tmp_path, NOTHING_ELSE)) == IDEAL


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("plumb_bob", [0.0] * 5, IDEAL),
        ("plumb_bob", "(0.0, 0.0, 0.0, 0.0, 0.0)", IDEAL),
        ("plumb_bob", [-0.21, 0.08, 0.001, -0.0005, 0, 0, 0, 0], BENT),
        ("radtan", [-0.21, 0.08, 0.001, -0.0005], BENT),
        ("rational_polynomial", [-0.21, 0.08, 0.001, -0.0005, 0.0], BENT),
        ("rational_polynomial", [-0.21, 0.08, 0.001, -0.0005, 0, 0, 0, 0], BENT),
        ("fisheye", [-0.02, 0.01, -0.008, 0.002], FISHEYE),
        ("Kannala_Brandt4", [-0.02, 0.01, -0.008, 0.002, 0.0], FISHEYE),
        ("none", [], IDEAL),
    ],
)
def test_names_and_counts_of_coefficients(name, given, expected, tmp_path):
    text = f"{SIDES}{OPENCV_K}distortion_model: {name}\ndistortion_coefficients: {given}\n"
    assert gp.Camera.from_file(write(tmp_path, text)) == expected


@pytest.mark.parametrize("count", [8, 12, 14])
def test_longer_lenses_are_rational(count, tmp_path):
    k = [0.1, -0.2, 0.001, 0.002, 0.03, 0.1, 0.2, 0.3, 1e-3, 1e-3, 1e-3, 1e-3, 0.01, 0.02][:count]
    camera = gp.Camera.from_file(write(tmp_path, {"K": K, "D": k}))
    assert camera == gp.Camera(F, F, CX, CY, k, lens="rational")


REFUSED = {
    "uncalibrated": (INFO.replace(str(FLAT), str([0.0] * 9)), "K: expected a calibrated camera, got zeros"),
    "over the image": (
        {"fx": 1.05, "fy": 1.87, "cx": 0.5, "cy": 0.5},
        "camera: expected fx.* in pixels, got fx 1.05",
    ),
    "skew": ({"K": [[F, 3.0, CX], *K[1:]]}, "K: K: expected .* without skew"),
    "skew of KITTI": (f"P0: 1 0\nP2: {F} -0.2 {CX} 0 0 {F} {CY} 0 0 0 1 0\n", ":2: P2: K: .* without skew"),
    "short line of KITTI": ("P2: 1 2 3\n", ":1: P2: expected twelve numbers"),
    "xi without a model": ({"K": K, "xi": 1.2, "D": [0.0] * 4}, "xi: expected a pinhole camera or a fisheye"),
    "omnidirectional Kalibr": (
        KALIBR.partition("cam1")[0].replace("pinhole", "omni"),
        "cam0.intrinsics: expected xi, fu, fv, pu, pv of the camera model omnidirectional, got 4",
    ),
    "omni with a fisheye": (
        KALIBR_OMNI.replace("radtan", "equidistant"),
        "cam0: expected k1, k2, p1, p2 of radtan as the distortion",
    ),
    "ds with a distortion": (
        KALIBR_DS.replace("none", "radtan").replace("[]", "[0.1, 0.0, 0.0, 0.0]"),
        "cam0: expected none as the distortion of the lens model double_sphere",
    ),
    "ds beyond its range": (KALIBR_DS.replace("0.59", "1.59"), "cam0.intrinsics: .*alpha from 0 to 1"),
    "eucm": (KALIBR_DS.replace("ds", "eucm"), "cam0.camera_model: expected one of plumb_bob"),
    "eucm of Basalt": (
        {"value0": {**BASALT["value0"], "intrinsics": [{"camera_type": "eucm", "intrinsics": _BASALT_DS}]}},
        "camera_type: expected one of pinhole, kb4",
    ),
    "two models": (
        f"fisheye_model: 1\ndistortion_model: plumb_bob\n{OPENCV_K}",
        "fisheye_model: expected the lens mo",
    ),
    "plumb_bob of 8": (
        {"K": K, "distortion_model": "plumb_bob", "D": [0.1] * 8},
        "D: expected none, 4 or 5 numbers",
    ),
    "six coefficients": ({"K": K, "D": [0.1] * 6}, "D: expected none, 4, 5, 8, 12 or 14 numbers"),
    "two coefficients": ({"K": K, "D": [0.1] * 2}, "D: expected none, 4, 5, 8, 12 or 14 numbers"),
    "five of a fisheye": (
        {"K": K, "fisheye": True, "D": [0.1] * 5},
        "D: expected four coefficients of a fisheye",
    ),
    "a fisheye without": (
        {"K": K, "fisheye": True},
        "fisheye: expected four coefficients of a fisheye, got 0",
    ),
    "unknown lens key": ({"K": K, "lens_correction": 0.3}, "lens_correction: expected a key that is read"),
    "unknown lens key outside": (
        {"undistorted_k": 1, "front": {"K": K}},
        "undistorted_k: expected a key that is read",
    ),
    "valid region": ({"K": K, "roi": [1, 2, 3, 4]}, "roi: expected x_offset, y_offset, width and height"),
    "rows and cols": (
        f"camera_matrix: {{rows: 3, cols: 4, data: {FLAT}}}\n",
        "data: expected 3 x 4 numbers, got 9",
    ),
    "not finite": (
        "camera_matrix: [1, .nan, 3, 4, 5, 6, 7, 8, 9]\n",
        r"camera_matrix\[1\]: expected a finite number",
    ),
    "two matrices": ({"K": K, "camera_matrix": K}, "K: expected one of the two, got camera_matrix and K"),
    "a key twice": (
        f"{OPENCV_K}{OPENCV_K}",
        "camera.any:6: expected YAML, got the key 'camera_matrix' twice",
    ),
    "an alias": ("a: &a [1, 2]\nb: *a\ncamera_matrix: *a\n", "expected YAML without aliases"),
    "aliases of aliases": (
        "a: &a [1]\n" + "".join(f"{x}: &{x} [*a, *a]\n" for x in "bcd"),
        "without aliases",
    ),
    "nested without end": ("a: " + "[" * 5000 + "]" * 5000 + "\n", "without end|depth|nest|recursion"),
    "broken YAML": ("camera_matrix: [1, 2\nb: 3\n", "camera.any:[12]: expected YAML"),
    "broken XML": ("<opencv_storage>\n<a>\n", "camera.any:3: expected XML"),
    "an entity": ('<!DOCTYPE x [<!ENTITY a "b">]>\n<opencv_storage/>', "XML without a DOCTYPE"),
    "another XML": ("<annotation><size/></annotation>", "expected a calibration"),
    "COLMAP's model": (
        "1 THIN_PRISM_FISHEYE 1280 720 1 1 1 1 1\n",
        ":1: MODEL: expected one of SIMPLE_PINHOLE.*got THIN",
    ),
    "COLMAP's count": ("1 PINHOLE 1280 720 1 1 1\n", ":1: PARAMS: expected 4 numbers"),
    "half a pixel": ({"K": K, "width": 1280.5, "height": 720}, "width: expected a whole number of pixels"),
    "CARLA's lens": ({**CARLA, "lens_kcube": 0.2}, "lens_kcube: expected 0, CARLA's default"),
    "CARLA's angle": ({**CARLA, "fov": 180}, "fov: horizontal_fov: expected radians between"),
    "a RealSense that is bent": ({**REALSENSE, "coeffs": [0.1] * 5}, "coeffs: expected zeros"),
    "a list of numbers": ([1, 2], "expected a calibration"),
    "nothing": ("", "expected a calibration"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_refused_by_file_and_key(case, tmp_path):
    content, text = REFUSED[case]
    with pytest.raises(gp.InputError, match=text) as caught:
        read_calibration(write(tmp_path, content))
    assert str(caught.value).startswith(str(tmp_path / "camera.any"))


def test_large_files_take_linear_time(tmp_path):
    def seconds(lines):
        path = write(
            tmp_path, f"{OPENCV_K}" + "".join(f"note_{i}: {i} camera_matrix\n" for i in range(lines))
        )
        start = time.process_time()  # others may use the processor meanwhile
        read_calibration(path)
        return time.process_time() - start

    small, large = (min(seconds(n) for _ in range(3)) for n in (2_000, 20_000))
    assert large < 30.0 * small + 0.1
