"""The table of the keypoints."""

import re
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab.bodies import drawing
from groundpose.vehicles import CLASSES, KEYPOINTS, flip_indices, keypoint_indices, keypoint_names

PAGE = Path(__file__).parents[2] / "docs" / "vehicles.md"


def test_counts_are_the_papers() -> None:
    counts = {class_name: len(keypoint_indices(class_name)) for class_name in CLASSES}
    assert counts == {"car": 28, "van_bus": 26, "pickup": 26, "box_truck": 30}
    assert len(KEYPOINTS) == 53
    assert len({keypoint.name for keypoint in KEYPOINTS}) == len(KEYPOINTS)


def test_every_keypoint_belongs_to_a_class_and_shared_ones_are_shared() -> None:
    used = np.concatenate([keypoint_indices(class_name) for class_name in CLASSES])
    assert set(used.tolist()) == set(range(len(KEYPOINTS)))
    shared = set.intersection(*(set(keypoint_names(class_name)) for class_name in CLASSES))
    assert {"left_front_wheel", "right_headlamp", "front_plate"} <= shared


def test_partners_are_mutual_and_of_the_same_classes() -> None:
    by_name = {keypoint.name: keypoint for keypoint in KEYPOINTS}
    for keypoint in KEYPOINTS:
        if keypoint.partner is None:
            assert not keypoint.name.startswith(("left_", "right_"))
            continue
        partner = by_name[keypoint.partner]
        assert partner.partner == keypoint.name
        assert (partner.where, partner.classes) == (keypoint.where, keypoint.classes)
        assert keypoint.name.split("_")[0] != partner.name.split("_")[0]


def test_flipping_twice_changes_nothing() -> None:
    flip = flip_indices()
    np.testing.assert_array_equal(flip[flip], np.arange(len(KEYPOINTS)))
    assert np.count_nonzero(flip == np.arange(len(KEYPOINTS))) == 3  # both plates and the tailgate


def test_unknown_class_is_named() -> None:
    with pytest.raises(gp.InputError, match=r"class_name: expected one of car, .* got 'tram'"):
        keypoint_names("tram")


def test_the_page_shows_the_table() -> None:
    rows = dict(re.findall(r"^\| (\d+) \| `(\w+)` ", PAGE.read_text(encoding="utf-8"), re.M))
    assert rows == {str(i): keypoint.name for i, keypoint in enumerate(KEYPOINTS)}


def test_the_drawing_numbers_every_keypoint_in_both_views() -> None:
    figure = drawing.draw_keypoints("pickup", pixels_per_metre=15.0)
    for axes in figure.axes:
        assert sorted(int(text.get_text()) for text in axes.texts) == keypoint_indices("pickup").tolist()
