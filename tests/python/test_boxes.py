"""Boxes and calibrations from files: recognised by content, read exactly, refused by line or field."""

import copy
import json
import math
import re
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from conftest import CAMERA, frame_of, make_batch
from groundpose.formats.boxes import BOXES, Box, read_boxes
from groundpose.formats.calibrations import CALIBRATIONS, read_calibration

KITTI = (
    "Car 0.00 0 -1.57 100.5 120 180 170.25 1.5 1.6 3.9 1 1.6 12 0.1 0.875\r\n"
    "Pedestrian 0 0 0 5 6 7 8 1.7 .6 .6 1 1 9 0 0.5\n"
    "DontCare -1 -1 -10 1 2 3 4 -1 -1 -1 -1000 -1000 -1000 -10\n"
    "\n"
    "Van -1 -1 -10 1 2 30 40 -1 -1 -1 -1000 -1000 -1000 -10\n"
)
COCO = {
    "images": [{"id": 7, "file_name": "train/000007.png"}, {"id": 9, "file_name": "000009.png"}],
    "annotations": [
        {"id": 70, "image_id": 7, "category_id": 3, "bbox": [100.5, 120, 79.5, 50.25], "score": 0.875},
        {"id": 71, "image_id": 7, "category_id": 1, "bbox": [5, 6, 2, 2]},
        {"id": 72, "image_id": 7, "category_id": 3, "bbox": [0, 0, 600, 400], "iscrowd": 1},
    ],
    "categories": [{"id": 1, "name": "person"}, {"id": 3, "name": "car"}],
}
FRAME = frame_of(make_batch(3, seed=5))
CAR = Box((100.5, 120.0, 180.0, 170.25), 70, "car", 0.875)


def write(folder: Path, content: object, name: str = "boxes") -> Path:
    path = folder / name
    path.write_text(
        content if isinstance(content, str) else json.dumps(content), encoding="utf-8", newline=""
    )
    return path


def lines(*rows: object) -> str:
    return "".join(json.dumps(row) + "\n" for row in rows)


def test_kitti_text(tmp_path):
    boxes = read_boxes(write(tmp_path, KITTI)).of("anything.png").boxes
    assert boxes[0] == Box(CAR.bbox, 0, "Car", 0.875)
    assert [box.name for box in boxes] == ["Car", "Pedestrian", "Van"]
    assert [box.is_vehicle for box in boxes] == [True, False, True]
    assert math.isnan(boxes[2].score)
    assert read_boxes(write(tmp_path, "")).of("x.png").boxes == ()


def test_coco_data_set(tmp_path):
    file = read_boxes(write(tmp_path, COCO))
    assert file.of("000007.png").boxes[0] == CAR
    assert file.of("train/000007.png").boxes[0] == CAR
    assert len(file.of("000007.png").boxes) == 2  # a crowd is no object
    assert file.of("000009.png").boxes == ()
    with pytest.raises(gp.InputError, match=r"boxes: expected boxes of 000008\.png, got none"):
        file.of("000008.png")


def test_images_of_one_name_in_two_folders(tmp_path):
    images = [{"id": 1, "file_name": "a/0.png"}, {"id": 2, "file_name": "b/0.png"}]
    file = read_boxes(
        write(tmp_path, {"images": images, "annotations": [{"image_id": 2, "bbox": [1, 2, 3, 4]}]})
    )
    assert len(file.of("b/0.png").boxes) == 1
    assert len(file.of("a/0.png").boxes) == 0
    with pytest.raises(
        gp.InputError, match=r"expected boxes of one image named 0\.png, got of a/0\.png, b/0\.png"
    ):
        file.of("0.png")


def test_coco_results(tmp_path):
    rows = [{**row, "id": None} for row in COCO["annotations"][:2]]
    file = read_boxes(write(tmp_path, rows))
    assert [box.name for box in file.of("000007.png").boxes] == ["car", "person"]
    assert file.of("7.png").boxes[0] == Box(CAR.bbox, 0, "car", 0.875)


def test_our_frames(tmp_path):
    frame = copy.deepcopy(FRAME) | {"id": "first"}
    frame["objects"][0] |= {"class": "van_bus", "score": 0.5, "bbox": [1, None, 3, 4]}
    alone = read_boxes(write(tmp_path, frame)).of("whatever.png")
    assert alone.boxes[0].name == "van_bus"
    np.testing.assert_array_equal(alone.boxes[0].bbox, [1, np.nan, 3, 4])
    np.testing.assert_allclose(alone.boxes[1].truth[1], frame["objects"][1]["truth"]["t"])
    assert alone.view.camera == CAMERA
    small = {"objects": [{"bbox": [1, 2, 3, 4]}]}
    file = read_boxes(
        write(tmp_path, lines(frame, {**small, "image": "b/2.jpg"}, {**small, "id": 12}, small))
    )
    assert len(file.of("first.png").boxes) == len(frame["objects"])
    for name in ("2.jpg", "000012.png", "00003.png"):
        assert [box.bbox for box in file.of(name).boxes] == [(1.0, 2.0, 3.0, 4.0)], name
    assert file.of("2.jpg").view is None


def test_a_plain_list(tmp_path):
    boxes = read_boxes(write(tmp_path, "[[1, 2, 3, 4],\n [5, 6, 7.5, null]]\n")).of("x.png").boxes
    assert boxes[0] == Box((1.0, 2.0, 3.0, 4.0), 0)
    assert math.isnan(boxes[1].bbox[3])
    assert boxes[0].is_vehicle
    assert read_boxes(write(tmp_path, "[]")).of("x.png").boxes == ()


REFUSED = {
    "prose": ("Dear reader,\n", r"expected 2D boxes \(KITTI.*COCO.*\), got"),
    "a number": ("3\n", "expected 2D boxes"),
    "another object": ({"a": 1}, "expected 2D boxes"),
    "words in KITTI": (KITTI.replace("12 0.1", "far 0.1").partition("\n")[0], r"boxes:1: expected"),
    "broken JSON": ('{"images": [', "boxes: expected JSON"),
    "a bad later line": (lines({"objects": []}) + "{]\n", "boxes:2: expected JSON"),
    "three sides": ([[1, 2, 3]], r"boxes: \[0\]: expected a list of 4 numbers"),
    "no such image": (
        {**COCO, "images": []},
        r"annotations\[0\].image_id: expected the id of one of the images",
    ),
    "no file name": ({**COCO, "images": [{"id": 7}]}, r"images\[0\].file_name: expected a value"),
    "bbox of words": (
        {"objects": [{"bbox": ["a", 1, 2, 3]}]},
        r"objects\[0\].bbox\[0\]: expected a finite number",
    ),
    "unknown field": ({"objects": [{"bboxes": [1, 1, 2, 3]}]}, r"objects\[0\].bboxes: expected 'bbox'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_boxes_refused(case, tmp_path):
    content, text = REFUSED[case]
    with pytest.raises(gp.InputError, match=text):
        read_boxes(write(tmp_path, content))


def test_one_bad_line_costs_itself_alone(tmp_path):
    file = read_boxes(write(tmp_path, KITTI + "Car 0.00 0 -1.57 100"))
    assert len(file.of("x.png").boxes) == 3
    (line,) = file.skipped.lines()
    assert re.search(r"^1 x entry without a box: .*boxes:6: expected a type and 14 numbers, got 'Car", line)


def test_files_that_are_no_text(tmp_path):
    (tmp_path / "picture").write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe")
    for read in (read_boxes, read_calibration):
        with pytest.raises(
            gp.InputError, match="picture: expected a text file, got bytes that are not UTF-8"
        ):
            read(tmp_path / "picture")
        with pytest.raises(FileNotFoundError):
            read(tmp_path / "none")


def test_calibrations(tmp_path):
    kitti = "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nP2: 721.5 0 609.5 44.8 0 720 172.8 0.2 0 0 1 0.003\n"
    camera = gp.Camera(721.5, 720.0, 609.5, 172.8)
    assert read_calibration(write(tmp_path, kitti)) == gp.View(camera)
    own = {"fx": 721.5, "fy": 720, "cx": 609.5, "cy": 172.8}
    assert read_calibration(write(tmp_path, own)) == gp.View(camera)
    tilted = {**own, "pitch_deg": 2, "camera_height": 1.6, "_note": "front"}
    expected = gp.View(camera, math.radians(2.0), height=1.6)
    assert read_calibration(write(tmp_path, tilted)) == expected
    assert (
        read_calibration(write(tmp_path, {"camera": own, "pitch_deg": 2, "camera_height": 1.6})) == expected
    )
    assert read_calibration(write(tmp_path, {**FRAME, "objects": []})).camera == CAMERA


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("", r"expected a calibration \(KITTI's text with a line P2; .*JSON.*\), got something else"),
        ("P2: 1 2 3\n", "P2: expected twelve numbers"),
        ({"fx": 1, "fy": 1, "cx": 1}, "camera.cy: expected a value, got none"),
        ({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "k1": 0.1}, "camera.k1: expected"),
        ({"fx": -1, "fy": 1, "cx": 1, "cy": 1}, "camera: fx: expected"),
        ("[1, 2]", "expected a calibration"),
    ],
)
def test_calibrations_refused(content, text, tmp_path):
    with pytest.raises(gp.InputError, match=text):
        read_calibration(write(tmp_path, content))


def test_formats_have_names_of_their_own():
    for table in (BOXES, CALIBRATIONS):
        assert len({row.name for row in table}) == len(table)
