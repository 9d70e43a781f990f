"""Detectors of the user's: every layout is recognised and answers boxes in pixels of the picture, whatever
its aspect; files that are none say what they have."""

import copy
import io
import pickle
from pathlib import Path

import detectors
import groundpose as gp
import numpy as np
import pytest
from detectors import CLASSES, KIND, SCORE, SIZE, WAYS, scores
from groundpose.detector.suppression import suppressed
from PIL import Image

WIDE, TALL = (300, 120), (110, 260)
NAMES = {"names": str({0: "person", 1: "bicycle", 2: "car"}), "task": "detect"}


def street(size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A dark picture with a red rectangle, and its left, top, right, bottom."""
    width, height = size
    box = np.array([width // 5, height // 4, width // 2, (3 * height) // 4])
    image = np.full((height, width, 3), 20, dtype=np.uint8)
    image[box[1] : box[3], box[0] : box[2]] = (255, 20, 20)
    return image, box.astype(float)


def pixel(detector: gp.Detector, size: tuple[int, int]) -> float:
    """Pixels of the image that one of the input covers."""
    return max(size[0] / detector.size[0], size[1] / detector.size[1])


@pytest.mark.parametrize("way", WAYS)
def test_every_layout_answers_boxes_in_pixels_of_the_picture(way, tmp_path):
    detector = gp.Detector(detectors.write(tmp_path / "d.onnx", way))
    assert (detector.layout, detector.size) == (WAYS[way][2], SIZE)
    for size in (WIDE, TALL, SIZE):
        image, box = street(size)
        found = detector(image)
        (one,) = found.boxes
        assert found.size == size
        np.testing.assert_allclose(one.bbox, box, atol=1.5 * pixel(detector, size))
        assert one.score == pytest.approx(SCORE, abs=0.06)


@pytest.mark.parametrize(
    ("way", "kind", "name"),
    [
        *[
            (way, KIND, "class 2")
            for way in ("YOLOv8", "YOLOv5", "YOLOX", "RF-DETR", "RT-DETR of ultralytics")
        ],
        *[(way, KIND, "car") for way in ("end to end", "RT-DETR", "RT-DETR of transformers")],
        *[(way, 3, "car") for way in ("RF-DETR of COCO", "DETR")],
    ],
)
def test_classes_without_names_are_those_of_coco_where_they_can_be(way, kind, name, tmp_path):
    (one,) = gp.Detector(detectors.write(tmp_path / "d.onnx", way))(street(WIDE)[0]).boxes
    assert (one.class_id, one.name) == (kind, name)


def test_names_come_from_the_file_or_the_caller(tmp_path):
    path = detectors.write(tmp_path / "d.onnx", metadata=NAMES)
    detector = gp.Detector(path)
    assert detector.names == {0: "person", 1: "bicycle", 2: "car"}
    assert detector(street(WIDE)[0]).boxes[0].name == "car"
    assert gp.Detector(path, names=["a", "b", "lorry"])(street(WIDE)[0]).boxes[0].name == "lorry"
    listed = detectors.write(tmp_path / "list.onnx", metadata={"names": "['x', 'y', 'bus']"})
    assert gp.Detector(listed)(street(WIDE)[0]).boxes[0].name == "bus"
    none = detectors.write(tmp_path / "none.onnx", metadata={"names": "None"})
    assert gp.Detector(none).names == {0: "class 0", 1: "class 1", 2: "class 2"}


def test_columns_behind_the_classes_are_masks_or_keypoints(tmp_path):
    def segmenting(g, box, size):
        table = g.answer(g.centred(box), detectors.cells(size), [*scores(), *[-3.0] * 8])
        masks = g.constant(np.zeros((1, 8, 16, 24)))
        return {"output0": g("Transpose", table, perm=[0, 2, 1]), "output1": g("Identity", masks)}

    path = detectors.write(tmp_path / "d.onnx", segmenting, metadata=NAMES | {"task": "segment"})
    image, box = street(WIDE)
    (one,) = gp.Detector(path)(image).boxes
    assert one.name == "car"
    np.testing.assert_allclose(one.bbox, box, atol=5.0)
    without = detectors.write(tmp_path / "without.onnx", segmenting)
    with pytest.raises(gp.InputError, match=r"without\.onnx: scores: expected 0 to 1, got -3 to 0\.9"):
        gp.Detector(without)


@pytest.mark.parametrize(
    ("shape", "metadata", "size"),
    [
        (["batch", 3, "height", "width"], {"imgsz": "[64, 96]"}, None),
        ([1, "channels", "height", "width"], {}, SIZE),
        ([2, 3, 64, 96], {}, None),
        (["batch", 3, 64, 96], {}, None),
    ],
)
def test_axes_that_the_file_leaves_open(shape, metadata, size, tmp_path):
    path = detectors.write(tmp_path / "d.onnx", shape=shape, metadata=metadata)
    detector = gp.Detector(path, size=size)
    assert detector.size == SIZE
    image, box = street(TALL)
    np.testing.assert_allclose(detector(image).boxes[0].bbox, box, atol=1.5 * pixel(detector, TALL))


def test_an_open_size_is_640_and_half_precision_is_taken(tmp_path):
    path = detectors.write(
        tmp_path / "d.onnx", size=(640, 640), shape=[1, 3, "h", "w"], dtype=detectors.FLOAT16
    )
    detector = gp.Detector(path)
    assert detector.size == (640, 640)
    image, box = street(WIDE)
    np.testing.assert_allclose(detector(image).boxes[0].bbox, box, atol=1.0)


@pytest.mark.parametrize("shape", [[1, 64, 96], [1, 64, 64], ["b", "h", "w"]])
def test_a_mask_of_the_picture_is_fed(shape, tmp_path):
    path = detectors.write(tmp_path / "d.onnx", "DETR", others={"pixel_mask": (detectors.INT64, shape)})
    detector = gp.Detector(path)
    image, box = street(TALL)
    (one,) = detector(image).boxes
    np.testing.assert_allclose(one.bbox, box, atol=1.5 * pixel(detector, TALL))


def test_what_is_unsure_is_left_out(tmp_path):
    path = detectors.write(tmp_path / "d.onnx")
    assert gp.Detector(path).min_score == 0.3
    assert gp.Detector(path, min_score=0.95)(street(WIDE)[0]).boxes == ()
    assert gp.Detector(detectors.write(tmp_path / "t.onnx", "DETR")).min_score == 0.5


def twice(first: list[float], second: list[float], shift: float):
    """Answers the rectangle twice, once moved by `shift` of the input's pixels."""

    def answer(g, box, size):
        b = g.centred(box)
        rows = [
            g("Concat", g.call("Add", b, [moved, 0, 0, 0]), g.constant(tail), axis=0)
            for moved, tail in ((0.0, first), (shift, second))
        ]
        pair = [g("Unsqueeze", row, g.constant([0], np.int64)) for row in rows]
        rest = g.constant(np.zeros((detectors.cells(size) - 2, 4 + len(first))))
        table = g("Unsqueeze", g("Concat", *pair, rest, axis=0), g.constant([0], np.int64))
        return {"output0": g("Transpose", table, perm=[0, 2, 1])}

    return answer


@pytest.mark.parametrize(
    ("second", "shift", "kept"),
    [
        (scores(score=0.8), 2.0, [0.9]),
        (scores(score=0.95), 2.0, [0.95]),
        (scores(score=0.8), 25.0, [0.9, 0.8]),
        (scores(score=0.8, kind=1), 0.0, [0.9, 0.8]),
    ],
)
def test_boxes_of_one_class_that_overlap_are_one(second, shift, kept, tmp_path):
    path = detectors.write(tmp_path / "d.onnx", twice(scores(), second, shift))
    assert [box.score for box in gp.Detector(path)(street(WIDE)[0]).boxes] == pytest.approx(kept)


def test_suppression_is_the_greedy_one():
    rng = np.random.default_rng(0)
    corner = rng.uniform(0, 60, (300, 2))
    boxes = np.concatenate([corner, corner + rng.uniform(5, 40, (300, 2))], axis=1)
    certain, kinds = rng.uniform(size=300), rng.integers(0, 3, 300)

    def overlap(a, b):
        sides = np.maximum(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0.0)
        return sides.prod() / ((a[2:] - a[:2]).prod() + (b[2:] - b[:2]).prod() - sides.prod())

    kept = []
    for i in np.argsort(-certain):
        if all(kinds[i] != kinds[k] or overlap(boxes[i], boxes[k]) <= 0.5 for k in kept):
            kept.append(i)
    assert suppressed(boxes, certain, kinds, 0.5).tolist() == kept
    assert suppressed(boxes[:0], certain[:0], kinds[:0], 0.5).tolist() == []


def test_it_is_copied_and_pickled_as_the_pipeline_is(tmp_path):
    path = detectors.write(tmp_path / "d.onnx", shape=["b", 3, "h", "w"])
    detector = gp.Detector(path, threads=1, min_score=0.2, names=["a", "b", "c"], size=SIZE)
    image, _ = street(WIDE)
    for other in (copy.deepcopy(detector), pickle.loads(pickle.dumps(detector))):
        assert (other.size, other.min_score, other.names) == (SIZE, 0.2, {0: "a", 1: "b", 2: "c"})
        assert other(image) == detector(image)
    assert repr(detector) == "Detector(d.onnx: YOLOv8, YOLO11; 96 x 64; 3 classes)"


def test_it_takes_pictures_as_the_pipeline_does(tmp_path):
    detector = gp.Detector(detectors.write(tmp_path / "d.onnx"))
    image, _ = street(WIDE)
    Image.fromarray(image).save(tmp_path / "street.png")
    path = tmp_path / "street.png"
    for given in (path, str(path), path.read_bytes(), Image.fromarray(image)):
        assert detector(given) == detector(image)
    with pytest.raises(TypeError, match="image: expected"):
        detector(3)


def test_the_pipeline_takes_its_boxes(tmp_path):
    stand_in = pytest.importorskip("stand_in")
    detector = gp.Detector(detectors.write(tmp_path / "d.onnx", metadata=NAMES))
    pipeline = gp.Pipeline(stand_in.write(tmp_path / "car.onnx"))
    image, _ = street(WIDE)
    view = gp.View(gp.Camera(300.0, 300.0, 150.0, 60.0))
    made = io.BytesIO()
    Image.fromarray(image).save(made, "PNG")
    for given in (image, made.getvalue(), io.BytesIO(made.getvalue()), Image.fromarray(image)):
        poses = pipeline(given, detector(image), view)
        assert len(poses) == 1
        assert poses.classes[0] == "car"


def test_boxes_of_yolox_are_decoded_as_its_cells_say(tmp_path):
    """Offsets of all cells at once, and one that is far off where there is nothing."""
    rng = np.random.default_rng(0)
    table = np.zeros((detectors.cells(), 6))
    table[:, :2], table[:, 2:4] = rng.uniform(-1, 2, (len(table), 2)), rng.uniform(-1, 1, (len(table), 2))
    kept = rng.permutation(len(table))[:9]
    table[kept, 4:] = rng.uniform(0.8, 1.0, (9, 2))
    table[next(k for k in range(len(table)) if k not in kept), 2] = 50.0
    where = [(x, y, s) for s in (8, 16, 32) for y in range(SIZE[1] // s) for x in range(SIZE[0] // s)]
    wanted = []
    for k in kept:
        (x, y, s), (dx, dy, w, h, objectness, certain) = where[k], table[k]
        centre, half = s * np.array([x + dx, y + dy]), 0.5 * s * np.exp([w, h])
        box = np.concatenate([centre - half, centre + half]).clip(0, [*SIZE, *SIZE])
        wanted.append((objectness * certain, *box))
    path = detectors.write(
        tmp_path / "d.onnx", lambda g, box, size: {"output": g("Identity", g.constant(table[None]))}
    )
    found = gp.Detector(path)(np.zeros((SIZE[1], SIZE[0], 3), np.uint8)).boxes
    rows = sorted((row for row in wanted if (np.array(row[3:]) > row[1:3]).all()), reverse=True)
    np.testing.assert_allclose([(box.score, *box.bbox) for box in found], rows, atol=1e-4)


def shaped_like(*shapes: tuple[int, ...]):
    return lambda g, box, size: {
        f"out{k}": g("Identity", g.constant(np.zeros(shape))) for k, shape in enumerate(shapes)
    }


@pytest.mark.parametrize(
    ("shapes", "got"),
    [
        ([(1, 3, 8, 12, 85)], r"out0 \(1, 3, 8, 12, 85\)"),
        ([(1, 1000)], r"out0 \(1, 1000\)"),
        (
            [(1, 126, 4), (1, 126, 3), (1, 126, 2)],
            r"out0 \(1, 126, 4\), out1 \(1, 126, 3\), out2 \(1, 126, 2\)",
        ),
        ([(1, 4, 126)], r"out0 \(1, 4, 126\)"),
        ([(1, 2000, 4), (1, 2000, 80)], "out0"),
    ],
)
def test_other_outputs_are_named_beside_those_that_are_known(shapes, got, tmp_path):
    path = detectors.write(tmp_path / "d.onnx", shaped_like(*shapes))
    known = r"YOLOv8, YOLO11 \(1, 4 \+ C, N\); .*RF-DETR .*"
    with pytest.raises(
        gp.InputError, match=rf"d\.onnx: expected outputs of a detector \({known}\), got {got}"
    ):
        gp.Detector(path)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"metadata": {"task": "obb"}}, "expected a detector of upright boxes, got a network for 'obb'"),
        ({"metadata": {"names": "{0: 'car', 7: 'bus'}"}}, "expected names of classes by number"),
        ({"metadata": {"names": "[car"}}, "expected names of classes by number"),
        ({"metadata": {"names": str(dict.fromkeys(range(80), "x"))}}, "names: expected 3 classes"),
        ({"shape": [1, 4, 64, 96]}, r"expected an input \(1, 3, height, width\), got \(1, 4, 64, 96\)"),
        ({"shape": [1, 3, 64, 100000]}, "expected an input of at most 8192 pixels a side, 16777216 in all"),
        ({"shape": [10**6, 3, 64, 96]}, "expected an input of at most 8192 pixels a side, 16777216 in all"),
        ({"dtype": detectors.onnx.TensorProto.UINT8}, r"input images: expected .*, got tensor\(uint8\)"),
        (
            {"others": {"im_shape": (detectors.FLOAT, [1, 2])}},
            "expected no input but a picture .*, got im_shape",
        ),
    ],
)
def test_files_that_cannot_be_used_say_why(changes, text, tmp_path):
    path = detectors.write(tmp_path / "d.onnx", **changes)
    with pytest.raises(gp.InputError, match=rf"d\.onnx: (.*: )?{text}"):
        gp.Detector(path)


def test_a_network_that_takes_no_pictures_says_so(tmp_path):
    helper, onnx = detectors.onnx.helper, detectors.onnx
    given, answered = (helper.make_tensor_value_info(name, detectors.FLOAT, [1, 10]) for name in ("x", "y"))
    graph = helper.make_graph([helper.make_node("Identity", ["x"], ["y"])], "g", [given], [answered])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.save(model, str(tmp_path / "d.onnx"))
    with pytest.raises(gp.InputError, match=r"d\.onnx: expected an input \(1, 3, height, width\), got"):
        gp.Detector(tmp_path / "d.onnx")


SMALL = [
    ((1, 84, 3), "YOLOv8, YOLO11", 80),
    ((1, 3, 85), "YOLOv5, YOLOv7", 80),
    ((1, 40, 85), "YOLOv5, YOLOv7", 80),
    ((1, 84, 84), "YOLOv8, YOLO11", 80),
    ((1, 84, 85), "YOLOX", 80),
    ((1, 7, 50), "YOLOv8, YOLO11", 3),
    ((1, 50, 8), "YOLOv5, YOLOv7", 3),
    ((1, 0, 6), "YOLOv10, YOLO26, exports with NMS", None),
]


@pytest.mark.parametrize(("shape", "name", "count"), SMALL)
def test_tables_of_other_grids_and_of_inputs_as_small_as_their_tables(shape, name, count, tmp_path):
    zeros = shaped_like(shape)
    detector = gp.Detector(detectors.write(tmp_path / "d.onnx", zeros, size=(64, 64)))
    assert detector.layout == name
    assert len(detector.names) == (count or 80)


def test_what_is_no_network_says_so(tmp_path):
    (tmp_path / "d.onnx").write_bytes(b"no network")
    with pytest.raises(gp.InputError, match=r"d\.onnx: expected an ONNX network"):
        gp.Detector(tmp_path / "d.onnx")
    with pytest.raises(FileNotFoundError):
        gp.Detector(tmp_path / "none.onnx")
    with pytest.raises(gp.InputError, match="expected a file, got a folder"):
        gp.Detector(tmp_path)


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"min_score": 2.0}, gp.InputError, "min_score: expected 0 to 1, got 2"),
        ({"min_score": "x"}, TypeError, "min_score: expected a number"),
        ({"size": (64, 64)}, gp.InputError, r"size: expected \(96, 64\) as in .*d\.onnx, got \(64, 64\)"),
        ({"size": 64}, TypeError, r"size: expected \(width, height\)"),
        ({"size": (0, 64)}, gp.InputError, "size: expected positive numbers"),
        ({"names": "car"}, TypeError, "names: expected names of classes by number"),
        ({"names": [1, 2, 3]}, TypeError, r"names\[0\]: expected a str"),
        ({"threads": 0}, gp.InputError, "threads: expected 1 or more"),
    ],
)
def test_arguments_that_cannot_be(arguments, error, text, tmp_path):
    path = detectors.write(tmp_path / "d.onnx")
    with pytest.raises(error, match=text):
        gp.Detector(path, **arguments)
    with pytest.raises(TypeError, match="path: expected a path"):
        gp.Detector(3)


def test_one_picture_of_another_kind_costs_itself_alone(tmp_path):
    detector = gp.Detector(detectors.write(tmp_path / "d.onnx"))
    for bad in (b"no picture", np.zeros((0, 5, 3), np.uint8)):
        with pytest.raises(gp.InputError):
            detector(bad)
    assert len(detector(street(WIDE)[0]).boxes) == 1
    assert Path(detector.path).name == "d.onnx"
    assert CLASSES == 3
