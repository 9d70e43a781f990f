"""What labelling tools and detectors write about the same two vehicles, and which image they mean by its
name."""

import json
import math
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose.formats.boxes import Box, Boxes, read_boxes
from groundpose.formats.detections import bboxes_of, boxes_of
from groundpose.formats.xml import parse_xml

W, H = 200, 100
CORNERS = [(20.0, 30.0, 80.0, 60.0), (100.0, 10.0, 190.0, 90.0)]
NAMES = ("car", "bus")


def kitti(name: str, box: tuple[float, ...], before: str = "", after: str = "") -> str:
    return f"{before}{name} 0 0 -10 {' '.join(map(str, box))} -1 -1 -1 -1000 -1000 -1000 -10{after}\n"


def each(template: str, **more: object) -> list[str]:
    """A line of each vehicle."""
    lines = []
    for k, ((left, top, right, bottom), name) in enumerate(zip(CORNERS, NAMES, strict=True)):
        width, height = right - left, bottom - top
        known = dict(l=left, t=top, r=right, b=bottom, w=width, h=height, name=name, k=k, number=(2, 5)[k])
        known |= dict(cx=(left + width / 2) / W, cy=(top + height / 2) / H, fw=width / W, fh=height / H)
        known |= dict(px=100 * left / W, py=100 * top / H, pw=100 * width / W, ph=100 * height / H)
        lines.append(template % known)
    return lines


def listed(template: str) -> str:
    return "[" + ", ".join(each(template)) + "]"


VOC = (
    f"<annotation><filename>street.jpg</filename><size><width>{W}</width><height>{H}</height></size>"
    + "".join(
        each(
            "<object><name>%(name)s</name><bndbox><xmin>%(l)s</xmin><ymin>%(t)s</ymin><xmax>%(r)s</xmax>"
            "<ymax>%(b)s</ymax></bndbox></object>"
        )
    )
    + "</annotation>"
)
CVAT = (
    f'<?xml version="1.0"?><annotations><image id="0" name="street.jpg" width="{W}" height="{H}">'
    + "".join(each('<box label="%(name)s" xtl="%(l)s" ytl="%(t)s" xbr="%(r)s" ybr="%(b)s"/>'))
    + "</image></annotations>"
)
CVAT_TRACKS = (
    "<annotations>"
    + "".join(
        each(
            '<track id="%(number)s" label="%(name)s"><box frame="7" outside="0" xtl="%(l)s" ytl="%(t)s" '
            'xbr="%(r)s" ybr="%(b)s"/><box frame="8" outside="1" xtl="0" ytl="0" xbr="9" ybr="9"/></track>'
        )
    )
    + "</annotations>"
)
DETRAC = (
    '<sequence name="S"><ignored_region><box left="0" top="0" width="9" height="9"/></ignored_region>'
    '<frame num="7"><target_list>'
    + "".join(
        each(
            '<target id="%(number)s"><box left="%(l)s" top="%(t)s" width="%(w)s" height="%(h)s"/>'
            '<attribute vehicle_type="%(name)s"/></target>'
        )
    )
    + "</target_list></frame></sequence>"
)
RECTANGLE = (
    f'{{"type": "rectanglelabels", "original_width": {W}, "original_height": {H}, "value": {{"x": %(px)s, '
    '"y": %(py)s, "width": %(pw)s, "height": %(ph)s, "rotation": 0, "rectanglelabels": ["%(name)s"]}}'
)
FORMATS = {
    "KITTI, lower case": "".join(map(kitti, NAMES, CORNERS)),
    "KITTI, a byte order mark": "\ufeff" + "".join(map(kitti, ("Car", "Bus"), CORNERS)),
    "KITTI, a comment": "# made by a tool\n" + "".join(map(kitti, NAMES, CORNERS)),
    "KITTI, more columns": "".join(
        kitti(n, b, after=" 12 2018_03_07 x") for n, b in zip(NAMES, CORNERS, strict=True)
    ),
    "KITTI, decimal commas": "".join(map(kitti, NAMES, CORNERS)).replace(".0", ",0"),
    "KITTI tracking": "".join(kitti(n, b, f"7 {k} ") for n, b, k in zip(NAMES, CORNERS, (2, 5), strict=True)),
    "YOLO": "\n".join(each("%(number)d %(cx)f %(cy)f %(fw)f %(fh)f")),
    "YOLO, a score": "\n".join(each("%(number)d %(cx)f %(cy)f %(fw)f %(fh)f 0.5")),
    "YOLO, a score and a track": "\n".join(each("%(number)d %(cx)f %(cy)f %(fw)f %(fh)f 0.5 %(number)d")),
    "Pascal VOC": VOC,
    "CVAT": CVAT,
    "CVAT, tracks": CVAT_TRACKS,
    "UA-DETRAC": DETRAC,
    "MOT detections": "\n".join(each("7,-1,%(l)s,%(t)s,%(w)s,%(h)s,0.5,-1,-1,-1")),
    "MOT truth": "\n".join(each("7,%(number)d,%(l)s,%(t)s,%(w)s,%(h)s,1,3,0.9")),
    "CSV": "image,xmin,ymin,xmax,ymax,label\n"
    + "\n".join(each("street.jpg,%(l)s,%(t)s,%(r)s,%(b)s,%(name)s")),
    "CSV, semicolons, sizes": "frame;x;y;w;h;class;track_id\n"
    + "\n".join(each("7;%(l)s;%(t)s;%(w)s;%(h)s;%(name)s;%(number)d")).replace(".0", ",0"),
    "CSV of TensorFlow": "filename,width,height,class,xmin,ymin,xmax,ymax\n"
    + "\n".join(each(f"street.jpg,{W},{H},%(name)s,%(l)s,%(t)s,%(r)s,%(b)s")),
    "lines of numbers": "\n".join(each("%(l)s %(t)s %(r)s %(b)s 0.5 %(number)d")),
    "Label Studio": f'[{{"id": 1, "data": {{"image": "/data/upload/1/90fbb0c7-street.jpg"}}, "annotations": '
    f'[{{"result": {listed(RECTANGLE)}}}]}}]',
    "labelme": '{"version": "5", "imagePath": "street.jpg", "shapes": '
    + listed('{"label": "%(name)s", "shape_type": "rectangle", "points": [[%(r)s, %(t)s], [%(l)s, %(b)s]]}')
    + "}",
    "BDD100K": '[{"name": "street.jpg", "labels": '
    + listed(
        '{"id": "%(number)d", "category": "%(name)s", '
        '"box2d": {"x1": %(l)s, "y1": %(t)s, "x2": %(r)s, "y2": %(b)s}}'
    )
    + "}]",
    "Cityscapes 3D": f'{{"imgWidth": {W}, "imgHeight": {H}, "objects": '
    + listed('{"2d": {"modal": [1, 1, 2, 2], "amodal": [%(l)s, %(t)s, %(w)s, %(h)s]}, "label": "%(name)s"}')
    + "}",
    "Cityscapes polygons": f'{{"imgWidth": {W}, "imgHeight": {H}, "objects": '
    + listed('{"polygon": [[%(l)s, %(t)s], [%(r)s, %(t)s], [%(r)s, %(b)s]], "label": "%(name)s"}')
    + "}",
    "ultralytics": listed(
        '{"name": "%(name)s", "class": %(number)d, "confidence": 0.5, "track_id": %(number)d, "box": '
        '{"x1": %(l)s, "y1": %(t)s, "x2": %(r)s, "y2": %(b)s}}'
    ),
    "supervision": listed(
        '{"x_min": %(l)s, "y_min": %(t)s, "x_max": %(r)s, "y_max": %(b)s, "class_id": %(number)d, '
        '"confidence": 0.5, "tracker_id": ""}'
    ),
    "a list with scores": listed("[%(l)s, %(t)s, %(r)s, %(b)s, 0.5]"),
    "a list with scores and classes": listed("[%(l)s, %(t)s, %(r)s, %(b)s, 0.5, %(number)d]"),
}
UNNAMED = ("MOT detections", "a list with scores")
TRACKED = (
    *("KITTI tracking", "YOLO, a score and a track", "CVAT, tracks", "UA-DETRAC", "MOT truth"),
    *("CSV, semicolons, sizes", "ultralytics"),
)
SCORED = (
    *("YOLO, a score", "YOLO, a score and a track", "MOT detections", "lines of numbers", "ultralytics"),
    *("supervision", "a list with scores", "a list with scores and classes"),
)


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_has_the_same_boxes(form, tmp_path):
    path = tmp_path / "file.any"
    path.write_text(FORMATS[form], encoding="utf-8")
    boxes = read_boxes(path).of("street.jpg").in_pixels(W, H).boxes
    np.testing.assert_allclose([box.bbox for box in boxes], CORNERS, atol=1e-3)
    names = ["", ""] if form in UNNAMED else ["car", "car"] if form == "MOT truth" else list(NAMES)
    assert [box.name.lower() for box in boxes] == names
    assert all(box.is_vehicle for box in boxes)
    assert [box.score for box in boxes] == pytest.approx(
        [0.5 if form in SCORED else math.nan] * 2, nan_ok=True
    )
    if form in TRACKED:
        assert [box.id for box in boxes] == [2, 5]


@pytest.mark.parametrize("form", ["KITTI tracking", "CVAT, tracks", "UA-DETRAC", "MOT detections"])
def test_numbered_frames(form, tmp_path):
    path = tmp_path / "file.any"
    path.write_text(FORMATS[form].replace("\n7", "\n9", 1), encoding="utf-8")
    file = read_boxes(path)
    assert len(file.of("img00007.jpg").boxes) >= 1
    first = 1 if form in ("UA-DETRAC", "MOT detections") else 0
    assert len(file.frame(7 - first).boxes) >= 1
    assert file.frame(3).boxes == ()  # nothing there
    with pytest.raises(gp.InputError, match=r"file\.any: expected boxes of 000100\.png, got none; it has 7"):
        file.of("000100.png")


def test_frames_between_are_empty(tmp_path):
    path = tmp_path / "det.txt"
    path.write_text("7,1,1,1,9,9,1,-1,-1,-1\n9,1,1,1,9,9,1,-1,-1,-1\n")
    assert read_boxes(path).of("000008.png").boxes == ()


def test_names_of_classes_beside_the_file(tmp_path):
    (tmp_path / "labels").mkdir()
    path = tmp_path / "labels" / "street.txt"
    path.write_text("0 0.5 0.5 0.1 0.1\n1 0.5 0.5 0.1 0.1\n2 0.1 0.1 0.4 0.1 0.4 0.5 0.2 0.6\n")
    assert [box.name for box in read_boxes(path).of("street.png").boxes] == ["person", "bicycle", "car"]
    (tmp_path / "classes.txt").write_text("lorry\nperson\n")
    boxes = read_boxes(path).of("street.png").in_pixels(100, 100).boxes
    assert [(box.name, box.is_vehicle) for box in boxes[:2]] == [("lorry", True), ("person", False)]
    assert boxes[2].bbox == pytest.approx((10.0, 10.0, 40.0, 60.0))  # around its polygon
    with pytest.raises(gp.InputError, match=r"expected \(width, height\) of the image"):
        bboxes_of(path)
    assert boxes_of(path, size=(100, 100)).boxes[0].bbox == pytest.approx((45.0, 45.0, 55.0, 55.0))


def coco(name: str = "street.png", **image: object) -> dict:
    return {
        "images": [{"id": 1, "file_name": name, **image}, {"id": 2, "file_name": "other.png"}],
        "annotations": [{"id": 5, "image_id": 1, "bbox": [10, 20, 30, 40], "category_id": 1}],
        "categories": [{"id": 1, "name": "car"}],
    }


def written(folder: Path, content: object) -> Path:
    path = folder / "coco.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    "name",
    [
        *("images\\street.png", "C:\\data\\street.png", "/data/street.png", "images/90fbb0c7-street.png"),
        *("https://a.b/c/street.png?X-Amz=1/2#top", "street_png.rf.0a1b2c3d4e.jpg", "file:///d/street.png"),
        *("/data/local-files/?d=set/street.png", "street.jpg"),
    ],
)
def test_names_of_images_match_by_their_last_part(name, tmp_path):
    file = read_boxes(written(tmp_path, coco(name)))
    assert [box.id for box in file.of("street.png").boxes] == [5]
    assert file.of("other.png").boxes == ()


def test_folders_tell_images_of_one_name_apart(tmp_path):
    content = coco("front/street.png")
    content["images"][1]["file_name"] = "back/street.png"
    file = read_boxes(written(tmp_path, content))
    assert len(file.of("/somewhere/front/street.png").boxes) == 1
    assert len(file.of("/somewhere/back/street.png").boxes) == 0
    with pytest.raises(gp.InputError, match=r"of one image named street\.png, got of front/street"):
        file.of("street.png")


BAD = {
    "no box": {"image_id": 1},
    "an empty box": {"image_id": 1, "bbox": []},
    "a box of words": {"image_id": 1, "bbox": ["a", 1, 2, 3]},
    "an image that is not there": {"image_id": 99, "bbox": [1, 2, 3, 4]},
    "no object": 7,
}


@pytest.mark.parametrize("case", BAD)
def test_one_bad_annotation_costs_itself_alone(case, tmp_path):
    content = coco()
    content["annotations"].insert(0, BAD[case])
    file = read_boxes(written(tmp_path, content))
    assert [box.id for box in file.of("street.png").boxes] == [5]
    (line,) = file.skipped.lines()
    assert line.startswith("1 x entry without a box: ")
    assert "coco.json: annotations[0]" in line


def test_ids_as_text_and_as_floats_are_ids(tmp_path):
    content = coco()
    content["annotations"][0] |= {"image_id": "1", "category_id": 1.0, "track_id": 17}
    (box,) = read_boxes(written(tmp_path, content)).of("street.png").boxes
    assert (box.name, box.id) == ("car", 17)


def test_boxes_of_another_image_size(tmp_path):
    found = read_boxes(written(tmp_path, coco(width=100, height=50))).of("street.png")
    scaled = found.in_pixels(200, 100, "coco.json")
    assert scaled.boxes[0].bbox == (20.0, 40.0, 80.0, 120.0)
    assert scaled.remarks == ("boxes of another image size: coco.json: scaled from 100 x 50 to 200 x 100",)
    assert found.in_pixels(100, 50).boxes == found.boxes
    assert found.in_pixels(100, 50).remarks == ()
    with pytest.raises(
        gp.InputError, match=r"coco\.json: expected boxes of an image of 50 x 100, got of 100 x 50; .*exif"
    ):
        found.in_pixels(50, 100, "coco.json")
    with pytest.raises(gp.InputError, match=r"expected boxes of an image of 50 x 100, got of 0 x 3"):
        Boxes((), size=(0, 3)).in_pixels(50, 100)


@pytest.mark.parametrize(
    ("ids", "names"),
    [
        ((2, 5, 7), ["car", "bus", "truck"]),  # as detectors count
        ((0, 2), ["person", "car"]),
        ((3, 6, 8), ["car", "bus", "truck"]),  # as COCO counts
        ((1, 2), ["person", "bicycle"]),
        ((2,), ["bicycle"]),
    ],
)
def test_numbers_of_classes_in_results(ids, names, tmp_path):
    rows = [{"image_id": "street", "category_id": k, "bbox": [1, 2, 3, 4], "score": 0.5} for k in ids]
    found = read_boxes(written(tmp_path, rows)).of("street.png")
    assert [box.name for box in found.boxes] == names
    assert bool(found.remarks) == ((names[0] != "bicycle" and 0 in ids) or (2 in ids and 5 in ids))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<annotation><object></annotation>", "file.any: expected XML, got mismatched tag"),
        ("<opencv_storage><a/></opencv_storage>", "got XML <opencv_storage>"),
        (
            "<!DOCTYPE a [<!ENTITY b 'c'>]><annotation>&b;</annotation>",
            "file.any: expected XML without entities",
        ),
        ("<annotation>" + "<a>" * 100_000, "expected XML of at most 64 levels"),
        (
            VOC.replace("20.0", "left").replace("100.0", "nan"),
            r"object\[0\]/bndbox/xmin: expected a finite number, got 'left'",
        ),
        ('{"a": 1}', "got JSON with a"),
        ("image,label\na.png,car\n", "got something else"),
    ],
)
def test_what_cannot_be_read_is_said_shortly(text, expected, tmp_path):
    path = tmp_path / "file.any"
    path.write_text(text)
    with pytest.raises(gp.InputError, match=expected) as error:
        read_boxes(path)
    assert len(str(error.value)) < 800


def test_xml_cannot_grow():
    bomb = '<!DOCTYPE a [<!ENTITY a "aaaa">' + "".join(
        f'<!ENTITY a{k} "{"&a" + (str(k - 1) if k else "") + ";"}">' for k in range(1, 3)
    )
    with pytest.raises(gp.InputError, match="without entities"):
        parse_xml(bomb + "]><a>&a2;</a>", "bomb.xml")
    assert parse_xml('<!DOCTYPE a SYSTEM "file:///etc/passwd"><a>b</a>', "x").text == "b"


def test_boxes_without_a_size_stay():
    boxes = Boxes((Box((1.0, 2.0, 3.0, 4.0), 0),))
    assert boxes.in_pixels(10, 10).boxes == boxes.boxes
