"""Other libraries behind one interface: exact data give the exact pose; an absent library says so."""

import numpy as np
import pytest
from groundpose.lab.evaluate.rivals import POSELIB_TUNED, RIVALS, Rival
from groundpose.lab.evaluate.scenes import Scene, generate
from groundpose.lab.metrics import rotation_error_deg, translation_error_percent


def scene() -> Scene:
    return generate("cube", 1, n_points=60, outlier_ratio=0.2, noise_sigma=0.0).singles[0]


@pytest.mark.parametrize("rival", RIVALS, ids=lambda rival: rival.name)
def test_exact_data_give_the_exact_pose(rival: Rival) -> None:
    if reason := rival.missing():
        pytest.skip(reason)
    given = scene()
    answer = rival.solve(given)
    assert answer.R is not None
    assert answer.t is not None
    assert rotation_error_deg(given.R, answer.R) < 0.01
    assert translation_error_percent(given.t, answer.t) < 0.01
    assert 0.0 < answer.call_seconds <= answer.total_seconds


@pytest.mark.parametrize("rival", RIVALS, ids=lambda rival: rival.name)
def test_data_without_a_pose_is_no_answer_and_no_exception(rival: Rival) -> None:
    if reason := rival.missing():
        pytest.skip(reason)
    given = scene()
    few = Scene(given.keypoints_2d[:2], given.keypoints_3d[:2], given.camera, 4.0, given.R, given.t)
    answer = rival.solve(few)
    assert answer.R is None
    assert answer.t is None


def test_an_absent_library_is_reported() -> None:
    absent = Rival("nobody", "", "a_module_that_is_not_there", lambda *_: None)
    assert absent.missing() == "a_module_that_is_not_there is not installed"


def test_the_tuned_options_are_the_fair_ones() -> None:
    assert "min_iterations 0" in POSELIB_TUNED.options
    assert len({rival.name for rival in RIVALS}) == len(RIVALS)
    assert all(rival.options for rival in RIVALS)


def test_an_object_alone_has_only_its_seen_keypoints() -> None:
    scenes = generate("vehicle", 4)
    for k, single in enumerate(scenes.singles):
        assert np.isfinite(single.keypoints_2d).all()
        assert np.isfinite(single.keypoints_3d).all()
        assert len(single.keypoints_2d) == np.isfinite(scenes.keypoints_2d[k, :, 0]).sum()
        assert 20 <= len(single.keypoints_2d) <= 30
