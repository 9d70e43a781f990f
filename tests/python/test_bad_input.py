"""The caller's mistakes get one clear error; bad data gets a status; nothing panics, hangs or lies."""

import io
import tempfile

import groundpose as gp
import numpy as np
import pytest
from conftest import CAMERA, MODEL, VIEW, make_batch
from groundpose._checks import cores, threads
from test_api import check_consistency

GOOD = make_batch(4, seed=1)
KP, BOX = GOOD.keypoints_2d, GOOD.bboxes
SMALL = gp.ShapeModel(MODEL.keypoints_3d[:5], MODEL.bbox_3d)
POINTS = MODEL.keypoints_3d


class Unreadable:
    """An array of another library."""

    def __array__(self, *_: object) -> np.ndarray:
        raise RuntimeError("on a device")


def call(keypoints=KP, bboxes=BOX, models=MODEL, view=VIEW, **rest):
    return gp.estimate_poses(view, keypoints, bboxes, models, **rest)


# name: (call, what the text must hold). Every text is "argument: expected ..., got ...".
WRONG_VALUE = {
    "keypoints of one object": (lambda: call(KP[0]), r"keypoints_2d: .*\(N, P, 2\).*\(24, 2\)"),
    "keypoints of three numbers": (lambda: call(np.zeros((4, 24, 3))), r"keypoints_2d: .*\(4, 24, 3\)"),
    "keypoints transposed": (lambda: call(KP.transpose(0, 2, 1)), r"keypoints_2d: .*\(4, 2, 24\)"),
    "keypoints a number": (lambda: call(3.0), r"keypoints_2d: .*\(N, P, 2\).*\(\)"),
    "one row of keypoints flat": (lambda: call([*KP[:3], KP[3].ravel()]), r"keypoints_2d\[3\]: .*\(48,\)"),
    "a row with a point of three": (
        lambda: call([*KP[:3], [[1.0, 2.0], [1.0, 2.0, 3.0]]]),
        r"keypoints_2d\[3\]: .*different lengths",
    ),
    "fewer keypoints than the model": (lambda: call(KP[:, :20]), "keypoints_2d: expected 24 .*got 20"),
    "more keypoints than the model": (
        lambda: call(np.zeros((4, 25, 2))),
        "keypoints_2d: expected 24 .*got 25",
    ),
    "one object of another length": (
        lambda: call([*KP[:3], KP[3, :7]]),
        r"keypoints_2d\[3\]: expected 24 keypoints.*got 7",
    ),
    "finite rows beyond a small model": (
        lambda: call(KP, models=[MODEL, SMALL, MODEL, MODEL]),
        r"keypoints_2d\[1, 5\]: expected NaN beyond the 5",
    ),
    "no keypoints at all": (lambda: call(np.zeros((4, 0, 2))), "keypoints_2d: expected 24 .*got 0"),
    "bboxes of another count": (lambda: call(bboxes=BOX[:3]), r"bboxes: .*\(4, 4\).*\(3, 4\)"),
    "one bbox": (lambda: call(bboxes=BOX[0]), r"bboxes: .*\(4, 4\).*\(4,\)"),
    "bboxes of five numbers": (lambda: call(bboxes=np.zeros((4, 5))), r"bboxes: .*\(4, 5\)"),
    "bboxes of different lengths": (lambda: call(bboxes=[[1, 2], [1], [1], [1]]), "bboxes: "),
    "empty bboxes": (lambda: call(bboxes=[]), r"bboxes: .*\(4, 4\).*\(0, 4\)"),
    "models of another count": (lambda: call(models=[MODEL] * 3), "models: expected 1 or 4 models.*got 3"),
    "no models": (lambda: call(models=[]), "models: expected 1 or 4 models.*got 0"),
    "scores of another shape": (
        lambda: call(keypoint_scores=np.ones((4, 23))),
        r"keypoint_scores: .*\(4, 24\).*\(4, 23\)",
    ),
    "scores of another count": (lambda: call(keypoint_scores=[[1.0] * 24] * 3), "keypoint_scores: .*got 3"),
    "one row of scores short": (
        lambda: call(keypoint_scores=[[1.0] * 24] * 3 + [[1.0]]),
        r"keypoint_scores\[3\]: .*\(24,\).*\(1,\)",
    ),
    "fx of 400 digits": (lambda: gp.Camera(10**400, 1, 0, 0), "fx: .*too large"),
    "cx of 5000 digits": (lambda: gp.Camera(1, 1, -(10**5000), 0), "cx: .*too large"),
    "pitch of 400 digits": (lambda: gp.View(CAMERA, pitch=10**400), "pitch: .*too large"),
    "distortion of 400 digits": (lambda: gp.Camera(1, 1, 0, 0, [10**400, 0, 0, 0, 0]), "distortion: .*too"),
    "image_size of 5000 digits": (
        lambda: gp.Camera(1, 1, 0, 0, image_size=(1, 10**5000)),
        "image_size: .*cannot be printed",
    ),
    "keypoint of 400 digits": (lambda: call([[[10**400, 1.0]] * 24] * 4), r"keypoints_2d\[0\]: .*too large"),
    "bbox of 5000 digits": (lambda: call(bboxes=[[0, 0, 10**5000, 1]] * 4), "bboxes: .*too large"),
    "threads of 5000 digits below 0": (lambda: call(threads=-(10**5000)), "threads: "),
    "seed of 5000 digits": (lambda: gp.Options(seed=10**5000), "seed: .*cannot be printed"),
    "ragged thresholds": (
        lambda: gp.Options(inlier_threshold=[[1.0], [1.0, 2.0]]),
        "inlier_threshold: .*different lengths",
    ),
    "thresholds of 400 digits": (lambda: gp.Options(inlier_threshold=[10**400]), "inlier_threshold: .*too"),
    "masked thresholds": (
        lambda: gp.Options(inlier_threshold=np.ma.masked_array([1.0, 2.0], [True, False])),
        "inlier_threshold: expected positive",
    ),
    "a file's name with a null byte": (lambda: gp.ShapeModel.load("a\0"), "expected a name of a file"),
    "threads 0": (lambda: call(threads=0), "threads: expected 1 or more"),
    "threads negative": (lambda: call(threads=-2), "threads: "),
    "thresholds of another count": (
        lambda: call(options=gp.Options(inlier_threshold=[3.0] * 3)),
        "inlier_threshold: expected 4 .*got 3",
    ),
    "focal length zero": (lambda: gp.Camera(0.0, 1.0, 0.0, 0.0), "fx: .*positive.*got 0"),
    "focal length negative": (lambda: gp.Camera(1.0, -5.0, 0.0, 0.0), "fy: .*positive.*got -5"),
    "focal length NaN": (lambda: gp.Camera(np.nan, 1.0, 0.0, 0.0), "fx: .*NaN"),
    "focal length infinite": (lambda: gp.Camera(np.inf, 1.0, 0.0, 0.0), "fx: .*inf"),
    "principal point NaN": (lambda: gp.Camera(1.0, 1.0, 0.0, np.nan), "cy: "),
    "distortion of three": (lambda: gp.Camera(1, 1, 0, 0, (1, 2, 3)), r"distortion: .*\(5,\).*\(3,\)"),
    "distortion NaN": (lambda: gp.Camera(1, 1, 0, 0, (0, 0, 0, 0, np.nan)), "distortion: "),
    "distortion a number": (lambda: gp.Camera(1, 1, 0, 0, 0.1), "distortion: "),
    "lens unknown": (lambda: gp.Camera(1, 1, 0, 0, lens="pinhole"), "lens: expected one of .*'pinhole'"),
    "image_size zero": (lambda: gp.Camera(1, 1, 0, 0, image_size=(0, 480)), "image_size: .*positive"),
    "K transposed": (lambda: gp.Camera.from_K(CAMERA.K.T), "K: .*its transpose"),
    "K with skew": (lambda: gp.Camera.from_K([[900, 1, 0], [0, 900, 0], [0, 0, 1]]), "K: .*skew"),
    "K of 3 x 4": (lambda: gp.Camera.from_K(np.zeros((3, 4))), r"K: .*\(3, 3\).*\(3, 4\)"),
    "K not normalised": (lambda: gp.Camera.from_K(2.0 * CAMERA.K), "K: "),
    "K NaN": (lambda: gp.Camera.from_K(np.full((3, 3), np.nan)), r"K: .*finite.*nan at \[0, 0\]"),
    "field of view in degrees": (lambda: gp.Camera.from_fov(640, 480, 90.0), "horizontal_fov: .*pi.*90"),
    "pixels of three": (lambda: CAMERA.undistort(np.zeros((2, 3))), r"pixels: .*\(N, 2\).*\(2, 3\)"),
    "pixel of three": (lambda: CAMERA.rays(np.zeros(3)), r"pixels: .*\(\.\.\., 2\).*\(3,\)"),
    "points of four": (
        lambda: CAMERA.project(np.zeros((5, 2, 4))),
        r"points_camera: .*\(\.\.\., 3\).*\(5, 2, 4\)",
    ),
    "pitch in degrees": (lambda: gp.View(CAMERA, pitch=10.0), "pitch: expected radians"),
    "pitch NaN": (lambda: gp.View(CAMERA, pitch=np.nan), "pitch: "),
    "roll infinite": (lambda: gp.View(CAMERA, roll=np.inf), "roll: "),
    "height zero": (lambda: gp.View(CAMERA, height=0.0), "height: .*positive"),
    "gravity of two": (lambda: gp.View.from_gravity(CAMERA, [0, 1]), r"gravity: .*\(3,\).*\(2,\)"),
    "gravity zero": (lambda: gp.View.from_gravity(CAMERA, [0, 0, 0]), "gravity: "),
    "gravity along the axis": (lambda: gp.View.from_gravity(CAMERA, [0, 0, 1]), "gravity: "),
    "gravity NaN": (lambda: gp.View.from_gravity(CAMERA, [0, np.nan, 0]), "gravity: "),
    "points of two": (lambda: VIEW.project(np.zeros((2, 2))), r"points_camera: .*\(N, 3\)"),
    "keypoints_3d of two": (lambda: gp.ShapeModel(POINTS[:, :2]), r"keypoints_3d: .*\(P, 3\).*\(24, 2\)"),
    "keypoints_3d empty": (lambda: gp.ShapeModel(np.zeros((0, 3))), "keypoints_3d: .*at least one"),
    "keypoints_3d NaN": (lambda: gp.ShapeModel(POINTS * [1, np.nan, 1]), "keypoints_3d: .*finite"),
    "bbox_3d turned round": (lambda: gp.ShapeModel(POINTS, MODEL.bbox_3d[::-1]), "bbox_3d: "),
    "bbox_3d of six": (lambda: gp.ShapeModel(POINTS, np.ones(6)), r"bbox_3d: .*\(2, 3\).*\(6,\)"),
    "basis of other keypoints": (
        lambda: gp.ShapeModel(POINTS, None, np.zeros((2, 5, 3)), [1, 1]),
        r"basis: .*\(M, 24, 3\).*\(2, 5, 3\)",
    ),
    "basis alone": (lambda: gp.ShapeModel(POINTS, None, np.zeros((2, 24, 3))), "eigenvalues: "),
    "eigenvalues alone": (lambda: gp.ShapeModel(POINTS, eigenvalues=[1.0]), "basis: "),
    "eigenvalues of another count": (
        lambda: gp.ShapeModel(POINTS, None, np.ones((2, 24, 3)), [1.0]),
        r"eigenvalues: .*\(2,\).*\(1,\)",
    ),
    "eigenvalue negative": (
        lambda: gp.ShapeModel(POINTS, None, np.ones((1, 24, 3)), [-1.0]),
        "eigenvalues: ",
    ),
    "footprint of one corner": (lambda: gp.ShapeModel(POINTS, footprint=[[0, 0]]), "footprint: "),
    "footprint not convex": (
        lambda: gp.ShapeModel(POINTS, footprint=[[0, 0], [2, 0], [0.1, 0.1], [0, 2]]),
        "footprint: ",
    ),
    "too few names": (lambda: gp.ShapeModel(POINTS, keypoint_names=("a",)), "keypoint_names: .*24.*got 1"),
    "confidence of one": (lambda: gp.Options(confidence=1.0), "confidence: .*between 0 and 1"),
    "threshold negative": (lambda: gp.Options(inlier_threshold=-1.0), "inlier_threshold: .*positive"),
    "one threshold negative": (lambda: gp.Options(inlier_threshold=[1.0, -1.0]), "inlier_threshold: "),
    "threshold NaN": (lambda: gp.Options(inlier_threshold=np.nan), "inlier_threshold: "),
    "relative threshold zero": (lambda: gp.Options(relative_threshold=0.0), "relative_threshold: "),
    "solver unknown": (lambda: gp.Options(solver="p2p"), "solver: expected one of .*p1p.*got .*p2p"),
    "cases unknown": (lambda: gp.Options(cases="some"), "cases: "),
    "scoring unknown": (lambda: gp.Options(scoring="magsac"), "scoring: "),
    "refinement unknown": (lambda: gp.Options(refinement="lm"), "refinement: "),
    "hre_thresholds of two": (lambda: gp.Options(hre_thresholds=(1, 2)), "hre_thresholds: "),
    "hre_thresholds falling": (lambda: gp.Options(hre_thresholds=(3, 2, 1)), "hre_thresholds: "),
    "tilt_sigma negative": (lambda: gp.Options(tilt_sigma=-0.1), "tilt_sigma: "),
    "bbox_sigma zero": (lambda: gp.Options(bbox_sigma=0.0), "bbox_sigma: "),
    "tilt_sigma NaN": (lambda: gp.Options(tilt_sigma=np.nan), "tilt_sigma: "),
    "max_iterations zero": (lambda: gp.Options(max_iterations=0), "max_iterations: "),
    "min_keypoints two": (lambda: gp.Options(min_keypoints=2), "min_keypoints: "),
    "max_log10_nfa NaN": (lambda: gp.Options(max_log10_nfa=np.nan), "max_log10_nfa: "),
    "solver without the height it needs": (
        lambda: call(options=gp.Options(solver="p1p_height")),
        "view: expected a height.*got none",
    ),
    "seed negative": (lambda: gp.Options(seed=-1), "seed: "),
    "seed huge": (lambda: gp.Options(seed=2**80), "seed: "),
}

WRONG_TYPE = {
    "view is a camera": (lambda: call(view=CAMERA), "view: expected a View, got Camera"),
    "options is a dict": (lambda: call(options={"seed": 1}), "options: expected Options, got dict"),
    "keypoints None": (lambda: call(None), "keypoints_2d: .*None"),
    "keypoints text": (lambda: call("points"), "keypoints_2d: .*str 'points'"),
    "keypoints bool": (lambda: call(np.ones((4, 24, 2), bool)), "keypoints_2d: .*dtype bool"),
    "keypoints complex": (lambda: call(KP + 1j), "keypoints_2d: .*complex128"),
    "keypoints objects": (lambda: call(KP.astype(object)), "keypoints_2d: .*dtype object"),
    "keypoints dict": (lambda: call({"a": 1}), "keypoints_2d: .*dict"),
    "one row of keypoints text": (lambda: call([["a"] * 24] * 4), r"keypoints_2d\[0\]: "),
    "keypoints masked and complex": (
        lambda: call(np.ma.masked_array(KP + 1j)),
        "keypoints_2d: .*complex128",
    ),
    "keypoints masked text": (lambda: call(np.ma.masked_array(KP.astype(str))), "keypoints_2d: .*dtype <U"),
    "keypoints of another library": (lambda: call(Unreadable()), "keypoints_2d: .*Unreadable: on a device"),
    "threshold complex": (lambda: gp.Options(inlier_threshold=1j), "inlier_threshold: .*complex 1j"),
    "thresholds complex": (lambda: gp.Options(inlier_threshold=[1j]), "inlier_threshold: "),
    "bboxes text": (lambda: call(bboxes="boxes"), "bboxes: "),
    "bboxes bool": (lambda: call(bboxes=np.ones((4, 4), bool)), "bboxes: .*bool"),
    "a model that is an array": (lambda: call(models=POINTS), "models: expected a ShapeModel"),
    "a list with an array": (lambda: call(models=[MODEL, POINTS, MODEL, MODEL]), r"models\[1\]: "),
    "models None": (lambda: call(models=None), "models: .*None"),
    "scores text": (lambda: call(keypoint_scores="high"), "keypoint_scores: "),
    "threads a float": (lambda: call(threads=2.0), "threads: .*float 2.0"),
    "threads True": (lambda: call(threads=True), "threads: .*bool True"),
    "focal length text": (lambda: gp.Camera("1000", 1.0, 0.0, 0.0), "fx: expected a number, got str '1000'"),
    "focal length array": (lambda: gp.Camera(np.ones(2), 1, 0, 0), "fx: expected a number"),
    "focal length bool": (lambda: gp.Camera(True, 1, 0, 0), "fx: expected a number"),
    "image_size of three": (lambda: gp.Camera(1, 1, 0, 0, image_size=(480, 640, 3)), "image_size: "),
    "image_size floats": (lambda: gp.Camera(1, 1, 0, 0, image_size=(64.5, 48.0)), "image_size: "),
    "camera is K": (lambda: gp.View(CAMERA.K), "camera: expected a Camera, got an array"),
    "names one str": (lambda: gp.ShapeModel(POINTS, keypoint_names="abc"), "keypoint_names: "),
    "name a number": (lambda: gp.ShapeModel(POINTS, name=3), "name: expected a str"),
    "unknown option": (lambda: gp.Options(threshold=3.0), "threshold"),
    "confidence text": (lambda: gp.Options(confidence="high"), "confidence: expected a number"),
    "refinement None": (lambda: gp.Options(refinement=None), "refinement: expected a str, got NoneType"),
    "shape_prior a number": (lambda: gp.Options(shape_prior=1), "shape_prior: expected True or False"),
    "max_iterations a float": (lambda: gp.Options(max_iterations=1e3), "max_iterations: "),
}

CASES = {name: (*case, gp.InputError) for name, case in WRONG_VALUE.items()}
CASES |= {name: (*case, TypeError) for name, case in WRONG_TYPE.items()}


@pytest.mark.parametrize("case", CASES)
def test_mistakes_of_the_caller(case):
    make, text, error = CASES[case]
    with pytest.raises(error, match=text) as caught:
        make()
    assert type(caught.value) is error
    if case != "unknown option":  # Python's own text, which names the option
        assert "expected" in str(caught.value)
        assert ", got " in str(caught.value)
    assert len(str(caught.value)) < 300


def test_masked_keypoints_are_not_seen():
    masked = np.ma.masked_array(KP, np.zeros(KP.shape, bool))
    masked[0, :5] = np.ma.masked
    poses = call(masked)
    assert np.isnan(poses.keypoints_2d[0, :5]).all()
    np.testing.assert_array_equal(poses.keypoints_2d[1:], KP[1:])


def test_threads_are_no_more_than_cores():
    assert threads(20_000) == threads(10**5000) == cores() >= 1
    assert call(threads=20_000).ok.all()


def bytes_of(**arrays: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def model_of(**changes: np.ndarray) -> bytes:
    file = io.BytesIO()
    with tempfile.TemporaryDirectory() as folder:
        MODEL.save(f"{folder}/model.npz")
        with np.load(f"{folder}/model.npz") as content:
            np.savez(file, **dict(content) | changes)
    return file.getvalue()


NOT_MODELS = {
    "no such file": (None, OSError, "nothing.npz"),
    "text": (b"hello", gp.InputError, "expected a shape model"),
    "empty": (b"", gp.InputError, "expected a shape model"),
    "half a zip": (b"PK\x03\x04 and then", gp.InputError, "expected a shape model"),
    "half a model": (model_of()[:-200], gp.InputError, "expected a shape model"),
    "a model with a damaged array": (
        model_of().replace(b"'descr'", b"'d[sc]'"),
        gp.InputError,
        "expected a shape model",
    ),
    "Python objects": (bytes_of(version=np.array([{}])), gp.InputError, "expected a shape model"),
    "300 MB in 300 kB": (bytes_of(version=np.zeros(300_000_000, "b")), gp.InputError, "at most .* bytes"),
    "numbers for names": (
        model_of(keypoint_names=np.arange(24)),
        gp.InputError,
        "nothing.npz: keypoint_names: expected a sequence of str",
    ),
    "other names": (
        model_of(keypoint_names=np.array(["a"])),
        gp.InputError,
        "nothing.npz: keypoint_names: expected 24",
    ),
    "complex keypoints": (
        model_of(keypoints_3d=MODEL.keypoints_3d + 1j),
        gp.InputError,
        "nothing.npz: keypoints_3d: .*complex",
    ),
}


@pytest.mark.parametrize("case", NOT_MODELS)
def test_files_that_are_not_models(case, tmp_path):
    content, error, text = NOT_MODELS[case]
    path = tmp_path / "nothing.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(error, match=text):
        gp.ShapeModel.load(path)


CALIBRATIONS = {
    "no P2": (gp.Camera.from_kitti, "P0: 1 0 0\n", "P2"),
    "short P2": (gp.Camera.from_kitti, "P2: 1 0 0\n", "twelve numbers"),
    "words in P2": (gp.Camera.from_kitti, "P2: a b c d e f g h i j k l\n", "twelve numbers"),
    "empty yaml": (gp.Camera.from_opencv_yaml, "", "camera_matrix"),
    "short matrix": (gp.Camera.from_opencv_yaml, "camera_matrix:\n  data: [1, 2]\n", "camera_matrix"),
    "words in the matrix": (gp.Camera.from_opencv_yaml, "camera_matrix:\n  data: [a, b]\n", "camera_matrix"),
    "fisheye coefficients": (
        gp.Camera.from_opencv_yaml,
        "camera_matrix:\n  data: [1,0,0,0,1,0,0,0,1]\ndistortion_coefficients:\n  data: [0,0,0,0,0,0.1]\n",
        "distortion_coefficients",
    ),
}


@pytest.mark.parametrize("case", CALIBRATIONS)
def test_bad_calibration_files(case, tmp_path):
    read, content, text = CALIBRATIONS[case]
    path = tmp_path / "camera"
    path.write_text(content)
    with pytest.raises(gp.InputError, match=text):
        read(path)
    with pytest.raises(OSError, match="missing"):
        read(tmp_path / "missing")


def test_one_bad_object_does_not_touch_the_others():
    batch = make_batch(12, seed=9)
    clean = batch.estimate()
    keypoints, boxes = batch.keypoints_2d.copy(), batch.bboxes.copy()
    bad = {0: np.nan, 3: np.inf, 5: -np.inf, 8: 1e300}
    for i, value in bad.items():
        keypoints[i] = value
    boxes[10] = boxes[10, [2, 3, 0, 1]]
    boxes[11, 0] = np.inf
    scores = np.ones(keypoints.shape[:2])
    clean_scored, poses = (
        batch.estimate(scores),
        gp.estimate_poses(batch.view, keypoints, boxes, MODEL, scores, threads=1),
    )
    good = np.setdiff1d(np.arange(12), [*bad, 10, 11])
    for name in ("R", "t", "status", "residuals"):
        np.testing.assert_array_equal(getattr(poses, name)[good], getattr(clean_scored, name)[good])
    assert not poses.ok[[*bad, 10, 11]].any()
    assert clean.ok.sum() >= 11
    for value in (-1.0, np.inf):
        scores[2, 4] = value
        poses = batch.estimate(scores)
        assert poses.status[2] == "invalid_input"
        assert poses.ok.sum() >= 10


def test_an_object_behind_the_camera_is_never_a_pose_behind_it():
    """Keypoints of the mirrored object behind the camera are those of an object in front, upside down."""
    batch = make_batch(20, seed=2, outliers=0.0, noise=0.0)
    mirrored = 2.0 * np.array([CAMERA.cx, CAMERA.cy]) - batch.keypoints_2d
    boxes = np.concatenate([mirrored.min(axis=1), mirrored.max(axis=1)], axis=1)
    poses = gp.estimate_poses(batch.view, mirrored, boxes, MODEL)
    x = np.einsum("nij,pj->npi", poses.R[poses.ok], MODEL.keypoints_3d) + poses.t[poses.ok][:, None]
    assert (x[poses.inlier_mask[poses.ok], 2] > 0.0).all()
    check_consistency(poses)
