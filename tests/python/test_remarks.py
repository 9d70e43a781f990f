"""What a batch of poses says of its input: the tilt that the objects disagree with."""

from __future__ import annotations

import math

import groundpose as gp
import numpy as np
import pytest
from conftest import make_batch
from groundpose.formats.boxes import Box, Boxes
from groundpose.lab.evaluate.misled import pitched, upside_down, vehicles
from groundpose.remarks import FEWEST_OBJECTS, estimated_tilt_remarks, tilt_remarks

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
        assert words == "nominal pitch: the vehicles disagree with it by"
        assert float(stated) == pytest.approx(degrees, abs=3.0)


def test_an_image_upside_down_is_said() -> None:
    (scenes,) = upside_down(12, 2)
    assert poses_of(scenes).remarks == (
        "upside down: the vehicles stand so; the image may be turned by half a turn",
    )


def test_nothing_is_said_of_a_tilt_that_comes_from_the_objects() -> None:
    scenes = pitched(20.0)(80, 1)[0]
    assert poses_of(scenes, frame_tilt_sigma=math.radians(15.0)).remarks == ()


@pytest.mark.parametrize("frame", [False, True])
def test_a_sign_of_the_other_convention_is_said(frame: bool) -> None:
    """The vehicles see -8 deg where +8 are nominal, alone and with a tilt that is estimated."""
    true = gp.View(CAMERA, pitch=math.radians(-8.0))
    wrong = gp.View(CAMERA, pitch=math.radians(8.0))
    batch = make_batch(12, seed=2, outliers=0.1, view=true)
    sigma = math.radians(5.0) if frame else None
    poses = gp.estimate_poses(
        *(wrong, batch.keypoints_2d, batch.bboxes, batch.models), frame_tilt_sigma=sigma
    )
    (remark,) = (remark for remark in poses.remarks if remark.startswith("nominal pitch: "))
    assert remark.endswith(" deg; is its sign of another convention?")
    assert poses.nominal_view == wrong


def test_a_tilt_estimated_far_from_the_nominal_one_is_said() -> None:
    nominal, sigmas = gp.View(CAMERA, pitch=0.02, roll=0.01), np.array([0.01, 0.02])
    assert estimated_tilt_remarks(nominal, gp.View(CAMERA, pitch=0.035, roll=0.04), sigmas) == ()
    assert estimated_tilt_remarks(nominal, gp.View(CAMERA, pitch=0.06, roll=-0.01), sigmas) == (
        "nominal pitch: the vehicles disagree with it by 2 deg",
    )
    assert estimated_tilt_remarks(nominal, gp.View(CAMERA, roll=0.5), np.full(2, np.nan)) == ()


def test_camera_boxes_and_answers_are_judged_without_a_network_too() -> None:
    scenes = vehicles(12, seed=3)
    camera = gp.Camera(9.0, 9.0, 10.0, 540.0, image_size=(1920, 1080))
    poses = gp.estimate_poses(
        *(gp.View(camera, pitch=1.0), scenes.keypoints_2d, scenes.bboxes + 9000.0, scenes.models)
    )
    kinds = [remark.partition(":")[0] for remark in poses.remarks]
    assert kinds[:4] == ["principal point", "field of view", "pitch", "boxes outside the image"]
    nothing = gp.estimate_poses(scenes.view, np.full_like(scenes.keypoints_2d, np.nan), None, scenes.models)
    assert nothing.remarks == ("no answer: none of 12 objects has a pose (12 too_few_keypoints)",)


def test_what_was_done_to_the_boxes_is_in_the_remarks(tmp_path) -> None:
    stand_in = pytest.importorskip("stand_in")
    pipeline = gp.Pipeline(stand_in.write(tmp_path / "car.onnx"))
    boxes = Boxes((Box((10.0, 10.0, 60.0, 40.0), 7, "car"),), size=(100, 50))
    poses = pipeline(np.zeros((100, 200, 3), np.uint8), boxes, gp.View(gp.Camera(200.0, 200.0, 100.0, 50.0)))
    kinds = [remark.partition(":")[0] for remark in poses.remarks]
    assert kinds == ["boxes of another image size", "no answer"]
    assert poses.bboxes.tolist() == [[20.0, 20.0, 120.0, 80.0]]


def leaning(*degrees: float):
    angles = np.radians(degrees)
    R = [gp.View(CAMERA, roll=float(angle)).R_camera_from_ground for angle in angles]
    return np.stack(R), np.tile(1e-4 * np.eye(6), (len(degrees), 1, 1))


def test_few_objects_and_objects_of_different_opinions_say_nothing() -> None:
    view = gp.View(CAMERA)
    assert tilt_remarks(view, *leaning(*[20.0] * (FEWEST_OBJECTS - 1))) == ()
    assert tilt_remarks(view, *leaning(20.0, 20.0, 20.0)) == (
        "nominal roll: the vehicles disagree with it by 20 deg",
    )
    assert tilt_remarks(view, *leaning(20.0, 20.0, 20.0, 0.0, -20.0, 40.0)) == ()
    assert tilt_remarks(view, np.empty((0, 3, 3)), np.empty((0, 6, 6))) == ()


def test_objects_without_a_pose_have_no_opinion() -> None:
    R, covariance = leaning(*[20.0] * (FEWEST_OBJECTS + 1))
    said = tilt_remarks(gp.View(CAMERA), R, covariance)
    R[0], covariance[0] = np.nan, np.nan
    assert tilt_remarks(gp.View(CAMERA), R, covariance) == said != ()
    R[1], covariance[1] = np.nan, np.nan
    assert tilt_remarks(gp.View(CAMERA), R, covariance) == ()


def test_unsure_objects_say_nothing() -> None:
    R, covariance = leaning(*[12.0] * 4)
    assert tilt_remarks(gp.View(CAMERA), R, covariance) != ()
    assert tilt_remarks(gp.View(CAMERA), R, 400.0 * covariance) == ()


def test_poses_without_covariance_have_remarks_too() -> None:
    scenes = pitched(20.0)(80, 1)[0]
    assert poses_of(scenes, options=gp.Options(covariance=False)).remarks
