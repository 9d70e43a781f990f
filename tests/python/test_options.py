"""Every option is read: each is changed here and something must follow."""

import itertools
from typing import get_args, get_type_hints

import groundpose as gp
import numpy as np
import pytest
from conftest import MODEL, Batch, make_batch, project
from groundpose._core import default_options

RNG = np.random.default_rng(0)
BODY = gp.ShapeModel(
    MODEL.keypoints_3d, MODEL.bbox_3d, 0.2 * RNG.normal(size=(2, 24, 3)) / np.sqrt(24.0), [0.5, 0.2]
)
RIGID, SHAPED = (
    make_batch(40, seed=4, outliers=0.4),
    make_batch(40, seed=5, model=BODY, shape=np.array([0.4, -0.3])),
)
CORNERS = np.array(list(itertools.product(*MODEL.bbox_3d.T)))
SCORES = np.where(RIGID.inlier, 0.9, 0.2)


def differ(a: gp.PoseBatch, b: gp.PoseBatch) -> bool:
    both = a.ok & b.ok
    return bool(both.any()) and not np.array_equal(a.t[both], b.t[both])


def longer_side(batch: Batch) -> np.ndarray:
    return np.maximum(batch.bboxes[:, 2] - batch.bboxes[:, 0], batch.bboxes[:, 3] - batch.bboxes[:, 1])


def lean(batch: Batch, poses: gp.PoseBatch) -> np.ndarray:
    """Angles between the objects' down axis and the ground's normal."""
    across = np.cross(poses.R[poses.ok, :, 1], batch.view.R_camera_from_ground[:, 1])
    return np.arcsin(np.clip(np.linalg.norm(across, axis=1), 0.0, 1.0))


def see_inlier_threshold():
    each = RNG.uniform(2.0, 9.0, 40)
    one, many = RIGID.estimate(inlier_threshold=3.5), RIGID.estimate(inlier_threshold=each)
    np.testing.assert_array_equal(one.inlier_threshold[one.ok], 3.5)
    np.testing.assert_array_equal(many.inlier_threshold[many.ok], each[many.ok])
    assert not np.array_equal(one.inlier_count, many.inlier_count)


def see_relative_threshold():
    for share in (0.02, 0.05):
        poses = RIGID.estimate(relative_threshold=share)
        np.testing.assert_allclose(poses.inlier_threshold[poses.ok], share * longer_side(RIGID)[poses.ok])


def see_confidence():
    few, many = (RIGID.estimate(confidence=p, refinement="hre") for p in (0.3, 0.999999))
    assert few.iterations.sum() < many.iterations.sum()


def see_solver():
    view = gp.View(RIGID.view.camera, RIGID.view.pitch, RIGID.view.roll, height=1.5)
    for solver in ("p1p", "p3p", "up2p", "p1p_height"):
        options = gp.Options(solver=solver)
        poses = gp.estimate_poses(view, RIGID.keypoints_2d, RIGID.bboxes, MODEL, None, options)
        assert poses.ok.mean() > 0.8
        assert set(poses.solver[poses.ok]) == {solver}
    assert set(RIGID.estimate().solver) == {"p1p"}


def see_cases():
    every, paper = RIGID.estimate(cases="all"), RIGID.estimate(cases="paper")
    assert paper.hypotheses.sum() < every.hypotheses.sum()


def see_scoring():
    assert differ(
        RIGID.estimate(scoring="msac", refinement="none"),
        RIGID.estimate(scoring="inliers", refinement="none"),
    )


def see_refinement():
    results = [RIGID.estimate(refinement=name) for name in ("default", "hre", "re", "gn", "none")]
    assert all(differ(a, b) for i, a in enumerate(results) for b in results[:i])
    assert results[-1].stage_iterations.sum() == 0 < results[0].stage_iterations.sum()


def see_hre_thresholds():
    a, b = (
        RIGID.estimate(refinement="hre", hre_thresholds=taus) for taus in ((1.0, 1.5, 3.0), (0.5, 0.6, 0.7))
    )
    assert differ(a, b)


def see_tilt_sigma():
    free, default, stiff, upright = (RIGID.estimate(tilt_sigma=s) for s in (np.inf, None, 0.001, 0.0))
    assert lean(RIGID, upright).max() < 1e-7
    assert lean(RIGID, upright).mean() < lean(RIGID, stiff).mean() < lean(RIGID, default).mean()
    assert lean(RIGID, default).mean() < lean(RIGID, free).mean()


def see_shape_prior():
    default, free, kept = (SHAPED.estimate(shape_prior=prior) for prior in (None, False, True))
    size = [np.nanmean(poses.shape_coefficients**2) for poses in (free, kept)]
    assert size[1] < size[0]
    np.testing.assert_array_equal(default.t, kept.t)
    hre, with_prior = SHAPED.estimate(refinement="hre"), SHAPED.estimate(refinement="hre", shape_prior=True)
    assert differ(hre, with_prior)


def see_bbox_sigma():
    """The more the box is believed, the better the poses' boxes fit to it."""
    misfit = []
    for sigma in (0.5, None, np.inf):
        poses = RIGID.estimate(bbox_sigma=sigma)
        pixels = project(RIGID.view, poses.R[poses.ok], poses.t[poses.ok], CORNERS)
        boxes = np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=1)
        misfit.append(np.abs(boxes - RIGID.bboxes[poses.ok]).mean())
    assert misfit[0] < misfit[1] < misfit[2]


def see_covariance():
    without = SHAPED.estimate(covariance=False)
    assert np.isnan(without.covariance).all()
    assert np.isnan(without.shape_covariance).all()
    assert np.isfinite(SHAPED.estimate().covariance[without.ok]).all()


def see_max_iterations():
    assert RIGID.estimate(solver="p3p", max_iterations=7).iterations.max() == 7
    assert RIGID.estimate(solver="p3p").iterations.max() > 7


def see_min_keypoints():
    assert RIGID.estimate(min_keypoints=24).ok.any()
    refused = RIGID.estimate(min_keypoints=25)
    assert set(refused.status) == {"too_few_keypoints"}


def see_max_log10_nfa():
    """Of objects whose keypoints are all wrong no larger share is accepted than was allowed for."""
    junk = make_batch(400, seed=6, outliers=1.0)
    assert junk.estimate(max_log10_nfa=np.inf, min_probability=0.0).ok.mean() > 0.9
    for most in (-1.0, -2.0):
        poses = junk.estimate(max_log10_nfa=most, min_probability=0.0)
        assert poses.ok.mean() <= 10.0**most
        assert (poses.log10_nfa[poses.ok] <= most).all()
        assert set(poses.status[~poses.ok]) <= {"no_consensus", "no_hypothesis"}


def see_keypoint_error_factor():
    narrow, wide = RIGID.estimate(), RIGID.estimate(keypoint_error_factor=15.0)
    assert (wide.covariance[wide.ok, 5, 5] > narrow.covariance[wide.ok, 5, 5]).all()


def see_keypoint_error_dof():
    assert RIGID.estimate(keypoint_error_dof=5.0).region() > RIGID.estimate().region()


def see_keypoint_error_shift():
    """A shift in the image moves the object across the ray, the further the more distant it is."""
    still, shifted = RIGID.estimate(), RIGID.estimate(keypoint_error_shift=0.01)
    more = (shifted.covariance - still.covariance)[still.ok]
    t = still.t[still.ok]
    assert (more[:, 3, 3] > 0.0).all()
    np.testing.assert_allclose(np.einsum("nij,nj->ni", more[:, 3:, 3:], t), 0.0, atol=1e-10)


def see_keypoint_error_turn():
    still, turned = RIGID.estimate(), RIGID.estimate(keypoint_error_turn=0.1)
    more = (turned.covariance - still.covariance)[still.ok]
    np.testing.assert_allclose(np.trace(more[:, :3, :3], axis1=1, axis2=2), 0.01)


def see_ambiguity_coefficients():
    """Only what viewing angles say is calibrated, by a line through the logits."""
    seen = (RIGID.view, RIGID.keypoints_2d, RIGID.bboxes, RIGID.models)
    angles = {"viewing_angle_probabilities": np.full((len(RIGID.t), 16), 1.0 / 16.0)}
    plain = gp.estimate_poses(*seen, **angles)
    asked = gp.estimate_poses(*seen, options=gp.Options(ambiguity_coefficients=(-2.0, 1.0)), **angles)
    logit = np.log(plain.ambiguity / (1.0 - plain.ambiguity))
    expected = 1.0 / (1.0 + np.exp(2.0 - logit))
    np.testing.assert_allclose(asked.ambiguity[asked.ok], expected[asked.ok])


def see_probability_coefficients():
    certain = RIGID.estimate(probability_coefficients=(9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(certain.probability[certain.ok], 1.0 / (1.0 + np.exp(-9.0)))


def see_min_probability():
    assert set(RIGID.estimate(min_probability=1.0).status) == {"improbable"}
    probable = RIGID.estimate(min_probability=0.6)
    assert (probable.probability[probable.ok] >= 0.6).all()


def see_score_weights():
    weighed, unweighed = RIGID.estimate(SCORES), RIGID.estimate(SCORES, score_weights=False)
    assert differ(weighed, unweighed)
    error = [np.linalg.norm(p.t - RIGID.t, axis=1)[p.ok].mean() for p in (weighed, unweighed)]
    assert error[0] < error[1]


def see_seed():
    assert differ(RIGID.estimate(solver="p3p", seed=1), RIGID.estimate(solver="p3p", seed=2))


@pytest.mark.parametrize("option", default_options())
def test_every_option_has_an_effect(option):
    globals()[f"see_{option}"]()


def test_options_are_those_of_the_core():
    public = {name: f.default for name, f in gp.Options.__dataclass_fields__.items() if f.init}
    assert public == default_options()
    assert all(getattr(gp.Options(), name) == value for name, value in default_options().items())


@pytest.mark.parametrize("option", ["solver", "cases", "scoring", "refinement"])
def test_choices_are_those_of_the_core(option):
    """A type checker knows the names that the core takes, in its order."""
    names = get_args(get_type_hints(gp.Options)[option])
    with pytest.raises(gp.InputError) as refused:
        gp.Options(**{option: "?"})
    assert str(refused.value) == f'{option}: expected one of {", ".join(names)}, got "?"'


def test_defaults_can_be_given_by_hand():
    assert gp.Options(**default_options()) == gp.Options()


def test_objects_with_only_wrong_keypoints_have_no_pose_by_default():
    assert make_batch(400, seed=7, outliers=1.0).estimate().ok.mean() <= 0.05
