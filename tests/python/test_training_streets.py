"""Labelled real frames: what is read, what is judged, that a failure counts as one."""

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab.data import data_folder

pytest.importorskip("onnx", reason="onnx is not installed (extra [train])")
from groundpose.keypoints.pipeline import Pipeline
from groundpose.lab.training.streets import judge, looks, sheet, streets, summary
from test_network import write

FOLDER = data_folder() / "kitti" / "training"


def test_a_folder_without_frames(tmp_path):
    with pytest.raises(gp.InputError, match="expected frames in KITTI's layout"):
        streets(tmp_path)


@pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no real data at {FOLDER}")
def test_frames_are_read_and_judged(tmp_path):
    frames = streets(FOLDER)
    assert len(frames) == 9
    assert sum(len(f.bboxes) for f in frames) == 27
    assert sum(f.easy.sum() for f in frames) == 7
    for f in frames:
        np.testing.assert_allclose(
            f.R @ np.swapaxes(f.R, 1, 2), np.broadcast_to(np.eye(3), f.R.shape), atol=1e-9
        )
    judged = [judge(Pipeline(write(tmp_path / "n.onnx"), threads=1), f) for f in frames[:3]]
    numbers = summary(judged)
    for j in judged:
        assert np.all(j.rotation_error[~j.poses.ok] == 180.0)
        assert np.all(j.yaw_error[~j.poses.ok] == 180.0)
    assert numbers["all: class right %"] == 100.0  # the stand-in calls everything a car
    assert numbers["all: yaw above 30 deg %"] > 20.0  # and knows nothing of poses
    assert sheet(judged, columns=2).size == (512, -(-int(numbers["all: vehicles"]) // 2) * 192)


@pytest.mark.skipif(not FOLDER.is_dir(), reason=f"no real data at {FOLDER}")
def test_looks_are_the_frame_and_its_mirror_image_with_moved_boxes():
    street = streets(FOLDER)[0]
    given, moved, mirrored, _ = looks(street, 2)
    np.testing.assert_array_equal(given.bboxes, street.bboxes)
    assert 0.0 < np.abs(moved.bboxes - street.bboxes).max() < 0.07 * np.ptp(street.bboxes)
    np.testing.assert_array_equal(mirrored.image[:, 0], street.image[:, -1])
    np.testing.assert_allclose(mirrored.R[:, 0, 2], -street.R[:, 0, 2])  # forward to the other side
    np.testing.assert_allclose(np.linalg.det(mirrored.R), 1.0)
    twice = looks(mirrored, 1)[1]
    np.testing.assert_array_equal(twice.image, street.image)
    for name in ("bboxes", "R"):
        np.testing.assert_allclose(getattr(twice, name), getattr(street, name), atol=1e-9)
    assert twice.view == street.view
