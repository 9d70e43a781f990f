"""`Estimator`: the answers of `estimate_poses`, with what images share kept; results made late."""

import copy
import dataclasses
import pickle
from concurrent.futures import ThreadPoolExecutor

import groundpose as gp
import numpy as np
import pytest
from conftest import ARRAYS, MODEL, VIEW, assert_same, make_batch
from groundpose import _core
from groundpose.poses import _kept

BATCH = make_batch(40, seed=21)
SMALL = gp.ShapeModel(MODEL.keypoints_3d[:9], MODEL.bbox_3d)
SHAPED = gp.ShapeModel(
    MODEL.keypoints_3d, MODEL.bbox_3d, np.random.default_rng(0).normal(size=(1, 24, 3)) / 8.0, [0.1]
)
CALL = (BATCH.keypoints_2d, BATCH.bboxes)


@pytest.mark.parametrize(
    "kept",
    [
        {},
        {"options": gp.Options(solver="up2p", seed=3)},
        {"threads": 1},
        {"threads": 2, "frame_tilt_sigma": 0.05},
        {"frame": gp.FramePriors()},
    ],
    ids=["nothing more", "options", "one thread", "tilt", "road"],
)
def test_an_estimator_gives_the_answers_of_estimate_poses(kept):
    estimator = gp.Estimator(VIEW, MODEL, **kept)
    expected = gp.estimate_poses(VIEW, *CALL, MODEL, **kept)
    for _ in range(2):
        assert_same(estimator(*CALL), expected)
        assert estimator(*CALL).view == expected.view
    said = {
        "keypoint_scores": np.random.default_rng(0).uniform(0.0, 1.0, BATCH.keypoints_2d.shape[:2]),
        "vehicle_probability": np.full(40, 0.9),
        "viewing_angle_probabilities": np.full((40, 16), 1 / 16),
    }
    assert_same(estimator(*CALL, **said), gp.estimate_poses(VIEW, *CALL, MODEL, **said, **kept))


def test_frames_of_any_number_of_objects_follow_each_other():
    estimator = gp.Estimator(VIEW, MODEL)
    for n in (3, 40, 0, 1, 17):
        expected = gp.estimate_poses(VIEW, BATCH.keypoints_2d[:n], BATCH.bboxes[:n], MODEL)
        poses = estimator(BATCH.keypoints_2d[:n], BATCH.bboxes[:n])
        assert len(poses) == n
        assert_same(poses, expected)
    assert estimator([]).R.shape == (0, 3, 3)


def test_models_are_chosen_by_number():
    models, numbers = (MODEL, SMALL, SHAPED), np.arange(40) % 3
    keypoints = np.where((numbers == 1)[:, None, None] & (np.arange(24) >= 9)[:, None], np.nan, CALL[0])
    each = [models[k] for k in numbers]
    expected = gp.estimate_poses(VIEW, keypoints, BATCH.bboxes, each)
    estimator = gp.Estimator(VIEW, models)
    for given in (numbers, numbers.tolist(), numbers.astype(np.uint8), np.repeat(numbers, 2)[::2]):
        poses = estimator(keypoints, BATCH.bboxes, model_indices=given)
        assert_same(poses, expected)
        assert poses.models == tuple(each)
    # a frame without an object of the largest model, as a list
    rows = [k for k in range(40) if numbers[k] == 1][:4]
    few = estimator([keypoints[k, :9] for k in rows], model_indices=[1] * 4)
    alone = gp.Estimator(VIEW, SMALL)(keypoints[rows, :9])
    np.testing.assert_array_equal(few.t, alone.t)
    assert few.keypoints_2d.shape == (4, 24, 2)
    # without numbers each object has the model of its place
    assert_same(gp.Estimator(VIEW, each)(keypoints, BATCH.bboxes), expected)


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda e: e(*CALL, model_indices=[0] * 39), gp.InputError, r"model_indices: expected 40 .*\(39,\)"),
        (lambda e: e(*CALL, model_indices=[0] * 39 + [2]), gp.InputError, r"indices\[39\]: .*0 to 1.*2"),
        (lambda e: e(*CALL, model_indices=[-1] + [0] * 39), gp.InputError, r"model_indices\[0\]: .*got -1"),
        (lambda e: e(*CALL, model_indices=np.zeros(40)), TypeError, "model_indices: expected 40 whole"),
        (lambda e: e(*CALL, model_indices=[[0], [0, 1]]), TypeError, "model_indices: "),
        (lambda e: e(*CALL), gp.InputError, "models: expected 1 or 40 models"),
        (lambda e: e(CALL[0], model_indices=[1] * 40), gp.InputError, r"keypoints_2d\[0, 9\]: expected NaN"),
        (lambda e: e(CALL[0][:, :9], model_indices=[1] * 40), gp.InputError, "keypoints_2d: expected 24"),
        (lambda e: e(CALL[0], CALL[1][:3], model_indices=[0] * 40), gp.InputError, "bboxes: "),
    ],
)
def test_mistakes_of_a_call(call, error, text):
    with pytest.raises(error, match=text):
        call(gp.Estimator(VIEW, (MODEL, SMALL)))


@pytest.mark.parametrize(
    ("make", "error", "text"),
    [
        (lambda: gp.Estimator(None, MODEL), TypeError, "view: expected a View"),
        (lambda: gp.Estimator(VIEW, 3), TypeError, "models: expected a ShapeModel or a sequence"),
        (lambda: gp.Estimator(VIEW, [MODEL, None]), TypeError, r"models\[1\]: expected a ShapeModel"),
        (lambda: gp.Estimator(VIEW, MODEL, {}), TypeError, "options: expected Options"),
        (lambda: gp.Estimator(VIEW, MODEL, threads=0), gp.InputError, "threads: "),
        (lambda: gp.Estimator(VIEW, MODEL, frame_tilt_sigma="1"), TypeError, "frame_tilt_sigma: "),
        (lambda: gp.Estimator(VIEW, MODEL, frame=3), TypeError, "frame: "),
    ],
)
def test_mistakes_are_told_before_the_first_image(make, error, text):
    with pytest.raises(error, match=text):
        make()


def test_of_several_mistakes_that_of_the_first_argument_is_told():
    """In the order in which `estimate_poses` has looked at them since its first version."""
    with pytest.raises(gp.InputError, match="keypoints_2d: "):
        gp.estimate_poses(VIEW, CALL[0][0], None, 3, threads=0)
    with pytest.raises(TypeError, match="models: "):
        gp.estimate_poses(VIEW, CALL[0], np.zeros(3), 3, threads=0)
    with pytest.raises(gp.InputError, match="bboxes: "):
        gp.estimate_poses(VIEW, CALL[0], np.zeros(3), MODEL, threads=0, vehicle_probability=np.zeros(3))
    with pytest.raises(gp.InputError, match="threads: "):
        gp.estimate_poses(VIEW, *CALL, MODEL, threads=0, vehicle_probability=np.zeros(3))


def test_copies_of_an_estimator_are_estimators():
    state = gp.CameraState(VIEW)
    for frame in (None, gp.FramePriors(), state):
        estimator = gp.Estimator(VIEW, [MODEL] * 40, gp.Options(seed=2), 1, None, frame)
        copies = [copy.copy(estimator), copy.deepcopy(estimator), pickle.loads(pickle.dumps(estimator))]
        expected = copies[1](*CALL)
        for one in (copies[2], dataclasses.replace(copies[1], frame=copy.deepcopy(frame))):
            assert_same(one(*CALL), expected)
        assert copies[0].frame is frame
        with pytest.raises(dataclasses.FrozenInstanceError):
            estimator.threads = 2


def test_models_of_a_list_are_those_of_when_it_was_given():
    models = [MODEL, SHAPED]
    estimator = gp.Estimator(VIEW, models)
    models.clear()
    assert len(estimator(CALL[0][:2], CALL[1][:2])) == 2


def test_an_estimator_serves_many_threads_at_once():
    estimator = gp.Estimator(VIEW, MODEL)
    batches = [make_batch(n, seed=n) for n in (1, 5, 30, 200)] * 4
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda b: estimator(b.keypoints_2d, b.bboxes), batches))
    for poses, b in zip(found, batches, strict=True):
        assert_same(poses, gp.estimate_poses(VIEW, b.keypoints_2d, b.bboxes, MODEL, threads=1))


@pytest.mark.parametrize("n", [1, 40])
def test_what_cannot_be_read_as_it_is_gives_the_same_answers(n):
    """Other types, layouts, byte orders and places in memory."""
    keypoints, boxes = (array[:n].astype(np.float32) for array in CALL)
    expected = gp.estimate_poses(VIEW, keypoints.astype(float), boxes.astype(float), MODEL)
    shifted = np.frombuffer(b"\0" + keypoints.astype(float).tobytes(), dtype=np.uint8)[1:]
    forms = [
        keypoints,
        np.asfortranarray(keypoints.astype(float)),
        keypoints.astype(">f8"),
        np.ma.masked_array(keypoints.astype(float)),
        shifted.view(float).reshape(keypoints.shape),
        keypoints.tolist(),
    ]
    for form in forms:
        assert_same(gp.estimate_poses(VIEW, form, boxes, MODEL), expected)


def test_fields_are_made_when_they_are_asked_for_and_stay():
    poses = gp.Estimator(VIEW, MODEL)(*CALL)
    assert all(getattr(poses, name) is getattr(poses, name) for name in ARRAYS)
    assert {f.name for f in dataclasses.fields(poses)} == vars(poses).keys()
    poses = gp.Estimator(VIEW, MODEL)(*CALL)
    poses.t[0] = 7.0
    assert poses[0].t.tolist() == [7.0] * 3
    assert vars(poses)["t"] is poses.t
    assert not hasattr(poses, "_t")
    with pytest.raises(AttributeError, match="'PoseBatch' object has no attribute 'nothing'"):
        _ = poses.nothing
    with pytest.raises(dataclasses.FrozenInstanceError):
        poses.t = 1.0


@pytest.mark.parametrize("asked", [(), ("t", "ok", "alternative_R")])
def test_copies_of_results_have_all_fields(asked):
    expected = gp.estimate_poses(VIEW, *CALL, MODEL)
    for copied in (copy.copy, copy.deepcopy, lambda p: pickle.loads(pickle.dumps(p)), dataclasses.replace):
        poses = gp.estimate_poses(VIEW, *CALL, MODEL)
        for name in asked:
            getattr(poses, name)
        found = copied(poses)
        assert_same(found, expected)
        assert vars(found).keys() == vars(expected).keys()


def test_two_threads_that_ask_for_a_field_get_the_same_one():
    for _ in range(20):
        poses = gp.Estimator(VIEW, MODEL)(*CALL)
        with ThreadPoolExecutor(4) as pool:
            found = list(pool.map(lambda p: (p.alternative_R, p.status, vars(p)["t"]), [poses] * 8))
        assert len({tuple(map(id, arrays)) for arrays in found}) == 1


def test_large_arrays_hold_the_same_as_small_ones():
    """From 4 MB on their memory is NumPy's: residuals of 22,000 objects."""
    n = 22_000
    keypoints = np.full((n, 24, 2), np.nan)
    keypoints[::1000], boxes = CALL[0][:22], np.tile(CALL[1][:1], (n, 1))
    poses = gp.estimate_poses(VIEW, keypoints, boxes, MODEL, threads=2)
    assert poses.residuals.nbytes > 4 << 20
    assert poses.ok.sum() >= 15
    assert set(np.flatnonzero(poses.ok)) <= set(range(0, n, 1000))
    np.testing.assert_array_equal(poses.keypoints_2d, keypoints)
    np.testing.assert_array_equal(poses.bboxes, boxes)
    np.testing.assert_array_equal(poses.inlier_mask, poses.residuals <= poses.inlier_threshold[:, None])
    empty = ~poses.ok
    for name in ("R", "covariance", "residuals", "alternative_covariance"):
        assert np.isnan(getattr(poses, name)[empty]).all(), name


def test_other_readings_stand_in_the_rows_of_their_objects():
    angles = np.full((40, 16), 1 / 16)
    angles[::3] = np.nan
    options = gp.Options(min_probability=0.0, probability_coefficients=(0, 0, 0, 0, 0, 0, 0))
    said = {"options": options, "viewing_angle_probabilities": angles}
    poses = gp.estimate_poses(VIEW, *CALL, MODEL, threads=2, **said)
    rows = np.isfinite(poses.alternative_yaw)
    assert rows.sum() > 10
    assert not rows[::3].any()
    for name in ("alternative_R", "alternative_t", "alternative_covariance", "alternative_probability"):
        assert (np.isfinite(getattr(poses, name)).reshape(40, -1).all(axis=1) == rows).all(), name
    turned = np.angle(np.exp(1j * (poses.alternative_yaw - poses.yaw)))[rows]
    assert (np.abs(turned) > np.pi / 2).all()
    assert_same(gp.estimate_poses(VIEW, *CALL, MODEL, threads=1, **said), poses)


def test_the_core_refuses_what_it_cannot_read():
    core = _core.Estimator(VIEW._handle, _core.Models.of(MODEL), _core.Options(), threads=1)
    for wrong in (CALL[0].tolist(), CALL[0].astype(np.float32), CALL[0][:, :5], CALL[0][:, ::-1], None):
        assert core.estimate(wrong) is None
    assert _core.Models.of((MODEL, 3)) is None
    assert core.estimate(CALL[0], np.zeros((3, 4))) is None


LARGE = 800
"""Objects of a call that keeps less: their residuals and covariances are made when they are asked for."""
_LENS = gp.Camera(1000.0, 1000.0, 960.0, 540.0, distortion=(-0.1, 0.02, 0.0, 0.0, 0.0))
_OFF = dataclasses.replace(VIEW, pitch=VIEW.pitch + 0.4, roll=VIEW.roll + 0.4)
_SCORES = np.random.default_rng(1).uniform(-0.3, 1.0, CALL[0].shape[:2]).clip(0.0)
MADE_AGAIN = {
    "nothing more": {},
    "single precision": {"keypoints_2d": CALL[0].astype(np.float32).astype(float)},
    "scores": {"keypoint_scores": _SCORES},
    "shapes": {"models": SHAPED},
    "each its model": {"models": (MODEL, SHAPED) * 20},
    "a lens": {"view": dataclasses.replace(VIEW, camera=_LENS)},
    "a tilt of its own": {"frame_tilt_sigma": 0.05},
    "a wrong tilt": {"view": _OFF},
    "no covariance": {"options": gp.Options(covariance=False)},
    "three keypoints": {"options": gp.Options(solver="p3p")},
}


def few_and_many(changes):
    """The same objects in a small call, and as the first ones of a large one."""
    few = {"view": VIEW, "keypoints_2d": CALL[0], "bboxes": CALL[1], "models": MODEL, **changes}
    more, many = LARGE - 40, dict(few)
    many["keypoints_2d"] = np.concatenate([few["keypoints_2d"], np.full((more, 24, 2), np.nan)])
    many["bboxes"] = np.concatenate([CALL[1], np.tile(CALL[1][:1], (more, 1))])
    if "keypoint_scores" in few:
        many["keypoint_scores"] = np.concatenate([_SCORES, np.ones((more, 24))])
    if isinstance(few["models"], tuple):
        many["models"] = few["models"] + few["models"][:1] * more
    return gp.estimate_poses(**few, threads=2), gp.estimate_poses(**many, threads=2)


def bits(poses, name):
    return np.ascontiguousarray(getattr(poses, name)[:40]).tobytes()


@pytest.mark.parametrize("changes", MADE_AGAIN.values(), ids=MADE_AGAIN)
def test_what_large_calls_make_later_has_the_same_bits(changes):
    few, many = few_and_many(changes)
    for name in ("R", "residuals", "covariance", *ARRAYS, "keypoints_2d", "bboxes"):
        assert bits(few, name) == bits(many, name), name
    assert np.isnan(many.residuals[40:]).all()
    assert not many.inlier_mask[40:].any()


def test_a_wrong_tilt_has_answers_without_the_ground():
    """Otherwise the case of that name would show nothing."""
    few, _ = few_and_many(MADE_AGAIN["a wrong tilt"])
    assert 0 < (few.solver == "p3p").sum() < 40


def test_what_the_caller_changes_afterwards_changes_nothing_that_is_made_later():
    numbers = np.zeros(LARGE, dtype=np.int64)
    keypoints = np.concatenate([CALL[0], np.full((LARGE - 40, 24, 2), np.nan)])
    boxes = np.concatenate([CALL[1], np.tile(CALL[1][:1], (LARGE - 40, 1))])
    scores = np.ones((LARGE, 24))
    estimator = gp.Estimator(VIEW, (MODEL, SHAPED))
    expected, poses = (estimator(keypoints, boxes, scores, numbers) for _ in range(2))
    vars(expected)
    keypoints[:], boxes[:], scores[:], numbers[:] = 1.0, 2.0, 0.5, 1
    for name in ("R", "t", "keypoints_2d", "bboxes", "inlier_threshold", "noise_sigma"):
        getattr(poses, name)[:] = 3.0
    poses.shape_coefficients[:] = 4.0
    assert poses.models == (MODEL,) * LARGE
    for name in ("residuals", "inlier_mask", "covariance"):
        assert bits(poses, name) == bits(expected, name), name


def test_threads_that_ask_a_large_batch_get_the_same_arrays():
    for _ in range(5):
        _, poses = few_and_many({})
        with ThreadPoolExecutor(4) as pool:
            found = list(pool.map(lambda p: (p.R, p.residuals, p.covariance, p.keypoints_2d), [poses] * 8))
        assert len({tuple(map(id, arrays)) for arrays in found}) == 1
        assert vars(poses)["covariance"] is poses.covariance


def test_fields_of_few_objects_come_together_after_some():
    poses = gp.Estimator(VIEW, MODEL)(*CALL)
    for name in ("R", "t", "status", "yaw", "ok", "residuals"):
        getattr(poses, name)
    assert "covariance" in _kept(poses)
