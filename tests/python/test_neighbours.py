"""Poses in the formats of other tools: opened again by each tool's own library, and by what they must say."""

import dataclasses
import io
import json
import math
import re
import types
import xml.etree.ElementTree as ET
from contextlib import redirect_stdout
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from conftest import frame_of, make_batch
from groundpose.cli.main import app
from groundpose.formats.columns import CORNERS, corners
from groundpose.formats.conversions import (
    BODY_FROM_OBJECT,
    covariance_at,
    from_rvec_tvec,
    to_body_axes,
    to_ros_covariance,
)
from groundpose.formats.detections import boxes_of
from groundpose.formats.neighbours import NEIGHBOURS, Context, neighbour, write_scenes
from groundpose.formats.neighbours import fiftyone as our_fiftyone
from groundpose.formats.neighbours.label_studio import CONFIG, clipped
from groundpose.formats.neighbours.mcap import EDGES
from groundpose.formats.neighbours.ros import AVAILABLE, SIGN_UNKNOWN, UNAVAILABLE, orientation_availability
from groundpose.formats.scenes import Scene, read_scenes
from groundpose.keypoints.network import bundled
from groundpose.vehicles import shape_model
from PIL import Image
from typer.testing import CliRunner

BATCH = make_batch(6, seed=8, model=shape_model("car"), outliers=0.0, noise=0.003)
POSES = BATCH.estimate()
SIZE = (1280, 720)


@pytest.fixture
def picture(tmp_path):
    path = tmp_path / "street.png"
    Image.new("RGB", SIZE, (90, 120, 90)).save(path)
    return path


def scene(**changes):
    made = Scene.of(POSES, **({"id": "street", "time": 1.5} | changes))
    assert made.ok.all()
    return made


def with_fields(given, **changes):
    return Scene(**vars(given) | changes)


def own(name, distribution=None):
    return pytest.importorskip(name, reason=f"{distribution or name} is not installed")


def run(*arguments):
    return CliRunner().invoke(app, ["convert", *map(str, arguments)], catch_exceptions=False)


# what all of them follow from


def test_a_scene_has_the_boxes_of_its_batch():
    made = scene()
    np.testing.assert_array_equal(made.corners, corners(POSES))
    np.testing.assert_allclose(made.centre, made.corners.mean(axis=1), atol=1e-12)
    np.testing.assert_allclose(made.size, POSES.size, atol=1e-12)
    np.testing.assert_allclose(made.corner_pixels, BATCH.view.camera.image_of(corners(POSES)))


def test_body_axes_are_those_of_ros():
    forward, left, up = to_body_axes(np.eye(3)[None])[0].T
    np.testing.assert_array_equal([forward, left, up], [[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    assert np.linalg.det(BODY_FROM_OBJECT) == 1.0


def test_the_covariance_of_another_point_is_that_of_samples():
    rng = np.random.default_rng(4)
    root = 0.01 * rng.normal(size=(6, 6))
    arm, errors = rng.normal(size=3), rng.normal(size=(60_000, 6)) @ root.T
    turned = from_rvec_tvec(errors[:, :3], errors[:, 3:])[0] @ arm - arm
    found = np.cov(np.hstack([errors[:, :3], turned + errors[:, 3:]]).T)
    wanted = covariance_at(root @ root.T[None], arm[None])[0]
    np.testing.assert_allclose(found, wanted, atol=0.03 * np.abs(wanted).max())
    ros = to_ros_covariance(wanted[None])[0]
    np.testing.assert_array_equal(ros[:3, :3], wanted[3:, 3:])
    np.testing.assert_array_equal(ros[3:, :3], wanted[:3, 3:])


def test_a_written_line_is_the_scene_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    frame = frame_of(BATCH, "a", time=2.5, image="street.png", camera_height=1.5)
    frame["models"] = {"car": "bundled:car"}
    (tmp_path / "frame.json").write_text(json.dumps(frame))
    CliRunner().invoke(app, ["estimate", "frame.json", "-o", "poses.jsonl"], catch_exceptions=False)
    (found,) = read_scenes("poses.jsonl")
    wanted = Scene.of(POSES, "a", time=2.5, image="street.png", classes=["car"] * 6)
    for name in ("R", "t", "bbox_3d", "bboxes", "covariance", "probability", "ambiguity", "yaw", "scores"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)
    assert (found.id, found.time, found.classes, found.ids) == ("a", 2.5, wanted.classes, wanted.ids)
    assert found.view.camera == POSES.view.camera
    assert found.view.pitch == pytest.approx(POSES.view.pitch, abs=1e-15)


def test_the_format_is_that_of_the_ending_or_of_its_name():
    for row in NEIGHBOURS.values():
        assert all(neighbour(f"a{ending}") is row for ending in row.endings)
        assert neighbour("whatever", row.name) is row
    with pytest.raises(gp.InputError, match=r"x\.json: expected an ending"):
        neighbour("x.json")
    with pytest.raises(gp.InputError, match="to: expected one of mcap"):
        neighbour("x.mcap", "bag")


# formats by their own libraries


def test_coco_is_read_by_pycocotools_with_the_boxes_of_omni3d(tmp_path):
    path = tmp_path / "a.coco.json"
    write_scenes(path, [scene(), scene(id="other")])
    data = json.loads(path.read_text())
    first = data["annotations"][0]
    R, size = np.array(first["R_cam"]), np.array(first["dimensions"])
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(size, POSES.size[0, [2, 1, 0]])
    np.testing.assert_allclose(R[:, 0], POSES.R[0, :, 2], atol=1e-12)  # length forward
    given = np.array(first["bbox3D_cam"])
    ours = corners(POSES)[0]
    at = [CORNERS.index(f"{e}_{h}_{s}") for e, h, s in _OMNI3D]
    np.testing.assert_allclose(given, ours[at], atol=1e-9)
    coco = own("pycocotools.coco", "pycocotools").COCO
    with redirect_stdout(io.StringIO()):
        read = coco(str(path))
    assert len(read.getAnnIds(imgIds=[2])) == 6
    assert read.loadCats(first["category_id"])[0]["name"] == "car"


_ROUND = (("rear", "top"), ("front", "top"), ("front", "bottom"), ("rear", "bottom"))
_OMNI3D = [(end, height, side) for side in ("right", "left") for end, height in _ROUND]


def test_an_object_without_an_answer_keeps_its_2d_box_in_coco(tmp_path):
    given = scene()
    status = ("no_consensus", *given.status[1:])
    R = np.where(np.arange(6)[:, None, None] == 0, np.nan, given.R)
    write_scenes(tmp_path / "a.coco.json", [with_fields(given, status=status, R=R)])
    first, second = json.loads((tmp_path / "a.coco.json").read_text())["annotations"][:2]
    assert (first["valid3D"], first["status"], second["valid3D"]) == (False, "no_consensus", True)
    assert "R_cam" not in first


def test_cvats_cuboids_have_the_near_end_at_their_front(tmp_path, picture):
    write_scenes(tmp_path / "a.xml", [scene(image=picture)])
    root = ET.parse(tmp_path / "a.xml").getroot()
    image = root.find("image")
    assert (image.get("name"), image.get("width")) == ("street.png", "1280")
    assert next(label.findtext("name") for label in root.iter("label")) == "car"
    pixels = scene().corner_pixels
    for k, shape in enumerate(image.iter("cuboid")):
        points = {
            key: np.array([float(shape.get(f"x{key}")), float(shape.get(f"y{key}"))])
            for key in ("tl1", "bl1", "tr1", "br1", "tl2", "bl2", "tr2", "br2")
        }
        found = np.array(sorted(map(tuple, points.values())))
        np.testing.assert_allclose(found, np.array(sorted(map(tuple, pixels[k].round(2)))), atol=0.011)
        assert points["tl1"][0] + points["bl1"][0] < points["tr1"][0] + points["br1"][0]
        assert points["tl1"][1] < points["bl1"][1]
        end = next(a.text for a in shape.iter("attribute") if a.get("name") == "end")
        middles = {e: POSES.R[k] @ [0, 0, z] + POSES.t[k] for e, z in (("front", 2.0), ("rear", -2.0))}
        assert end == min(middles, key=lambda e: np.linalg.norm(middles[e]))
        # the right edge of the back, which CVAT calls tl2, is on the same side of the vehicle as tr1
        names = {tuple(p.round(2)): CORNERS[i] for i, p in enumerate(pixels[k])}
        side = {key: names[tuple(p.round(2))].split("_")[2] for key, p in points.items()}
        assert side["tl2"] == side["tr1"] != side["tl1"] == side["tr2"]


def test_label_studios_own_checker_takes_the_tasks(tmp_path, picture):
    write_scenes(tmp_path / "a.label-studio.json", [scene(image=picture)])
    (task,) = json.loads((tmp_path / "a.label-studio.json").read_text())
    regions = task["predictions"][0]["result"]
    assert {r["type"] for r in regions} == {"rectanglelabels", "polygonlabels"}
    first = regions[0]["value"]
    np.testing.assert_allclose([first["x"], first["y"]], POSES.bboxes[0, :2] * [100 / SIZE[0], 100 / SIZE[1]])
    interface = own("label_studio_sdk.label_interface", "label-studio-sdk").LabelInterface(CONFIG)
    assert interface.validate_prediction(task["predictions"][0])


def test_polygons_are_cut_at_the_border_of_the_picture():
    square = np.array([[-10.0, 10.0], [50.0, 10.0], [50.0, 120.0], [-10.0, 120.0]])
    np.testing.assert_allclose(sorted(map(tuple, clipped(square))), [(0, 10), (0, 100), (50, 10), (50, 100)])
    assert len(clipped(square - 200.0)) == 0


TABLES = {
    "sample_data": [
        {"filename": "samples/CAM_FRONT/street.png", "sample_token": "s1", "calibrated_sensor_token": "c1"}
        | {"ego_pose_token": "e1"}
    ],
    # the camera 1.5 m above the axle, 1.7 m before it, looking ahead
    "calibrated_sensor": [
        {"token": "c1", "translation": [1.7, 0.0, 1.5], "rotation": [0.5, -0.5, 0.5, -0.5]}
    ],
    # the car at (100, 200), heading north
    "ego_pose": [
        {"token": "e1", "translation": [100.0, 200.0, 0.0]}
        | {"rotation": [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]}
    ],
}


@pytest.fixture
def tables(tmp_path):
    folder = tmp_path / "v1.0-mini"
    folder.mkdir()
    for name, rows in TABLES.items():
        (folder / f"{name}.json").write_text(json.dumps(rows, indent=0))
    return folder


def test_nuscenes_boxes_stand_on_the_map(tmp_path, tables, picture):
    write_scenes(tmp_path / "a.nuscenes.json", [scene(image=picture)], context=Context(tables))
    data = json.loads((tmp_path / "a.nuscenes.json").read_text())
    boxes = {tuple(np.round(box["size"], 6)): box for box in data["results"]["s1"]}
    for k in range(6):
        length, height, width = POSES.size[k]
        box = boxes[tuple(np.round([width, length, height], 6))]
        x, y, z = scene().centre[k]
        np.testing.assert_allclose(box["translation"], [100 + x, 201.7 + z, 1.5 - y], atol=1e-9)
        w, _, _, qz = box["rotation"]
        ahead = POSES.R[k] @ [0, 0, 1]  # camera x is the map's x, camera z its y
        heading = 2.0 * math.atan2(qz, w)
        assert math.cos(heading - math.atan2(ahead[2], ahead[0])) > 0.99
        assert box["detection_name"] == "car"
    loaders = own("nuscenes.eval.common.data_classes", "nuscenes-devkit")
    kinds = own("nuscenes.eval.detection.data_classes", "nuscenes-devkit")
    assert len(loaders.EvalBoxes.deserialize(data["results"], kinds.DetectionBox).all) == 6


def test_nuscenes_needs_its_tables_and_their_pictures(tmp_path, tables):
    with pytest.raises(gp.InputError, match="nuscenes: expected the folder of nuScenes' tables"):
        write_scenes(tmp_path / "a.nuscenes.json", [scene()])
    with pytest.raises(gp.InputError, match=r"frame street: image: expected a picture of .*, got other\.png"):
        write_scenes(tmp_path / "a.nuscenes.json", [scene(image="other.png")], context=Context(tables))
    assert not (tmp_path / "a.nuscenes.json").exists()


def test_long_van_buses_are_buses_and_unknown_classes_are_left_out():
    names = {"van_bus": "car", "bus": "bus", "car": "car"}
    given = with_fields(scene(), classes=("van_bus", "van_bus", "boat", "car", "", "sedan"))
    given.bbox_3d[0, 1, 2] += 8.0
    context = Context()
    found = [context.category(given, k, names) for k in range(6)]
    assert found == ["bus", "car", None, "car", None, "car"]
    assert context.left_out.total() == 2


def test_a_gltf_scene_is_read_by_trimesh(tmp_path):
    trimesh = own("trimesh")
    for name in ("a.glb", "a.gltf"):
        write_scenes(tmp_path / name, [scene()])
        read = trimesh.load(tmp_path / name)
        assert len(read.geometry) == 12
        box = next(n for n in read.graph.nodes_geometry if n.startswith("car 0 box"))
        transform, key = read.graph[box]
        vertices = trimesh.transform_points(read.geometry[key].vertices, transform)
        ground = corners(POSES)[0] @ POSES.view.R_camera_from_ground * [1, -1, -1]
        distances = np.linalg.norm(vertices[:, None] - ground[None], axis=2)
        assert distances.min(axis=0).max() < 1e-5


def test_the_shape_of_a_foreign_model_is_left_out_of_gltf(tmp_path):
    own("trimesh")
    context = Context()
    given = scene()
    write_scenes(tmp_path / "a.glb", [with_fields(given, bbox_3d=given.bbox_3d * 1.1)], context=context)
    assert context.left_out == {"shape of a model that does not come with the package": 6}


def test_gltf_holds_one_frame(tmp_path):
    own("trimesh")
    with pytest.raises(gp.InputError, match="one frame for a glTF file"):
        write_scenes(tmp_path / "a.glb", [scene(), scene()])


def test_an_mcap_recording_is_read_by_mcap(tmp_path, picture):
    own("foxglove", "foxglove-sdk")
    reader = own("mcap.reader", "mcap")
    decoder = own("mcap_protobuf.decoder", "mcap-protobuf-support")
    write_scenes(tmp_path / "a.mcap", [scene(image=picture), scene(image=picture, time=1.6)])
    with (tmp_path / "a.mcap").open("rb") as stream:
        made = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        found = [(c.topic, m.log_time, said) for _, c, m, said in made.iter_decoded_messages()]
    assert {time for _, time, _ in found} == {1_500_000_000, 1_600_000_000}
    said = {topic: message for topic, _, message in found[:5]}
    assert said["/camera/image"].data == picture.read_bytes()
    assert list(said["/camera/calibration"].K) == POSES.view.camera.K.ravel().tolist()
    for k, entity in enumerate(said["/vehicles"].entities):
        cube = entity.cubes[0]
        middle = [cube.pose.position.x, cube.pose.position.y, cube.pose.position.z]
        np.testing.assert_allclose(middle, scene().centre[k], atol=1e-9)
        np.testing.assert_allclose([cube.size.x, cube.size.z, cube.size.y], POSES.size[k], atol=1e-9)
        q = cube.pose.orientation
        np.testing.assert_allclose(_turn(q) @ [1, 0, 0], POSES.R[k, :, 2], atol=1e-9)
        np.testing.assert_allclose(_turn(q) @ [0, 0, 1], -POSES.R[k, :, 1], atol=1e-9)
    shapes = said["/camera/annotations"].points
    assert len(shapes) == 12
    assert len(EDGES) == 12
    down = _turn(said["/tf"].rotation) @ POSES.view.R_camera_from_ground[:, 1]
    np.testing.assert_allclose(down, [0, 0, -1], atol=1e-12)  # the camera's tilt in a frame with z up


def _turn(q):
    """Rotation by a quaternion, its definition: v -> q v q*."""
    w, u = q.w, np.array([q.x, q.y, q.z])
    cross = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def test_a_ros_2_bag_is_read_by_rosbags(tmp_path, picture):
    own("rosbags")
    from rosbags.highlevel import AnyReader

    context = Context(frame_id="optical")
    write_scenes(tmp_path / "a.ros2", [scene(image=picture)], context=context)
    with AnyReader([tmp_path / "a.ros2"]) as bag:
        found = {c.topic: bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages()}
        assert {c.topic: c.msgtype for c in bag.connections}["/detections"].endswith("Detection3DArray")
    assert found["/camera/image/compressed"].data.tobytes() == picture.read_bytes()
    assert found["/camera/camera_info"].k.tolist() == POSES.view.camera.K.ravel().tolist()
    assert found["/detections"].header.frame_id == "optical"
    detections, objects = found["/detections"].detections, found["/objects"].objects
    for k, (detection, item) in enumerate(zip(detections, objects, strict=True)):
        place = detection.bbox.center.position
        np.testing.assert_allclose([place.x, place.y, place.z], scene().centre[k])
        size = item.shape.dimensions
        np.testing.assert_allclose([size.x, size.z, size.y], POSES.size[k])
        pose = item.kinematics.pose_with_covariance
        np.testing.assert_allclose(_turn(pose.pose.orientation) @ [1, 0, 0], POSES.R[k, :, 2], atol=1e-9)
        wanted = to_ros_covariance(scene().centre_covariance)[k]
        np.testing.assert_array_equal(pose.covariance.reshape(6, 6), wanted)
        assert item.kinematics.has_position_covariance
        assert item.classification[0].label == item.classification[0].CAR
        assert detection.results[0].hypothesis.class_id == "car"
        assert item.existence_probability == pytest.approx(POSES.probability[k], abs=1e-6)


def test_orientations_are_as_available_as_the_ambiguity_says():
    given = scene()
    wide = given.covariance.copy()
    wide[2, :3, :3] = np.eye(3)
    ambiguity = np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0])
    given = with_fields(given, ambiguity=ambiguity, covariance=wide)
    found = [orientation_availability(given, k) for k in range(3)]
    assert found == [AVAILABLE, SIGN_UNKNOWN, UNAVAILABLE]


def test_a_bag_never_replaces_what_is_there(tmp_path):
    own("rosbags")
    (tmp_path / "a.ros2").mkdir()
    with pytest.raises(gp.InputError, match="a folder that is not there yet"):
        write_scenes(tmp_path / "a.ros2", [scene()])


def test_an_interrupted_bag_leaves_nothing(tmp_path):
    own("rosbags")

    def scenes():
        yield scene()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_scenes(tmp_path / "a.ros2", scenes())
    assert list(tmp_path.iterdir()) == []


class Made(dict):
    """Stands in for a label or a sample of FiftyOne."""

    @classmethod
    def from_cuboid(cls, vertices, frame_size, **more):
        return cls(vertices=vertices, **more)


def test_fiftyones_sample_has_2d_3d_and_cuboids(picture):
    names = ("Sample", "Detection", "Detections", "Polyline", "Polylines")
    found = our_fiftyone.sample(
        types.SimpleNamespace(**dict.fromkeys(names, Made)), scene(image=picture), Context()
    )
    box = found["boxes"]["detections"][0]["bounding_box"]
    np.testing.assert_allclose(np.array(box[:2]) * SIZE, POSES.bboxes[0, :2])
    assert found["vehicles"]["detections"][0]["dimensions"] == pytest.approx(POSES.size[0, [0, 2, 1]])
    assert len(found["cuboids"]["polylines"]) == 6
    with pytest.raises(gp.InputError, match="frame street: image: expected a picture"):
        our_fiftyone.sample(None, scene(), Context())


def test_fiftyones_own_classes_take_it(picture):
    found = our_fiftyone.sample(own("fiftyone"), scene(image=picture), Context())
    assert found["boxes"].detections[0].label == "car"
    faces = found["cuboids"].polylines[0].points
    front = [CORNERS.index(f"front_{h}_{s}") for h, s in (("bottom", "left"), ("bottom", "right"))]
    np.testing.assert_allclose(np.array(faces[0][:2]) * SIZE, scene().corner_pixels[0, front])


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # mongoengine's own, with a real database
def test_a_fiftyone_data_set_is_opened_by_fiftyone(tmp_path, picture):
    fo = own("fiftyone")
    try:
        fo.Dataset().delete()
    except fo.core.config.FiftyOneConfigError:
        with pytest.raises(gp.InputError, match="FiftyOne's database to start"):
            write_scenes(tmp_path / "a.fiftyone", [scene(image=picture)])
        pytest.skip("FiftyOne has no MongoDB here")
    write_scenes(tmp_path / "a.fiftyone", [scene(image=picture)])
    read = fo.Dataset.from_dir(
        dataset_dir=str(tmp_path / "a.fiftyone"), dataset_type=fo.types.FiftyOneDataset
    )
    first = read.first()
    assert len(first["vehicles"].detections) == len(first["cuboids"].polylines) == 6
    read.delete()


@pytest.mark.parametrize(
    ("name", "package", "extra"),
    [
        ("a.mcap", "foxglove", "mcap"),
        ("a.ros2", "rosbags", "ros"),
        ("a.glb", "trimesh", "gltf"),
        ("a.fiftyone", "fiftyone", "fiftyone"),
    ],
)
def test_a_package_that_is_missing_is_named_with_its_extra(tmp_path, monkeypatch, name, package, extra):
    import sys

    for module in [m for m in sys.modules if m.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(gp.InputError, match=rf"groundpose\[{extra}\]"):
        write_scenes(tmp_path / name, [scene()])
    assert list(tmp_path.iterdir()) == []


def test_supervision_draws_the_detections_and_gives_them_back():
    supervision = own("supervision")
    bboxes = POSES.bboxes.copy()
    bboxes[1] = np.nan
    poses = dataclasses.replace(POSES, bboxes=bboxes)
    found = poses.to_supervision()
    assert found.data["index"].tolist() == [0, 2, 3, 4, 5]
    assert set(found.data["class_name"]) == {"car"}
    assert set(found.class_id.tolist()) == {0}
    np.testing.assert_allclose(found.confidence, POSES.probability[[0, 2, 3, 4, 5]], atol=1e-6)
    np.testing.assert_allclose(found.data["centre"], scene().centre[[0, 2, 3, 4, 5]])
    drawn = supervision.BoxAnnotator().annotate(np.zeros((*SIZE[::-1], 3), np.uint8), found)
    drawn = supervision.LabelAnnotator().annotate(drawn, found)
    assert drawn.any()
    (first, *_), names = boxes_of(found).boxes, {box.name for box in boxes_of(found[1:]).boxes}
    np.testing.assert_allclose(first.bbox, POSES.bboxes[0], rtol=1e-5)
    assert names == {"car"}


def test_without_a_pose_a_detection_has_no_confidence_and_its_status():
    own("supervision")
    status = np.where(np.arange(6) == 0, "no_consensus", POSES.status)
    poses = dataclasses.replace(POSES, status=status, ok=status == "ok")
    found = poses.to_supervision()
    assert found.data["status"][0] == "no_consensus"
    assert found.confidence[0] == 0.0


# the command


@pytest.fixture
def lines(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    frame = frame_of(BATCH, "a") | {"models": {"car": "bundled:car"}}
    (tmp_path / "frames.jsonl").write_text("".join(json.dumps(frame | {"id": k}) + "\n" for k in "ab"))
    CliRunner().invoke(app, ["estimate", "frames.jsonl", "-o", "poses.jsonl"], catch_exceptions=False)
    return tmp_path / "poses.jsonl"


def test_convert_says_what_it_wrote_and_estimates_frames_first(lines):
    result = run("poses.jsonl", "a.coco.json")
    assert (result.exit_code, result.stdout) == (0, "2 frames, 12 poses: a.coco.json\n")
    assert run("frames.jsonl", "b.coco.json").exit_code == 0
    assert (lines.parent / "a.coco.json").read_text() == (lines.parent / "b.coco.json").read_text()


def test_a_bad_line_costs_only_itself(lines):
    good = lines.read_text()
    lines.write_text(good + good[:300] + "\n" + good.replace('"t": [', '"t": [7, '))
    result = run("poses.jsonl", "a.coco.json")
    assert result.exit_code == 1
    assert "poses.jsonl:3: expected JSON" in result.stderr
    assert "poses.jsonl:4: objects[0].t: expected a list of 3 numbers" in result.stderr
    assert len(json.loads((lines.parent / "a.coco.json").read_text())["images"]) == 2


@pytest.mark.parametrize(
    "out", ["a.coco.json", "a.xml", "a.label-studio.json", "a.mcap", "a.ros2", "{id}.glb"]
)
def test_a_frame_that_cannot_be_written_costs_only_itself(lines, out):
    for name in {"a.mcap": ["foxglove"], "a.ros2": ["rosbags"], "{id}.glb": ["trimesh"]}.get(out, []):
        own(name)
    first, second = map(json.loads, lines.read_text().splitlines())
    del first["camera"]["image_size"]  # which pictures' formats need
    first["time"] = -1.0  # which recordings cannot hold
    if out == "{id}.glb":
        first["objects"] = []
    lines.write_text(json.dumps(first) + "\n" + json.dumps(second) + "\n")
    result = run("poses.jsonl", out)
    assert (result.exit_code, result.stdout) == (1, f"1 frame, 6 poses: {out}\n"), result.stderr
    assert "frame a: " in result.stderr
    lines.write_text(json.dumps(first) + "\n")
    result = run("poses.jsonl", f"none_{out}")
    assert result.exit_code == 2
    assert "expected frames, got none that can be written" in result.stderr
    assert not list(lines.parent.glob("none_*"))


def test_lines_of_before_cameras_were_written_are_refused(lines):
    lines.write_text(
        json.dumps({k: v for k, v in json.loads(lines.read_text().splitlines()[0]).items() if k != "camera"})
    )
    result = run("poses.jsonl", "a.xml")
    assert result.exit_code == 2
    assert "camera: expected a value, got none" in result.stderr
    assert not (lines.parent / "a.xml").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("poses.jsonl", "a.json"), "expected an ending"),
        (("poses.jsonl", "a.foo", "--to", "foo"), "to: expected one of"),
        (("nothing.jsonl", "a.xml"), "nothing.jsonl: No such file"),
        (("poses.jsonl", "poses.jsonl", "--to", "coco"), "is the input"),
        (("poses.jsonl", "a.glb"), "several need {id}"),
        (("poses.jsonl", "no/where/a.xml"), "No such file"),
    ],
)
def test_wrong_calls_are_one_line(lines, arguments, said):
    before = lines.read_text()
    result = run(*arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert said in " ".join(result.stderr.split())
    assert result.stderr.count("\n") == 1
    assert lines.read_text() == before


def test_a_file_for_each_frame(lines):
    own("trimesh")
    assert run("poses.jsonl", "{id}.glb").exit_code == 0
    assert sorted(p.name for p in lines.parent.glob("*.glb")) == ["a.glb", "b.glb"]


# the page


@pytest.mark.skipif(not bundled().exists(), reason="the bundled network is not there")
def test_the_code_of_the_page_runs(tmp_path, monkeypatch):
    page = Path(__file__).parents[2] / "docs" / "neighbours.md"
    first, tracks, *others = re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(first, names)
    exec(tracks, names)
    assert json.loads(Path("tracks.coco.json").read_text())["images"]
    assert len(json.loads(Path("street.coco.json").read_text())["annotations"]) == len(names["poses"])
    own("supervision")
    for code in others:
        exec(code, names)
    assert (names["drawn"] != names["street"].image).any()


def test_the_page_has_every_format_and_extra():
    root = Path(__file__).parents[2]
    page = (root / "docs" / "neighbours.md").read_text("utf-8")
    for row in NEIGHBOURS.values():
        assert any(ending in page for ending in row.endings), row.name
    project = (root / "pyproject.toml").read_text("utf-8")
    for extra in ("mcap", "ros", "gltf", "supervision", "fiftyone"):
        assert re.search(rf"^{extra} = \[", project, re.MULTILINE)
        assert f"`{extra}`" in page
