"""One camera over many frames: what `frame=CameraState(...)` learns, keeps and says."""

import json
import pickle

import groundpose as gp
import numpy as np
import pytest
from groundpose.demo.street import IMAGE, example
from test_frame import CAMERA, NOMINAL, SURE, TRUTH, errors, scene


def learned(frames=60, view=NOMINAL, priors=SURE, scale=0.94):
    state = gp.CameraState(view, priors)
    for seed in range(frames):
        keypoints, boxes, model, _ = scene(scale=scale, seed=seed)
        gp.estimate_poses(view, keypoints, boxes, model, frame=state)
    return state


def test_it_learns():
    state = learned()
    assert abs(state.mean_view(NOMINAL).pitch - TRUTH.pitch) < 0.003
    mean, sigma = state.class_scales["car"]
    assert -0.09 < mean < -0.02
    first = gp.CameraState(NOMINAL, SURE)
    keypoints, boxes, model, places = scene(scale=0.94, seed=99)
    fresh = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=first)
    after = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=state)
    assert sigma < first.class_scales["car"][1]
    assert np.abs(errors(after, places)).mean() < 1.1 * np.abs(errors(fresh, places)).mean()
    assert after.view.pitch_sigma < fresh.view.pitch_sigma
    assert state.remarks == ()
    assert "height=1.6" in repr(state)


def test_the_first_frame_is_that_of_the_priors():
    keypoints, boxes, model, _ = scene()
    alone = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=SURE)
    first = gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=gp.CameraState(NOMINAL, SURE))
    np.testing.assert_allclose(first.t, alone.t, rtol=1e-12)


def test_another_drive_forgets_the_tilt():
    state = learned()
    height, scales = state.height, state.class_scales
    state.start_drive()
    assert state.mean_view(NOMINAL).pitch == 0.0
    assert state.height == pytest.approx(height)
    assert state.class_scales["car"] == pytest.approx(scales["car"])


def test_without_a_height_only_the_tilt_is_learned():
    view = gp.View(CAMERA)
    state = learned(view=view)
    assert state.height is None
    assert state.class_scales["car"] == pytest.approx((0.0, gp.SizePrior.region().scale("car")[1]))
    assert abs(state.mean_view(view).pitch - TRUTH.pitch) < 0.004


def test_a_wrong_height_is_noticed_over_frames():
    view = gp.View(CAMERA, height=2.0)
    sizes = gp.SizePrior.from_dimensions({"car": scene()[2].size})
    priors = gp.FramePriors(SURE.pitch_sigma, SURE.roll_sigma, size=sizes)
    remarks = learned(20, view, priors, scale=1.0).remarks
    assert len(remarks) == 1
    assert "lower" in remarks[0]


def test_what_is_saved_is_loaded(tmp_path):
    europe = gp.FramePriors(size=gp.SizePrior.region("europe"))
    for state in (learned(3), learned(3, priors=europe), gp.CameraState(NOMINAL)):
        state.save(tmp_path / "camera.json")
        again = gp.CameraState.load(tmp_path / "camera.json")
        assert again.view == state.view
        assert again.height == state.height
        assert again.class_scales == state.class_scales
        keypoints, boxes, model, _ = scene(seed=5)
        t = [gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=s).t for s in (state, again)]
        np.testing.assert_array_equal(*t)


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"version": 1}', '{"version": 7}'])
def test_files_that_are_not_ours(tmp_path, text):
    path = tmp_path / "camera.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(gp.InputError, match="camera"):
        gp.CameraState.load(path)
    with pytest.raises(OSError, match="nothing"):
        gp.CameraState.load(tmp_path / "nothing.json")


def test_damaged_numbers_are_not_used(tmp_path):
    path = tmp_path / "camera.json"
    learned(3).save(path)
    content = json.loads(path.read_text(encoding="utf-8"))
    content["mean"] = content["mean"][:5]
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(gp.InputError):
        gp.CameraState.load(path)


def test_mistakes():
    keypoints, boxes, model, _ = scene()
    with pytest.raises(TypeError, match="view"):
        gp.CameraState(3)
    with pytest.raises(TypeError, match="priors"):
        gp.CameraState(NOMINAL, 3)
    with pytest.raises(gp.InputError, match="height"):
        gp.CameraState(gp.View(CAMERA, height=1500.0))
    state = gp.CameraState(NOMINAL)
    with pytest.raises(gp.InputError, match="view: expected pitch, roll and height of the camera's state"):
        gp.estimate_poses(TRUTH, keypoints, boxes, model, frame=state)


def test_no_vehicles_and_two_classes():
    state = gp.CameraState(NOMINAL, SURE)
    keypoints, boxes, model, _ = scene()
    gp.estimate_poses(NOMINAL, keypoints[:0], boxes[:0], model, frame=state)
    assert state.class_scales == {}
    gp.estimate_poses(NOMINAL, keypoints, boxes, model, frame=state)
    van = gp.ShapeModel(model.keypoints_3d, model.bbox_3d, model.basis, model.eigenvalues, name="van")
    poses = gp.estimate_poses(NOMINAL, keypoints, boxes, [van, van, model, model, van], frame=state)
    assert list(state.class_scales) == list(poses.view.class_scales) == ["car", "van"]


def test_a_pipeline_learns_its_camera(tmp_path):
    street = example()
    view = gp.View(street.view.camera, street.view.pitch, street.view.roll, height=1.5)
    state, by_hand = gp.CameraState(view), gp.CameraState(view)
    pipeline = gp.Pipeline(threads=1, camera_state=state)
    plain = gp.Pipeline(pipeline.network, threads=1)
    for _ in range(2):
        learned = pipeline(IMAGE, street.bboxes, view)
        np.testing.assert_array_equal(learned.t, plain(IMAGE, street.bboxes, view, frame=by_hand).t)
    assert state.class_scales == by_hand.class_scales
    assert state.class_scales["car"][1] < gp.CameraState(view).priors.numbers(["car"])[1][0, 1]
    state.save(tmp_path / "camera.json")
    again = gp.Pipeline(pipeline.network, camera_state=gp.CameraState.load(tmp_path / "camera.json"))
    copied = pickle.loads(pickle.dumps(pipeline))
    expected = pipeline(IMAGE, street.bboxes, view).t
    for other in (again, copied):
        np.testing.assert_array_equal(other(IMAGE, street.bboxes, view).t, expected)
    with pytest.raises(gp.InputError, match="frame: expected None where the pipeline has a camera_state"):
        pipeline(IMAGE, street.bboxes, view, frame=gp.FramePriors())
    with pytest.raises(TypeError, match="camera_state"):
        gp.Pipeline(pipeline.network, camera_state=view)
