"""The simulated detector: as real ones where it was fitted, deterministic, inside its crop."""

from pathlib import Path

import numpy as np
import pytest
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate.simulated import fit
from groundpose.lab.evaluate.simulated import keypoint_noise as kn
from groundpose.lab.evaluate.simulated.box_noise import BY_OCCLUSION, at_border, draw_boxes

DATA = data_folder()
needs_data = pytest.mark.skipif(
    not (DATA / "kitti_vehicles_dev.npz").exists(), reason="no folder of real data"
)
SIZE = (1914, 1080)
MEASURED = kn.Detector("as measured", 1.0)


def seen(count: int, points: int = 12, seed: int = 0) -> kn.Seen:
    """Keypoints of symmetric bodies at random places of their boxes, one padded column."""
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.2, 2.0, (count, points // 2, 3))
    body = np.concatenate([half, half * [-1.0, 1.0, 1.0]], axis=1)
    corner, size = rng.uniform(100.0, 800.0, (count, 2)), rng.uniform(40.0, 300.0, (count, 2))
    pixels = corner[:, None] + size[:, None] * rng.random((count, points, 2))
    state = rng.integers(0, 3, (count, points + 1))
    pad = np.full((count, 1, 3), np.nan)
    return kn.Seen(
        np.concatenate([pixels, pad[..., :2]], axis=1),
        state,
        np.concatenate([body, pad], axis=1),
        np.concatenate([corner, corner + size], axis=1),
    )


def test_shares_add_up_and_have_their_places() -> None:
    bands = len(kn.EDGES) - 1
    for habit in (kn.CLEAR, kn.CONFUSED):
        for shares in (*habit.bands, *habit.kinds):
            assert sum(shares) == pytest.approx(1.0, abs=2e-3)
        assert all(len(shares) == bands for shares in (*habit.bands, *habit.wrong, kn.NOISE))
        assert all(len(shares) == len(kn.KINDS) for shares in habit.kinds)


def test_keypoints_of_an_object_do_not_depend_on_those_after_it() -> None:
    many, few = MEASURED(seen(40), 7), MEASURED(kn.Seen(*(a[:11] for a in vars(seen(40)).values())), 7)
    for a, b in zip(many, few, strict=True):
        np.testing.assert_array_equal(a[:11], b)
    again, other = MEASURED(seen(40), 7), MEASURED(seen(40), 8)
    np.testing.assert_array_equal(many[0], again[0])
    assert not np.array_equal(many[0], other[0], equal_nan=True)


def test_keypoints_stay_in_the_crop_and_padding_stays_empty() -> None:
    objects = seen(200)
    keypoints, scores = MEASURED(objects, 0)
    assert np.isnan(keypoints[:, -1]).all()
    assert np.isnan(scores[:, -1]).all()
    margin = kn.CROP_MARGIN * objects.longer[:, None] + 1e-9
    assert (keypoints[:, :-1] >= objects.bboxes[:, None, :2] - margin[..., None]).all()
    assert (keypoints[:, :-1] <= objects.bboxes[:, None, 2:] + margin[..., None]).all()
    assert kn.EDGES[0] <= scores[:, :-1].min()
    assert scores[:, :-1].max() <= kn.EDGES[-1]


def test_what_is_outside_the_image_is_never_found() -> None:
    objects = seen(300)
    _, scores = MEASURED(objects, 0)
    outside = scores[:, :-1][objects.state[:, :-1] == kn.OUTSIDE]
    assert outside.max() <= kn.EDGES[kn.DOUBTFUL]


def test_partners_mirror_and_turn() -> None:
    corners = np.array([[x, 0.0, z] for x in (-1.0, 1.0) for z in (-2.0, 2.0)])
    objects = kn.Seen(np.zeros((1, 4, 2)), np.full((1, 4), kn.VISIBLE), corners[None], np.ones((1, 4)))
    mirror, turn = objects.partners()
    np.testing.assert_array_equal(mirror[0], [2, 3, 0, 1])
    np.testing.assert_array_equal(turn[0], [3, 2, 1, 0])


def test_better_detectors_err_less_and_low_scores_err_more() -> None:
    objects = seen(2000)
    right = objects.state[:, :-1] != kn.OUTSIDE
    medians = []
    for quality in (1.0, 0.5, 0.25):
        keypoints, scores = kn.Detector("", quality)(objects, 3)
        error = np.linalg.norm(keypoints - objects.keypoints_2d, axis=2)[:, :-1] / objects.longer[:, None]
        low, high = (error[right & m] for m in (scores[:, :-1] < 0.05, scores[:, :-1] > 0.5))
        assert np.median(low) > 3.0 * np.median(high)
        medians.append(np.median(error[right]))
    assert medians == sorted(medians, reverse=True)


def test_a_perfect_detector_is_the_limit() -> None:
    objects = seen(100)
    keypoints, _ = kn.Detector("", 1e-9)(objects, 3)
    found = objects.state[:, :-1] == kn.VISIBLE
    error = np.linalg.norm(keypoints - objects.keypoints_2d, axis=2)[:, :-1]
    # a share of the doubtful ones is wrong whatever the quality: what a score means stays
    assert (error[found] < 1e-3).mean() > 0.95


def test_boxes_are_boxes_in_the_image_whatever_the_noise() -> None:
    rng = np.random.default_rng(0)
    corner, size = rng.uniform(0.0, 1000.0, (5000, 2)), rng.uniform(5.0, 900.0, (5000, 2))
    true = np.clip(np.concatenate([corner, corner + size], axis=1), 0.0, [1913, 1079, 1913, 1079])
    true = true[(true[:, 2:] - true[:, :2]).min(axis=1) > 5.0]
    occlusion = rng.integers(0, 4, len(true))
    drawn = draw_boxes(true, occlusion, SIZE, 5)
    assert (drawn >= 0.0).all()
    assert (drawn[:, [0, 2]] <= SIZE[0] - 1).all()
    assert (drawn[:, [1, 3]] <= SIZE[1] - 1).all()
    assert (drawn[:, 2:] > drawn[:, :2]).all()
    np.testing.assert_array_equal(draw_boxes(true[:50], occlusion[:50], SIZE, 5), drawn[:50])
    assert not np.array_equal(draw_boxes(true, occlusion, SIZE, 6), drawn)


def test_sides_at_the_border_move_less() -> None:
    true = np.tile([0.0, 300.0, 200.0, 420.0], (4000, 1))
    drawn = draw_boxes(true, np.zeros(4000, int), SIZE, 0)
    assert at_border(true, SIZE)[0].tolist() == [True, False, False, False]
    spread = np.percentile(np.abs(drawn - true), 75, axis=0)
    assert spread[0] < 0.6 * spread[2]
    assert (drawn[:, 0] == 0.0).mean() > 0.4


@needs_data
def test_fitted_boxes_are_those_in_the_code() -> None:
    boxes = fit.detections(DATA)
    kept = (boxes.occlusion == 0) & ~boxes.at_border.any(axis=1)
    fitted = fit.fit_boxes((boxes.detected - boxes.label)[kept], boxes.longer[kept])
    for a, b in zip(fitted.sides, BY_OCCLUSION[0].sides, strict=True):
        np.testing.assert_allclose(list(vars(a).values()), list(vars(b).values()), atol=0.006)
    assert fitted.degrees_of_freedom == pytest.approx(BY_OCCLUSION[0].degrees_of_freedom, abs=0.06)
    np.testing.assert_allclose(fitted.correlation, BY_OCCLUSION[0].correlation, atol=0.006)


@needs_data
def test_simulated_boxes_have_the_quantiles_of_real_ones() -> None:
    for line in fit.box_agreement(fit.detections(DATA)):
        real, simulated = np.array(line["real"]), np.array(line["simulated"])
        np.testing.assert_allclose(simulated[1:4], real[1:4], atol=1.6, err_msg=str(line))
        # tails of vehicles that are largely hidden are the widest, and lopsided to the right
        np.testing.assert_allclose(
            simulated, real, atol=9.0 if line["occlusion"] == 2 else 1.8, err_msg=str(line)
        )


@needs_data
def test_fitted_keypoints_are_those_in_the_code() -> None:
    found = fit.found_keypoints(DATA)
    assert found.confused.mean() == pytest.approx(kn.CONFUSED_SHARE)
    np.testing.assert_allclose(fit.noise_by_band(found), kn.NOISE, atol=0.001)
    for objects, habit in ((~found.confused, kn.CLEAR), (found.confused, kn.CONFUSED)):
        fitted = fit.fit_habit(found, objects)
        np.testing.assert_allclose(fitted.bands, habit.bands, atol=0.002)
        np.testing.assert_allclose(fitted.wrong, habit.wrong, atol=0.006)
        both = [[k[kn.LEFT_RIGHT] + k[kn.HALF_TURN], *k[2:]] for k in fitted.kinds]
        np.testing.assert_allclose(
            both, [[k[kn.LEFT_RIGHT] + k[kn.HALF_TURN], *k[2:]] for k in habit.kinds], atol=0.011
        )


@needs_data
def test_simulated_keypoints_have_the_quantiles_of_real_ones() -> None:
    for line in fit.keypoint_agreement(fit.found_keypoints(DATA)):
        real, simulated = np.array(line["real"]), np.array(line["simulated"])
        assert line["simulated fraction %"] == pytest.approx(line["real fraction %"], abs=3.0), line
        ratio = simulated[:3] / real[:3]
        assert (ratio > 0.6).all(), line
        assert (ratio < 1.9).all(), line
        assert simulated[4] == pytest.approx(real[4], rel=0.35) or real[4] < 30.0, line


def test_the_data_itself_is_not_in_the_package() -> None:
    folder = Path(kn.__file__).parent
    assert {path.suffix for path in folder.iterdir()} <= {".py", ""}
