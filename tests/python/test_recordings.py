"""Images and cameras of ROS bags and MCAP files, written by the libraries of these formats."""

import json

import groundpose as gp
import numpy as np
import pytest
from conftest import make_batch
from groundpose.cli.main import app
from groundpose.formats.neighbours import write_scenes
from groundpose.formats.recordings import is_recording, read_recording
from groundpose.formats.scenes import Scene
from PIL import Image
from stand_in import write
from typer.testing import CliRunner

SIZE = (1280, 720)
PIXELS = np.random.default_rng(0).integers(0, 256, (*SIZE[::-1], 3), dtype=np.uint8)
POSES = make_batch(2, seed=8).estimate()
CAMERA = POSES.view.camera


@pytest.fixture(params=["a.mcap", "a.ros2", "ros2.mcap"])
def recording(request, tmp_path):
    """Two images with their camera in each kind of recording."""
    for name in ("rosbags", "foxglove", "mcap", "mcap_protobuf"):
        pytest.importorskip(name, reason=f"{name} is not installed")
    picture = tmp_path / "street.png"
    Image.fromarray(PIXELS).save(picture)
    scenes = [Scene.of(POSES, k, image=picture, time=5.0 + 0.1 * k) for k in range(2)]
    if request.param == "ros2.mcap":
        return ros_mcap(tmp_path, scenes)
    write_scenes(tmp_path / request.param, scenes)
    return tmp_path / request.param


def ros_mcap(folder, scenes):
    """The messages of a bag in an MCAP file, as ROS's own recorder stores them by default."""
    from rosbags.rosbag2 import Reader, StoragePlugin, Writer

    write_scenes(folder / "a.ros2", scenes)
    with (
        Reader(folder / "a.ros2") as bag,
        Writer(folder / "b", version=9, storage_plugin=StoragePlugin.MCAP) as copy,
    ):
        topics = {
            c.topic: copy.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, rihs01=c.digest)
            for c in bag.connections
        }
        for connection, stamp, raw in bag.messages():
            copy.write(topics[connection.topic], stamp, raw)
    return next((folder / "b").glob("*.mcap"))


def test_images_and_camera_come_back(recording):
    assert is_recording(recording)
    found = list(read_recording(recording))
    assert [image.number for image in found] == [0, 1]
    np.testing.assert_allclose([image.time for image in found], [0.0, 0.1], atol=1e-9)
    for image in found:
        np.testing.assert_array_equal(image.image, PIXELS)
        assert image.camera.K.tolist() == CAMERA.K.tolist()
        assert image.camera.image_size == SIZE


def test_estimate_takes_recordings_with_their_camera(recording, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    network = write(tmp_path / "network.onnx")
    (tmp_path / "boxes.json").write_text(
        "".join(json.dumps({"id": k, "objects": [{"bbox": [100, 100, 300, 250]}]}) + "\n" for k in range(2))
    )
    arguments = ["estimate", recording, "--boxes", "boxes.json", "--network", network, "-o", "poses.jsonl"]
    result = CliRunner().invoke(app, [*map(str, arguments), "--no-pictures"], catch_exceptions=False)
    assert result.exit_code in (0, 1), result.stderr
    lines = [json.loads(line) for line in (tmp_path / "poses.jsonl").read_text().splitlines()]
    assert [line["id"] for line in lines] == [0, 1], result.stderr
    assert [line["time"] for line in lines] == pytest.approx([0.0, 0.1])
    assert lines[0]["camera"]["fx"] == CAMERA.fx


def bag(path, messages):
    """A bag of (topic, type, message)."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with rosbag2.Writer(path, version=9) as made:
        topics = {}
        for number, (topic, kind, values) in enumerate(messages):
            if topic not in topics:
                topics[topic] = made.add_connection(topic, kind, typestore=store)
            time = store.types["builtin_interfaces/msg/Time"](0, number)
            head = store.types["std_msgs/msg/Header"](time, values[0])
            message = store.types[kind](head, *values[1:])
            made.write(topics[topic], number, store.serialize_cdr(message, kind))
    return path


def raw_image(encoding, rows, step=None, frame="camera"):
    height, width = rows.shape[:2]
    step = rows[0].size if step is None else step
    data = np.zeros((height, step), np.uint8)
    data[:, : rows[0].size] = rows.reshape(height, -1)
    return (
        "/camera/image_raw",
        "sensor_msgs/msg/Image",
        (frame, height, width, encoding, 0, step, data.ravel()),
    )


@pytest.mark.parametrize(
    ("encoding", "order"), [("rgb8", [0, 1, 2]), ("bgr8", [2, 1, 0]), ("rgba8", [0, 1, 2, 0]), ("mono8", [1])]
)
def test_raw_images_of_every_order(tmp_path, encoding, order):
    small = PIXELS[:5, :7]
    path = bag(tmp_path / "bag", [raw_image(encoding, small[..., order], step=7 * len(order) + 3)])
    (found,) = read_recording(path)
    wanted = np.repeat(small[..., [1]], 3, axis=2) if encoding == "mono8" else small
    np.testing.assert_array_equal(found.image, wanted)
    assert found.camera is None


def test_a_bad_image_costs_only_itself(tmp_path):
    small = PIXELS[:5, :7]
    topic, kind, values = raw_image("rgb8", small)
    broken = (topic, kind, (*values[:-1], values[-1][:20]))
    unknown = raw_image("bayer_rggb8", small[..., :1])
    path = bag(tmp_path / "bag", [raw_image("rgb8", small), broken, unknown, raw_image("rgb8", small)])
    found = list(read_recording(path))
    assert [isinstance(image, gp.InputError) for image in found] == [False, True, True, False]
    assert "/camera/image_raw, image 1: data: expected 5 rows of 21 bytes" in str(found[1])
    assert "encoding: expected one of rgb8" in str(found[2])
    assert "bayer_rggb8" in str(found[2])


def test_of_several_topics_one_must_be_named(tmp_path):
    first, second = (raw_image("rgb8", PIXELS[:5, :7]) for _ in range(2))
    path = bag(tmp_path / "bag", [first, ("/rear/image_raw", *second[1:])])
    with pytest.raises(gp.InputError, match=r"topic: expected a topic of images.*_raw, /rear/image_raw"):
        list(read_recording(path))
    assert len(list(read_recording(path, "/rear/image_raw"))) == 1
    with pytest.raises(gp.InputError, match=r"topic: expected one of images: .*, got /no"):
        list(read_recording(path, "/no"))


@pytest.mark.parametrize("name", ["a.mcap", "a.db3", "a.bag"])
def test_what_is_no_recording_is_refused_in_a_line(tmp_path, name):
    for package in ("rosbags", "mcap"):
        pytest.importorskip(package, reason=f"{package} is not installed")
    (tmp_path / name).write_bytes(b"no recording" * 100)
    with pytest.raises(gp.InputError, match=rf"{name}: expected an? (MCAP file|recording), got") as caught:
        list(read_recording(tmp_path / name))
    assert "\n" not in str(caught.value)
    with pytest.raises(FileNotFoundError):
        list(read_recording(tmp_path / f"no{name}"))


def test_a_recording_without_its_package_names_the_extra(tmp_path, monkeypatch):
    import sys

    (tmp_path / "a.mcap").write_bytes(b"")
    (tmp_path / "a.db3").write_bytes(b"")
    for package, name, extra in (("mcap", "a.mcap", "mcap"), ("rosbags", "a.db3", "ros")):
        for module in [m for m in sys.modules if m.partition(".")[0] == package]:
            monkeypatch.delitem(sys.modules, module)
        monkeypatch.setitem(sys.modules, package, None)
        with pytest.raises(gp.InputError, match=rf"groundpose\[{extra}\]"):
            list(read_recording(tmp_path / name))
