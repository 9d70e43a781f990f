"""Remarks: what looks wrong is said, what can be right is not."""

import math

import groundpose as gp
import numpy as np
import pytest
from groundpose.demo import example
from groundpose.plausibility import answer_remarks, box_remarks, camera_remarks, other_reading

SIZE = (1914, 1080)
TRUE = example().bboxes
NAN = np.full((1, 4), np.nan)


def fisheye(fx: float) -> gp.Camera:
    return gp.Camera(fx, fx, 956.5, 539.5, (0.0, 0.0, 0.0, 0.0), SIZE, "equidistant")


def camera(fx: float = 1000.0, cx: float = 956.5, cy: float = 539.5) -> gp.Camera:
    return gp.Camera(fx, fx, cx, cy, image_size=SIZE)


@pytest.mark.parametrize(
    ("view", "kinds"),
    [
        (gp.View(camera()), []),
        (gp.View(camera(cx=700.0, cy=400.0)), []),
        (gp.View(gp.Camera(1.0, 1.0, 0.0, 0.0)), []),  # nothing is known of the image
        (gp.View(camera(cx=200.0)), ["principal point"]),
        (gp.View(camera(cy=0.0)), ["principal point"]),
        (gp.View(camera(fx=1.5)), ["field of view"]),
        # a circle of 190 degrees; a lens that ends within the picture; one of 2 degrees; no lens sees 275
        (gp.View(fisheye(325.0)), []),
        (gp.View(gp.Camera(200.0, 200.0, 956.5, 539.5, (-0.2, 0.6), SIZE, "double_sphere")), []),
        (gp.View(fisheye(4e4)), ["field of view"]),
        (gp.View(fisheye(225.0)), ["field of view"]),
        (gp.View(camera(fx=1e6)), ["field of view"]),
        (gp.View(camera(), pitch=math.radians(-30)), []),
        (gp.View(camera(), pitch=math.radians(-50)), ["pitch"]),
        (gp.View(camera(), pitch=1.5), ["pitch"]),
    ],
)
def test_cameras(view, kinds):
    assert [remark.partition(":")[0] for remark in camera_remarks(view)] == kinds


def xywh(b: np.ndarray) -> np.ndarray:
    return np.concatenate([b[:, :2], b[:, 2:] - b[:, :2]], axis=1)


def added(b: np.ndarray) -> np.ndarray:
    return np.concatenate([b[:, :2], b[:, :2] + b[:, 2:]], axis=1)


def centred(b: np.ndarray) -> np.ndarray:
    return np.concatenate([0.5 * (b[:, :2] + b[:, 2:]), b[:, 2:] - b[:, :2]], axis=1)


READINGS = {
    "left, top, width, height": xywh(TRUE),
    "where the format has left, top, width, height": added(TRUE),
    "fractions of the image": TRUE / [*SIZE, *SIZE],
    "centre x, centre y, width, height": centred(TRUE)[TRUE[:, 0] < 1000.0],
    "top, left, bottom, right": TRUE[TRUE[:, 2] > 1200.0][:, [1, 0, 3, 2]],
}


@pytest.mark.parametrize("meant", READINGS)
def test_boxes_that_mean_something_else(meant):
    found = other_reading(READINGS[meant], SIZE)
    assert meant in found or found == "left, top, width, height"
    assert found in box_remarks(READINGS[meant], SIZE)[0]


@pytest.mark.parametrize(
    ("bboxes", "kinds"),
    [
        (TRUE, []),
        (np.empty((0, 4)), []),
        (NAN, []),
        (np.array([[0.0, 0.0, 1.0, 1.0]]), []),  # a box in the corner
        (TRUE * 2.0, ["boxes outside the image"]),
        (np.array([[0.2, 0.3, 0.5, 0.9]]), ["boxes within 0..1"]),
        (
            np.concatenate([TRUE, [[500.0, 500.0, 60.0, 600.0]], NAN]),
            ["boxes with right < left or bottom < top"],
        ),
        (np.array([[-150.0, -50.0, 100.0, 1150.0]]), []),  # an amodal box
        (np.array([[1900.0, 10.0, 1e20, 40.0]]), ["boxes outside the image"]),
    ],
)
def test_boxes(bboxes, kinds):
    assert [remark.partition(":")[0] for remark in box_remarks(bboxes, SIZE)] == kinds


@pytest.mark.parametrize(
    ("bboxes", "kinds"),
    [
        (TRUE, []),
        (np.array([[-1e5, 10.0, 1e20, 40.0]]), []),
        (np.array([[0.2, 0.3, 0.5, 0.9]]), ["boxes within 0..1"]),
        (xywh(TRUE), ["boxes with right < left or bottom < top"]),
        (NAN, []),
    ],
)
def test_boxes_of_an_image_of_unknown_size(bboxes, kinds):
    assert [remark.partition(":")[0] for remark in box_remarks(bboxes, None)] == kinds


def test_answers():
    assert answer_remarks([]) == []
    assert answer_remarks(["ok", "no_consensus"]) == []
    assert answer_remarks(["no_consensus", "not_a_vehicle", "no_consensus"]) == [
        "no answer: none of 3 objects has a pose (2 no_consensus, 1 not_a_vehicle)"
    ]
