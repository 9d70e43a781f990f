"""Shape models: principal components, files, scaling, and poses with a shape."""

import groundpose as gp
import numpy as np
import pytest
from conftest import MODEL, assert_same, make_batch, rotation_error_deg

RNG = np.random.default_rng(3)
MODELS = RNG.normal(size=(30, 24, 3)) * 0.03 + MODEL.keypoints_3d * RNG.normal(1.0, 0.06, size=(30, 1, 3))


@pytest.fixture(scope="module")
def fitted():
    return gp.ShapeModel.fit(MODELS, modes=4, name="car")


def test_fit_is_principal_components(fitted):
    centred = (MODELS - MODELS.mean(axis=0)).reshape(30, -1)
    np.testing.assert_allclose(fitted.keypoints_3d, MODELS.mean(axis=0))
    basis = fitted.basis.reshape(4, -1)
    np.testing.assert_allclose(basis @ basis.T, np.eye(4), atol=1e-12)
    coefficients = centred @ basis.T
    np.testing.assert_allclose(np.cov(coefficients.T), np.diag(fitted.eigenvalues), atol=1e-12)
    # The four directions of largest variance, by another route.
    expected = np.linalg.eigvalsh(np.cov(centred.T))[::-1][:4]
    np.testing.assert_allclose(fitted.eigenvalues, expected, rtol=1e-9)
    # All modes together give every model back.
    few = MODELS[:9]
    full = gp.ShapeModel.fit(few, modes=8)
    for model in few:
        coefficients = full.basis.reshape(8, -1) @ (model - full.keypoints_3d).ravel()
        np.testing.assert_allclose(full.keypoints(coefficients), model, atol=1e-9)


def test_fit_of_few_and_of_equal_models():
    one = gp.ShapeModel.fit(MODELS[:1], modes=0)
    assert one.modes == 0
    np.testing.assert_array_equal(one.keypoints_3d, MODELS[0])
    equal = gp.ShapeModel.fit(np.repeat(MODELS[:1], 5, axis=0), modes=3)
    assert equal.modes == 0
    two = gp.ShapeModel.fit(np.concatenate([MODELS[:2], MODELS[:2]]), modes=3)
    assert two.modes == 1


def test_fit_keeps_boxes_names_and_footprint():
    boxes = np.stack([[m.min(axis=0), m.max(axis=0)] for m in MODELS])
    names = tuple(f"k{i}" for i in range(24))
    outline = [[-1.0, -2.0], [-1.0, 2.0], [1.0, 2.0], [1.0, -2.0]]
    model = gp.ShapeModel.fit(MODELS, 2, bbox_3d=boxes, keypoint_names=names, footprint=outline, name="x")
    np.testing.assert_allclose(model.bbox_3d, boxes.mean(axis=0))
    assert (model.keypoint_names, model.name) == (names, "x")
    np.testing.assert_array_equal(model.footprint, outline)
    assert gp.ShapeModel.fit(MODELS, 2, bbox_3d=boxes[0]).bbox_basis is None
    extent = gp.ShapeModel.fit(MODELS, 2).bbox_3d
    np.testing.assert_array_equal(extent, [MODELS.mean(axis=0).min(axis=0), MODELS.mean(axis=0).max(axis=0)])


def test_box_follows_the_shape():
    few = MODELS[:9]
    boxes = np.stack([[m.min(axis=0) - 0.1, m.max(axis=0) + 0.2] for m in few])
    full = gp.ShapeModel.fit(few, modes=8, bbox_3d=boxes)  # all modes: exact
    for model, box in zip(few, boxes, strict=True):
        coefficients = full.basis.reshape(8, -1) @ (model - full.keypoints_3d).ravel()
        np.testing.assert_allclose(full.bbox_3d_of(coefficients), box, atol=1e-9)
    np.testing.assert_array_equal(full.bbox_3d_of(), full.bbox_3d)
    part = gp.ShapeModel.fit(few, modes=3, bbox_3d=boxes)
    np.testing.assert_allclose(part.bbox_basis, full.bbox_basis[:3])
    coefficients = (few - part.keypoints_3d).reshape(9, -1) @ part.basis.reshape(3, -1).T
    left = np.stack([boxes[k] - part.bbox_3d_of(c) for k, c in enumerate(coefficients)])
    # Least squares: what is left has nothing to do with the coefficients.
    np.testing.assert_allclose(np.tensordot(coefficients.T, left, axes=1), 0.0, atol=1e-9)
    stretched = part.scaled(*(2.0 * side for side in part.size))
    np.testing.assert_allclose(stretched.bbox_3d_of(coefficients[0]), 2.0 * part.bbox_3d_of(coefficients[0]))


def test_a_fixed_box_stays(fitted):
    np.testing.assert_array_equal(fitted.bbox_3d_of(np.ones(4)), fitted.bbox_3d)
    with pytest.raises(gp.InputError, match=r"bbox_basis: .*\(4, 2, 3\).*\(3, 2, 3\)"):
        gp.ShapeModel(
            fitted.keypoints_3d,
            basis=fitted.basis,
            eigenvalues=fitted.eigenvalues,
            bbox_basis=np.zeros((3, 2, 3)),
        )


@pytest.mark.parametrize(
    ("models", "modes", "text"),
    [
        (MODELS, 30, "modes: expected 0 to 29 with 30 models, got 30"),
        (MODELS[:1], 1, "modes: expected 0 to 0"),
        (MODELS, -1, "modes: "),
        (MODELS[:0], 0, "models: expected at least one"),
        (MODELS[0], 0, r"models: .*\(S, P, 3\).*\(24, 3\)"),
        (np.where(MODELS > 2.0, np.nan, MODELS), 2, "models: .*finite"),
    ],
)
def test_fit_refuses(models, modes, text):
    with pytest.raises(gp.InputError, match=text):
        gp.ShapeModel.fit(models, modes)


def test_files_keep_every_field(fitted, tmp_path):
    whole = gp.ShapeModel(
        fitted.keypoints_3d,
        fitted.bbox_3d,
        fitted.basis,
        fitted.eigenvalues,
        tuple(f"Punkt {i} ü" for i in range(24)),
        [[-1.0, -2.0], [0.0, 2.5], [1.0, -2.0]],
        "Wagen",
        RNG.normal(size=(4, 2, 3)),
    )
    for model, path in ((whole, tmp_path / "a.npz"), (MODEL, tmp_path / "no_suffix")):
        model.save(path)
        back = gp.ShapeModel.load(str(path))
        for name in ("keypoints_3d", "bbox_3d", "basis", "eigenvalues", "footprint", "bbox_basis"):
            np.testing.assert_array_equal(getattr(back, name), getattr(model, name), err_msg=name)
        assert (back.keypoint_names, back.name) == (model.keypoint_names, model.name)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.npz", "no_suffix"]


def test_files_of_the_future_and_strange_ones(fitted, tmp_path):
    path = tmp_path / "m.npz"
    fitted.save(path)
    content = dict(np.load(path))
    np.savez(path, **{**content, "version": 99})
    with pytest.raises(gp.InputError, match="version 1 or older, got 99; update groundpose"):
        gp.ShapeModel.load(path)
    np.savez(path, **{k: v for k, v in content.items() if k != "basis"})
    with pytest.raises(gp.InputError, match="'basis'"):
        gp.ShapeModel.load(path)
    np.savez(path, x=1)
    with pytest.raises(gp.InputError, match="expected a shape model"):
        gp.ShapeModel.load(path)
    np.savez(path, version=1, keypoints_3d=np.array([{"code": 1}], dtype=object))  # a pickle inside
    with pytest.raises(gp.InputError, match="expected a shape model"):
        gp.ShapeModel.load(path)
    np.save(tmp_path / "array.npy", np.zeros(3))
    with pytest.raises(gp.InputError, match="expected a shape model"):
        gp.ShapeModel.load(tmp_path / "array.npy")


def test_scaled_has_the_size_asked_for_and_keeps_shapes(fitted):
    model = gp.ShapeModel(
        fitted.keypoints_3d,
        fitted.bbox_3d,
        fitted.basis,
        fitted.eigenvalues,
        (),
        [[-1, -2], [0, 2], [1, -2]],
        "car",
    )
    scaled = model.scaled(length=6.0, height=2.0, width=2.2)
    assert scaled.size == (pytest.approx(6.0), pytest.approx(2.0), pytest.approx(2.2))
    factor = np.array([2.2, 2.0, 6.0]) / (model.bbox_3d[1] - model.bbox_3d[0])
    coefficients = np.array([0.1, -0.2, 0.05, 0.0])
    np.testing.assert_allclose(scaled.keypoints(coefficients), model.keypoints(coefficients) * factor)
    np.testing.assert_allclose(scaled.footprint, model.footprint * factor[[0, 2]])
    assert scaled.name == "car"
    for size in ((0.0, 1.0, 1.0), (1.0, np.nan, 1.0), (1.0, 1.0, -2.0)):
        with pytest.raises(gp.InputError, match="positive number of metres"):
            model.scaled(*size)


def test_arrays_are_copies_that_nobody_can_change():
    given = MODEL.keypoints_3d.copy()
    model = gp.ShapeModel(given)
    given[0] = 7.0
    np.testing.assert_array_equal(model.keypoints_3d, MODEL.keypoints_3d)
    with pytest.raises(ValueError, match="read-only"):
        model.keypoints_3d[0] = 1.0
    assert given.flags.writeable


def test_keypoints_of_a_shape(fitted):
    np.testing.assert_array_equal(fitted.keypoints(), fitted.keypoints_3d)
    np.testing.assert_allclose(fitted.keypoints([0, 2.0, 0, 0]), fitted.keypoints_3d + 2.0 * fitted.basis[1])
    with pytest.raises(gp.InputError, match="shape_coefficients"):
        fitted.keypoints([1.0])


def test_pose_and_shape_are_found_together(fitted):
    """Exact keypoints of a car that is not the mean: the mean alone cannot explain them, the modes do."""
    coefficients = 1.5 * np.sqrt(fitted.eigenvalues) * [1.0, -1.0, 0.5, 0.0]
    batch = make_batch(20, seed=8, outliers=0.2, noise=0.0005, model=fitted, shape=coefficients)
    options = {"inlier_threshold": 3.0, "shape_prior": False}
    poses = batch.estimate(**options)
    rigid = gp.ShapeModel(fitted.keypoints_3d, fitted.bbox_3d)
    mean = gp.estimate_poses(
        batch.view, batch.keypoints_2d, batch.bboxes, rigid, None, gp.Options(inlier_threshold=3.0)
    )
    assert poses.ok.all()
    assert np.median(rotation_error_deg(poses.R, batch.R)) < 0.5 * np.nanmedian(
        rotation_error_deg(mean.R, batch.R)
    )
    # Size against distance cannot be told from one image: compare after the least-squares scale.
    for i in np.flatnonzero(poses.ok):
        found, true = poses.keypoints_3d(i), fitted.keypoints(coefficients)
        np.testing.assert_allclose(found, fitted.keypoints(poses.shape_coefficients[i]), atol=1e-12)
        scale = (found * true).sum() / (found**2).sum()
        assert np.sqrt(np.mean((scale * found - true) ** 2)) < 0.03
    assert np.isfinite(poses.shape_covariance).all()


def test_zero_variance_of_shape_is_the_rigid_model():
    tiny = gp.ShapeModel(MODEL.keypoints_3d, MODEL.bbox_3d, RNG.normal(size=(1, 24, 3)), [1e-18])
    batch = make_batch(10, seed=7)
    with_mode = gp.estimate_poses(batch.view, batch.keypoints_2d, batch.bboxes, tiny)
    rigid = batch.estimate()
    np.testing.assert_array_equal(with_mode.ok, rigid.ok)
    np.testing.assert_allclose(with_mode.t[rigid.ok], rigid.t[rigid.ok], rtol=1e-5)
    assert np.nanmax(np.abs(with_mode.shape_coefficients)) < 1e-6


def test_the_footprint_is_used():
    """A footprint far from the true one moves the hypotheses; the box's own rectangle does not."""
    (x0, _, z0), (x1, _, z1) = MODEL.bbox_3d
    rectangle = gp.ShapeModel(
        MODEL.keypoints_3d, MODEL.bbox_3d, footprint=[[x0, z0], [x0, z1], [x1, z1], [x1, z0]]
    )
    slim = gp.ShapeModel(
        MODEL.keypoints_3d, MODEL.bbox_3d, footprint=[[-0.2, z0], [-0.2, z1], [0.2, z1], [0.2, z0]]
    )
    batch = make_batch(20, seed=6)
    options = gp.Options(refinement="none")
    results = [
        gp.estimate_poses(batch.view, batch.keypoints_2d, batch.bboxes, m, None, options)
        for m in (MODEL, rectangle, slim)
    ]
    assert_same(results[0], results[1])
    error = [np.nanmedian(np.linalg.norm(p.t - batch.t, axis=1)) for p in results]
    assert error[2] > 1.5 * error[0] or results[2].ok.sum() < results[0].ok.sum()
