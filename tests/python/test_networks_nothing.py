"""Networks judged on places without a vehicle: boxes that meet none, and rates that count right."""

import numpy as np
import pytest
from groundpose.formats.kitti.labels import KittiLabel, read_labels
from groundpose.keypoints.codec import Codec
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate.networks import nothing, page
from groundpose.lab.evaluate.networks.photographs import BOXES, FOLDER
from groundpose.lab.training.nothing_boxes import covered
from PIL import Image

KITTI = data_folder() / "kitti" / "training"
CODEC = Codec(128, 96)


class SaysBright:
    """Stands in for a network: a bright crop is a vehicle."""

    codec = CODEC

    def detect(self, crops):
        return type("Answer", (), {"vehicle": crops.mean(axis=(1, 2, 3)) / 255.0})


class SaysNothingOfIt:
    """Stands in for a network of before: it knows vehicles only."""

    codec = CODEC

    def detect(self, crops):
        return object()


def label(kind, *bbox):
    return KittiLabel(kind, 0.0, 0, 0.0, bbox, 1.0, 1.0, 1.0, (0.0, 0.0, 5.0), 0.0)


def test_rates_of_grey(tmp_path):
    found = nothing.rates(SaysBright(), tmp_path)
    assert set(found) == {"nothing"}  # no photographs there
    assert found["nothing"]["grey"] == {"boxes": nothing.FLAT, "called_vehicle": 0.5}
    assert found["nothing"]["all"]["boxes"] == 4 * nothing.FLAT
    everything = nothing.rates(SaysNothingOfIt(), tmp_path)["nothing"]
    assert all(kind["called_vehicle"] == 1.0 for kind in everything.values())


def test_crops_of_backgrounds_meet_no_label():
    taken = np.array([[300.0, 100, 500, 300], [0, 0, 90, 90]])
    rng = np.random.default_rng(1)
    boxes = nothing.background_boxes(np.array([1242.0, 375]), taken, rng, 20, CODEC)
    assert len(boxes) == 20
    for window in CODEC.windows(boxes):
        assert not covered(window, taken).any()
    full = np.array([[0.0, 0, 1242, 375]])
    assert nothing.background_boxes(np.array([1242.0, 375]), full, rng, 20, CODEC).shape == (0, 4)


def test_people_before_vehicles_do_not_count():
    labels = [
        label("Pedestrian", 0, 0, 20, 60),
        label("Cyclist", 100, 0, 140, 60),
        label("Car", 130, 0, 300, 90),
    ]
    np.testing.assert_array_equal(nothing.people_boxes(labels), [[0, 0, 20, 60]])
    assert nothing.people_boxes([]).shape == (0, 4)


def test_boxes_of_photographs_have_an_area():
    boxes = [box for kinds in BOXES.values() for found in kinds.values() for box in found]
    assert len(boxes) > 150
    assert all(right - left >= 18 and bottom - top >= 18 for left, top, right, bottom in boxes)


@pytest.mark.skipif(not (data_folder() / FOLDER).is_dir(), reason="no road photographs")
def test_boxes_of_photographs_are_in_them():
    for name, kinds in BOXES.items():
        with Image.open(data_folder() / FOLDER / name) as picture:
            width, height = picture.size
        for boxes in kinds.values():
            assert all(0 <= l < r <= width and 0 <= t < b <= height for l, t, r, b in boxes)  # noqa: E741


@pytest.mark.skipif(not KITTI.is_dir(), reason="no KITTI frames")
def test_rates_of_real_pictures():
    found = nothing.rates(SaysNothingOfIt())
    assert found["vehicles"]["called_none"] == 0.0
    assert found["vehicles"]["boxes"] % (2 * nothing.LOOKS) == 0
    assert found["nothing"]["street"]["boxes"] > 100
    people = sum(len(nothing.people_boxes(read_labels(path))) for path in (KITTI / "label_2").glob("*.txt"))
    assert found["nothing"]["person"]["boxes"] == people > 0


def test_page():
    rates = {"nothing": {"sky": {"boxes": 4, "called_vehicle": 0.25}}}
    (line,) = page._nothing({"ours": {"nothing": rates}, "older": {}})
    assert line == {"network": "ours", "sky: 4": 25.0}
    rates["vehicles"] = {"boxes": 12, "called_none": 0.5}
    assert page._nothing({"ours": {"nothing": rates}})[0]["vehicles called none: 12"] == 50.0
