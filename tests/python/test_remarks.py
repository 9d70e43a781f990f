"""What a batch of poses says of its input: the tilt that the objects disagree with."""

from __future__ import annotations

import math

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab.evaluate.misled import pitched, upside_down, vehicles
from groundpose.remarks import FEWEST_OBJECTS, tilt_remarks

CAMERA = gp.Camera(1000.0, 1000.0, 960.0, 540.0, image_size=(1920, 1080))


def poses_of(scenes, count: int = 12, **more):
    some = scenes[:count]
    return gp.estimate_poses(some.view, some.keypoints_2d, some.bboxes, some.models, **more)


def test_nothing_is_said_of_vehicles_on_the_ground() -> None:
    scenes = vehicles(240, seed=3)
    said = [poses_of(scenes[first:]).remarks for first in range(0, 240, 12)]
    assert said == [()] * 20


@pytest.mark.parametrize("degrees", [15.0, 20.0, 30.0])
def test_a_wrong_pitch_is_said(degrees: float) -> None:
    for scenes in pitched(degrees)(80, 1):
        (remark,) = poses_of(scenes).remarks
        words, stated = remark.removesuffix(" deg").rsplit(" ", 1)
        assert words == "the vehicles disagree with the nominal pitch by"
        assert float(stated) == pytest.approx(degrees, abs=3.0)


def test_an_image_upside_down_is_said() -> None:
    (scenes,) = upside_down(12, 2)
    assert poses_of(scenes).remarks == (
        "the vehicles stand upside down: the image may be turned by half a turn",
    )


def test_nothing_is_said_of_a_tilt_that_comes_from_the_objects() -> None:
    scenes = pitched(20.0)(80, 1)[0]
    assert poses_of(scenes, frame_tilt_sigma=math.radians(15.0)).remarks == ()


def leaning(*degrees: float):
    angles = np.radians(degrees)
    R = [gp.View(CAMERA, roll=float(angle)).R_camera_from_ground for angle in angles]
    return np.stack(R), np.tile(1e-4 * np.eye(6), (len(degrees), 1, 1))


def test_few_objects_and_objects_of_different_opinions_say_nothing() -> None:
    view = gp.View(CAMERA)
    assert tilt_remarks(view, *leaning(*[20.0] * (FEWEST_OBJECTS - 1))) == ()
    assert tilt_remarks(view, *leaning(20.0, 20.0, 20.0)) == (
        "the vehicles disagree with the nominal roll by 20 deg",
    )
    assert tilt_remarks(view, *leaning(20.0, 20.0, 20.0, 0.0, -20.0, 40.0)) == ()
    assert tilt_remarks(view, np.empty((0, 3, 3)), np.empty((0, 6, 6))) == ()


def test_unsure_objects_say_nothing() -> None:
    R, covariance = leaning(*[12.0] * 4)
    assert tilt_remarks(gp.View(CAMERA), R, covariance) != ()
    assert tilt_remarks(gp.View(CAMERA), R, 400.0 * covariance) == ()


def test_poses_without_covariance_have_remarks_too() -> None:
    scenes = pitched(20.0)(80, 1)[0]
    assert poses_of(scenes, options=gp.Options(covariance=False)).remarks
