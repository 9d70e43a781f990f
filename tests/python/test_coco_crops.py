"""`groundpose crops --from-coco`: labelled pictures to crops, names mapped, bad annotations left out."""

import json

import numpy as np
import pytest
from groundpose._core import InputError
from groundpose.cli.main import app
from groundpose.keypoints.codec import cut
from groundpose.lab.drive import HIDDEN, OUTSIDE, SPLITS, VISIBLE
from groundpose.lab.training.coco_crops import read_coco, split_of_picture
from groundpose.lab.training.coco_map import CocoMap
from groundpose.lab.training.crops import STORED, Crops
from groundpose.vehicles import CLASSES, keypoint_names
from groundpose.vehicles.keypoints import KEYPOINTS
from PIL import Image
from typer.testing import CliRunner

THEIRS = ["wheel_fl", "wheel_fr", "lamp_l", "aerial"]
NAMES = {
    "classes": {"sedan": "car"},
    "keypoints": {
        "wheel_fl": "left_front_wheel",
        "wheel_fr": "right_front_wheel",
        "lamp_l": "left_headlamp",
    },
}
ROW = {keypoint.name: i for i, keypoint in enumerate(KEYPOINTS)}


def annotation(**changes):
    keypoints = [50, 60, 2, 70.5, 61, 1, 0, 0, 0, 55, 30, 2]
    made = {"id": 1, "image_id": 7, "category_id": 3, "bbox": [40, 30, 60, 40], "keypoints": keypoints}
    return {**made, **changes}


def coco(*annotations, **changes):
    categories = [{"id": 3, "name": "sedan", "keypoints": THEIRS}, {"id": 4, "name": "dog", "keypoints": []}]
    pictures = [{"id": 7, "file_name": "a.png"}]
    return {"images": pictures, "annotations": list(annotations), "categories": categories, **changes}


@pytest.fixture
def files(tmp_path):
    """A function that writes a file, its map and its picture, and gives the paths of the first two."""
    (tmp_path / "images").mkdir()
    pixels = np.random.default_rng(0).integers(0, 255, (120, 160, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(tmp_path / "images" / "a.png")

    def write(data, names=NAMES):
        (tmp_path / "labels.json").write_text(json.dumps(data))
        (tmp_path / "names.json").write_text(json.dumps(names))
        return tmp_path / "labels.json", tmp_path / "names.json"

    return write


def read(files, *annotations, **changes):
    path, names = files(coco(*annotations, **changes))
    return read_coco(path, CocoMap.read(names), split="train")


def test_one_vehicle(files, tmp_path):
    sources, skips = read(files, annotation())
    (sample,) = sources["train"](0, "train", 0, 5, STORED)
    label = sample.label
    assert skips.total == 0
    assert (label["kind"], label["frame"], label["object"]) == (CLASSES.index("car"), 0, 0)
    np.testing.assert_allclose(label["box"], [40, 30, 100, 70])
    np.testing.assert_array_equal(label["image_size"], [160, 120])
    left, right = ROW["left_front_wheel"], ROW["right_front_wheel"]
    np.testing.assert_allclose(label["keypoints"][[left, right]], [[50, 60], [70.5, 61]])
    assert label["state"][[left, right]].tolist() == [VISIBLE, HIDDEN]
    others = np.delete(np.arange(len(KEYPOINTS)), [left, right])
    assert np.isnan(label["keypoints"][others]).all()  # also the lamp: visibility 0 is not labelled
    assert not label["state"][others].any()
    image = np.asarray(Image.open(tmp_path / "images" / "a.png"))
    np.testing.assert_allclose(label["window"], STORED.windows(np.array([[40.0, 30, 100, 70]]))[0])
    np.testing.assert_array_equal(sample.image, cut(image, label["window"], STORED.width, STORED.height))


def test_a_keypoint_beyond_the_picture_is_outside(files):
    sources, _ = read(files, annotation(keypoints=[-9, 60, 2, 70, 119.5, 1, 0, 0, 0, 0, 0, 0]))
    (sample,) = sources["train"](0, "train", 0, 1, STORED)
    rows = [ROW["left_front_wheel"], ROW["right_front_wheel"]]
    assert np.isfinite(sample.label["keypoints"][rows]).all()
    assert (sample.label["state"][rows] == OUTSIDE).all()


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (annotation(bbox=[1, 2, 3]), "bbox that is not 4 finite numbers"),
        (annotation(bbox=[1, 2, 0, 5]), "bbox without area"),
        (annotation(bbox=[500, 2, 10, 5]), "bbox without area"),
        (annotation(bbox=None), "bbox that is not"),
        (annotation(bbox="left"), "bbox that is not"),
        (annotation(keypoints=[1, 2, 2]), "keypoints that is not 12 finite numbers"),
        (annotation(keypoints=[float("nan")] * 12), "keypoints that is not 12"),
        (annotation(keypoints=[3] * 12), "visibility of a keypoint"),
        (annotation(category_id=9), "unknown category_id"),
        (annotation(category_id=[9]), "unknown category_id"),
        (annotation(category_id=4), "category 'dog' is not in the map"),
        (annotation(image_id=8), "annotation of no picture"),
        (annotation(image_id={}), "annotation of no picture"),
        (annotation(iscrowd=1), "a crowd"),
        ("text", "annotation of no picture"),
    ],
)
def test_one_bad_annotation_is_left_out_and_the_rest_stays(files, bad, reason):
    sources, skips = read(files, annotation(), bad, annotation(id=3))
    assert len(list(sources["train"](0, "train", 0, 1, STORED))) == 2
    assert skips.total == 1
    assert reason in skips.lines()[0]
    assert "labels.json: annotations[1]" in skips.lines()[0]


@pytest.mark.parametrize("content", [None, b"no picture", "cut"])
def test_a_picture_that_cannot_be_read_is_left_out(files, tmp_path, content):
    bad = tmp_path / "images" / "b.png"
    if content is not None:
        whole = (tmp_path / "images" / "a.png").read_bytes()
        bad.write_bytes(whole[: len(whole) // 2] if content == "cut" else content)
    pictures = [{"id": 7, "file_name": "a.png"}, {"id": 8, "file_name": "b.png"}, {"id": 9}]
    sources, skips = read(files, annotation(), annotation(image_id=8), images=pictures)
    assert len(sources["train"].pictures) == 1
    assert {*skips.counts} == {"picture that cannot be read (b.png)", "picture without id or file_name"}


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ([], "expected an object with images"),
        ({"images": [], "annotations": []}, "labels.json: categories: expected a list, got NoneType"),
        (coco(), "expected an annotation that can be used, got no annotations"),
        (coco(annotation(image_id=1)), "got 1 x annotation of no picture"),
        (coco(categories=[{"id": 1, "name": "cat"}]), "classes: expected one of sedan"),
        (
            coco(categories=[{"id": 1, "name": "sedan", "keypoints": 5}]),
            "keypoints: expected one of wheel_fl",
        ),
    ],
)
def test_a_file_that_is_none(files, data, words):
    path, names = files(data)
    with pytest.raises(InputError, match=r"labels\.json") as error:
        read_coco(path, CocoMap.read(names))
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ([], 'expected an object with "classes", "keypoints" or both, got list'),
        ({"class": {}}, "got ['class']"),
        ({"classes": {"sedan": "saloon"}}, "names.json: classes.sedan: expected one of car, van_bus"),
        ({"keypoints": {"wheel_fl": "wheel"}}, "keypoints.wheel_fl: expected one of left_front_wheel"),
        ({"keypoints": {"wheel_fl": 5}}, "keypoints.wheel_fl"),
        ({"keypoints": {}}, "keypoints: expected an object of names, got {}"),
        ({"keypoints": {"a": "left_mirror", "b": "left_mirror"}}, "left_mirror twice"),
    ],
)
def test_a_map_that_is_none(files, names, words):
    _, path = files(coco(), names)
    with pytest.raises(InputError) as error:
        CocoMap.read(path)
    assert words in str(error.value)


def test_no_json(tmp_path):
    path = tmp_path / "x.json"
    path.write_bytes(b"\xff{")
    for read_it in (CocoMap.read, lambda p: read_coco(p, CocoMap.own())):
        with pytest.raises(InputError, match="expected a JSON file"):
            read_it(path)


def test_without_a_map_the_names_are_ours(files):
    own = keypoint_names("van_bus")
    category = {"id": 3, "name": "van_bus", "keypoints": list(own)}
    path, _ = files(coco(annotation(keypoints=[50, 60, 2] * len(own)), categories=[category]))
    sources, _ = read_coco(path, CocoMap.own(), split="test")
    (sample,) = sources["test"](0, "test", 0, 1, STORED)
    assert sample.label["kind"] == CLASSES.index("van_bus")
    assert (sample.label["state"] == VISIBLE).sum() == len(own)


def test_pictures_are_split_by_their_ids():
    splits = [split_of_picture(i) for i in range(4000)]
    assert splits == [split_of_picture(i) for i in range(4000)]
    np.testing.assert_allclose([splits.count(s) / 4000 for s in SPLITS], (0.8, 0.1, 0.1), atol=0.02)


def test_the_command(files, tmp_path):
    path, names = files(coco(annotation(), annotation(bbox=None)))
    command = ["crops", str(tmp_path / "out"), "--from-coco", str(path), "--keypoints", str(names)]
    told = CliRunner().invoke(app, [*command, "--split", "validation"])
    assert told.exit_code == 0, told.output
    assert "(1 validation; 1 left out)" in " ".join(told.output.split())
    assert "bbox that is not 4 finite numbers" in told.output
    crops = Crops(tmp_path / "out", "validation")
    assert len(crops) == 1
    assert CliRunner().invoke(app, command[:2] + command[4:]).exit_code == 2
    path.write_text(json.dumps(coco(annotation(bbox=[40, 30, 50, 40]))))
    assert "same source" in CliRunner().invoke(app, [*command, "--split", "validation"]).output
