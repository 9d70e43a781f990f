"""Labelled real frames: what is read, what is judged, that a failure counts as one."""

import groundpose as gp
import numpy as np
import pytest
from groundpose.evaluate.real_data import data_folder

pytest.importorskip("onnx", reason="onnx is not installed (extra [train])")
from groundpose.keypoints.pipeline import Pipeline
from groundpose.training.streets import judge, sheet, streets, summary
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
