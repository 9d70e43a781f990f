"""How sure an answer is: regions, the error factor, the probability and what it refuses, alternatives."""

import groundpose as gp
import numpy as np
import pytest
from conftest import CAMERA, MODEL, VIEW, rotation_y
from groundpose.keypoints.certainty import Certainty

COUNT = 40
TRUSTS_THE_NETWORK = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0)
"""Coefficients for which an answer is right unless the network says that it is turned round."""
BIN = 2.0 * np.pi / 16


def _scene():
    rng = np.random.default_rng(5)
    R = VIEW.R_camera_from_ground @ rotation_y(rng.uniform(-3.1, 3.1, COUNT))
    ground = np.stack([rng.uniform(-5, 5, COUNT), np.full(COUNT, 1.6), rng.uniform(10, 30, COUNT)], axis=1)
    t = ground @ VIEW.R_camera_from_ground.T
    points = MODEL.keypoints_3d @ np.swapaxes(R, 1, 2) + t[:, None]
    pixels = CAMERA.project(points) + rng.normal(0.0, 0.7, (COUNT, len(MODEL.keypoints_3d), 2))
    low, high = MODEL.bbox_3d
    corners = np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    box = CAMERA.project(corners @ np.swapaxes(R, 1, 2) + t[:, None])
    return R, t, pixels, np.concatenate([box.min(axis=1), box.max(axis=1)], axis=1)


R, T, PIXELS, BOXES = _scene()
SCORES = np.full(PIXELS.shape[:2], 0.8)


def estimate(pixels=PIXELS, scores=SCORES, boxes=BOXES, said=None, **options):
    return gp.estimate_poses(VIEW, pixels, boxes, MODEL, scores, gp.Options(**options), 1, **(said or {}))


def alpha_of(poses):
    """KITTI's viewing angle of each pose."""
    bottom = poses.t  # the model's origin is below its middle, on the ground
    return np.arctan2(poses.R[:, 0, 2], poses.R[:, 2, 2]) - np.pi / 2 - np.arctan2(bottom[:, 0], bottom[:, 2])


def angles(alpha, turned):
    """(N, 16) with the probability `turned` in the bin opposite to that of `alpha`."""
    own = np.round(alpha / BIN).astype(int) % 16
    found = np.zeros((len(own), 16))
    found[np.arange(len(own)), own] = 1.0 - turned
    found[np.arange(len(own)), (own + 8) % 16] = turned
    return found


def test_region_of_the_tails_chosen():
    assert estimate().region(0.95) == pytest.approx(12.592, abs=1e-3)
    heavy = estimate(keypoint_error_dof=5.0)
    assert heavy.region(0.95) == pytest.approx(6 * 4.9503 * 3 / 5, abs=1e-3)
    assert heavy.region(0.95, dimensions=1) == gp.region_radius2(0.95, 1, 5.0)


def test_region_holds_draws_of_student_t():
    rng, dof = np.random.default_rng(1), 6.0
    draws = rng.normal(size=(100_000, 3)) / np.sqrt(rng.chisquare(dof, (100_000, 1)) / dof)
    squared = (draws**2).sum(axis=1) * (dof - 2.0) / dof  # against the covariance
    for level in (0.5, 0.9, 0.95):
        assert np.mean(squared <= gp.region_radius2(level, 3, dof)) == pytest.approx(level, abs=0.005)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [((1.5, 6), "level"), ((0.95, 0), "dimensions"), ((0.95, 6, 2.0), "dof"), ((float("nan"), 6), "level")],
)
def test_regions_that_cannot_be(arguments, name):
    with pytest.raises(gp.InputError, match=name):
        gp.region_radius2(*arguments)


def test_error_factor_widens_the_covariance_and_nothing_else():
    narrow, wide = estimate(), estimate(keypoint_error_factor=15.0)
    np.testing.assert_array_equal(narrow.R, wide.R)
    np.testing.assert_array_equal(narrow.t, wide.t)
    ratio = np.diagonal(wide.covariance, axis1=1, axis2=2) / np.diagonal(narrow.covariance, axis1=1, axis2=2)
    assert (ratio > 1.0).all()
    assert (ratio <= 15.0 + 1e-6).all()
    # what the ground says of the lean is not a keypoint's error
    assert np.median(ratio[:, 5]) > 8.0


def test_probability_of_good_answers_and_of_wrong_keypoints():
    rng = np.random.default_rng(2)
    low, high = BOXES[:, None, :2], BOXES[:, None, 2:]
    junk = estimate(low + (high - low) * rng.random(PIXELS.shape), max_log10_nfa=np.inf, min_probability=0.0)
    good = estimate(min_probability=0.0)
    assert good.ok.all()
    assert good.probability.min() > 0.7
    assert np.nanmax(junk.probability) < good.probability.min()


def test_scores_count_absolutely():
    """A detector that believes nothing it says does not get the same answer as sure."""
    as_given, tiny = estimate(min_probability=0.0), estimate(scores=1e-6 * SCORES, min_probability=0.0)
    np.testing.assert_array_equal(as_given.R, tiny.R)
    assert (tiny.probability < 0.2 * as_given.probability).all()


def test_improbable_answers_are_refused():
    assert estimate(min_probability=0.0).ok.all()
    refused = estimate(min_probability=1.0)
    assert set(refused.status) == {"improbable"}
    assert np.isnan(refused.R).all()
    assert np.isnan(refused.probability).all()


def test_probability_is_the_logistic_of_the_evidence():
    coefficients = (0.3, 0.5, -0.2, -0.7, -0.1, 0.4, -0.3)
    poses = estimate(
        said={"vehicle_probability": np.linspace(0.01, 0.99, COUNT)},
        probability_coefficients=coefficients,
        min_probability=0.0,
    )
    logit = coefficients[0] + poses.evidence @ coefficients[1:]
    np.testing.assert_allclose(poses.probability, 1.0 / (1.0 + np.exp(-logit)), rtol=1e-12)
    p = np.linspace(0.01, 0.99, COUNT)
    np.testing.assert_allclose(poses.evidence[:, 4], np.log(p / (1.0 - p)), rtol=1e-9)
    np.testing.assert_allclose(poses.evidence[:, 0], np.log(0.8 / 0.2), rtol=1e-9)


def test_viewing_angles_give_ambiguity_and_alternative():
    plain = estimate(min_probability=0.0)
    said = {"viewing_angle_probabilities": angles(alpha_of(plain), 0.3)}
    poses = estimate(said=said, min_probability=0.0, probability_coefficients=TRUSTS_THE_NETWORK)
    np.testing.assert_array_equal(poses.R, plain.R)
    np.testing.assert_allclose(poses.ambiguity, 0.3, atol=1e-12)
    other = poses.alternatives
    forward = np.einsum("ni,ni->n", other.R[:, :, 2], poses.R[:, :, 2])
    assert (forward < 0.0).all()
    assert np.isfinite(other.covariance).all()
    expected = np.minimum(poses.probability * 0.3 / 0.7, 1.0 - poses.probability)
    np.testing.assert_allclose(other.probability, expected, rtol=1e-9)
    turned = np.angle(np.exp(1j * (other.yaw - poses.yaw)))
    assert (np.abs(turned) > np.pi / 2).all()


def test_no_alternative_below_two_percent():
    said = {"viewing_angle_probabilities": angles(alpha_of(estimate()), 0.01)}
    options = {"min_probability": 0.0, "probability_coefficients": TRUSTS_THE_NETWORK}
    other = estimate(said=said, **options).alternatives
    assert np.isnan(other.probability).all()
    assert np.isnan(other.R).all()


def test_what_a_network_did_not_say():
    unknown = {
        "vehicle_probability": np.full(COUNT, np.nan),
        "viewing_angle_probabilities": np.full((COUNT, 16), np.nan),
    }
    plain, poses = estimate(min_probability=0.0), estimate(said=unknown, min_probability=0.0)
    np.testing.assert_array_equal(plain.probability, poses.probability)
    np.testing.assert_array_equal(plain.ambiguity, poses.ambiguity)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("vehicle_probability", np.zeros(COUNT + 1)),
        ("viewing_angle_probabilities", np.zeros((COUNT, 8))),
    ],
)
def test_shapes_of_what_a_network_says(name, value):
    with pytest.raises(gp.InputError, match=name):
        estimate(said={name: value})


def test_one_bad_probability_spoils_its_own_object_alone():
    p = np.full(COUNT, 0.9)
    p[3] = 1.7
    poses = estimate(said={"vehicle_probability": p}, min_probability=0.0)
    assert poses.status[3] == "invalid_input"
    assert poses.ok.sum() == COUNT - 1


def test_certainty_fills_what_is_open():
    own = Certainty(12.0, 6.0, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.4)
    assert Certainty.of(own.numbers()) == own
    options = own.applied(gp.Options(keypoint_error_factor=2.0))
    assert options.keypoint_error_factor == 2.0
    assert (options.keypoint_error_dof, options.min_probability) == (6.0, 0.4)
    assert options.probability_coefficients == own.probability_coefficients


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("keypoint_error_factor", 0.5),
        ("keypoint_error_dof", 2.0),
        ("min_probability", 1.5),
        ("probability_coefficients", (1.0, 2.0)),
    ],
)
def test_options_that_cannot_be(name, value):
    with pytest.raises(gp.InputError, match=name):
        gp.Options(**{name: value})
