"""Pictures: geometry against its definition, and that what is promised is on the paper."""

import dataclasses

import groundpose as gp
import matplotlib
import numpy as np
import pytest
from conftest import CAMERA, MODEL, VIEW, make_batch, rotation_y
from groundpose import draw, vehicles
from groundpose.draw import colours
from groundpose.draw.lines import box_lines, claimed, segment, shape_lines
from matplotlib.colors import to_rgb
from PIL import Image

BATCH = make_batch(5, seed=31)
POSES = BATCH.estimate()
IMAGE = np.full((720, 1280, 3), 90, dtype=np.uint8)


def has_colour(path, colour: str) -> bool:
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    return bool((np.abs(pixels - np.array(to_rgb(colour)) * 255.0).max(axis=-1) < 6.0).any())


def test_picture_holds_every_kind_of_mark(tmp_path):
    keypoints = BATCH.keypoints_2d.copy()
    keypoints[0, :3] = np.nan
    keypoints[4] = np.random.default_rng(0).uniform(BATCH.bboxes[4, :2], BATCH.bboxes[4, 2:], (24, 2))
    poses = gp.estimate_poses(VIEW, keypoints, BATCH.bboxes, MODEL)
    assert poses.ok.tolist() == [True] * 4 + [False]
    backend = matplotlib.get_backend()
    path = tmp_path / "poses.png"
    figure = poses.draw(IMAGE, path, truth=(BATCH.R, BATCH.t), title="five vehicles")
    assert len(figure.axes) == 2
    for name in ("POSE", "BOX", "FRONT", "INLIER", "OUTLIER", "MISSING", "NO_POSE", "TRUTH"):
        assert has_colour(path, getattr(colours, name)), name
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"truth", "no pose, with its status", "not seen", "95 % of position"} <= set(legend)
    assert any("no_consensus" in text.get_text() for text in figure.axes[0].texts)
    assert matplotlib.get_backend() == backend  # no global state is touched

    plain = POSES.draw(path=tmp_path / "plain.svg")
    assert "truth" not in [text.get_text() for text in plain.legends[0].get_texts()]
    assert (tmp_path / "plain.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_footprint_is_the_objects_on_the_ground():
    """At the true pose, corner by corner, from the definition of the ground frame."""
    x0, z0, x1, z1 = -0.9, -2.25, 0.9, 2.25
    corners = np.array([[x0, 0.0, z0], [x0, 0.0, z1], [x1, 0.0, z1], [x1, 0.0, z0]])
    for i in range(5):
        ground = (corners @ BATCH.R[i].T + BATCH.t[i]) @ VIEW.R_camera_from_ground
        np.testing.assert_allclose(ground[:, 1], 1.5, atol=1e-9)  # they touch the ground
        np.testing.assert_allclose(
            draw.footprint_on_ground(POSES, i, BATCH.R[i], BATCH.t[i]), ground[:, [0, 2]]
        )
    outline = [[-0.5, 0.0], [0.0, 1.0], [0.5, 0.0]]
    model = gp.ShapeModel(MODEL.keypoints_3d, MODEL.bbox_3d, footprint=outline)
    poses = gp.estimate_poses(VIEW, BATCH.keypoints_2d, BATCH.bboxes, model)
    assert draw.footprint_on_ground(poses, 0, BATCH.R[0], BATCH.t[0]).shape == (3, 2)


def test_ellipse_holds_95_percent_of_the_covariance():
    """Draws from the 6 x 6 covariance, moved through the pose, against the ellipse drawn."""
    pose = POSES[0]
    rng = np.random.default_rng(1)
    steps = rng.multivariate_normal(np.zeros(6), pose.covariance, 4000)
    middle = pose.R @ MODEL.bbox_3d.mean(axis=0)
    moved = middle + np.cross(steps[:, :3], middle) + pose.t + steps[:, 3:]
    points = (moved @ VIEW.R_camera_from_ground)[:, [0, 2]]
    ellipse = draw.position_ellipse(POSES, 0)
    centre = 0.5 * (ellipse.max(axis=0) + ellipse.min(axis=0))
    conic = np.linalg.inv(2.0 * np.cov(ellipse[:-1].T, bias=True))  # of points even in angle
    inside = np.einsum("ni,ij,nj->n", points - centre, conic, points - centre) <= 1.0
    assert 0.93 < inside.mean() < 0.97
    without = BATCH.estimate(covariance=False)
    assert draw.position_ellipse(without, 0).shape == (0, 2)
    without.draw()


def test_distorted_images_get_distorted_lines():
    camera = dataclasses.replace(CAMERA, distortion=(-0.2, 0.05, 0.001, -0.001, 0.01))
    poses = gp.estimate_poses(dataclasses.replace(VIEW, camera=camera), BATCH.keypoints_2d, None, MODEL)
    ideal = np.random.default_rng(2).uniform((0, 0), (1280, 720), (50, 2))
    np.testing.assert_allclose(camera.undistort(camera.distort(ideal)), ideal, atol=1e-6)
    np.testing.assert_array_equal(CAMERA.distort(ideal), ideal)
    poses.draw(IMAGE)


def test_a_box_partly_behind_the_camera_is_cut():
    ends = np.array([[1.0, 0.5, -2.0], [1.0, 0.5, 4.0]])
    line = segment(VIEW, ends)
    assert np.isfinite(line).all()
    np.testing.assert_allclose(line[-1], VIEW.project(ends[1:])[0])
    np.testing.assert_allclose(line[0], VIEW.project([[1.0, 0.5, 0.1]])[0])
    assert segment(VIEW, ends * [1, 1, -1] - [0, 0, 5]) is None


def test_lines_through_a_wide_lens_are_bent_and_end_where_it_does():
    """A straight edge beside the camera; one that goes on behind it, where this lens shows nothing."""
    camera = gp.Camera(300.0, 300.0, 639.5, 479.5, (-0.18, 0.59), (1280, 960), "double_sphere")
    view = gp.View(camera)
    line = segment(view, np.array([[2.0, 1.0, -1.0], [2.0, 1.0, 3.0]]))
    assert np.isfinite(line).all()
    np.testing.assert_allclose(line[[0, -1]], camera.image_of([[2.0, 1.0, -1.0], [2.0, 1.0, 3.0]]))
    chord = np.linspace(line[0], line[-1], len(line))
    assert np.linalg.norm(line - chord, axis=1).max() > 20.0
    broken = segment(view, np.array([[2.0, 1.0, 3.0], [2.0, 1.0, -9.0]]))
    assert np.isfinite(broken[0]).all()
    assert np.isnan(broken[-1]).all()
    assert segment(view, np.array([[0.1, 0.0, -9.0], [0.3, 0.1, -12.0]])) is None
    for place, whole in (([5.0, 1.5, 0.0], True), ([0.3, 1.5, -6.0], False)):
        lines = box_lines(view, dataclasses.replace(POSES[0], R=rotation_y(np.array(0.7)), t=np.array(place)))
        assert (lines.area is not None) is whole
        shown = [part for part in lines.front + lines.others if np.isfinite(part).all()]
        assert (len(shown) == 12) is whole


def test_the_front_is_the_end_the_object_looks_at():
    """Of a car that drives away it is the far face of the box, of an oncoming one the near face."""
    for yaw, towards in ((0.0, False), (np.pi, True)):
        R = VIEW.R_camera_from_ground @ rotation_y(np.array(yaw))
        pose = dataclasses.replace(POSES[0], R=R, t=VIEW.R_camera_from_ground @ [0.5, 1.5, 12.0])
        lines = box_lines(VIEW, pose)
        assert (len(lines.front), len(lines.others)) == (4, 8)
        assert lines.faces_camera is towards
        heights = [np.ptp(np.concatenate(part)[:, 1]) for part in (lines.front, lines.others)]
        assert bool(heights[0] > 0.99 * heights[1]) is towards


def test_lines_of_a_shape_join_its_keypoints():
    """Every line ends at two projected keypoints; those of the side that is seen are apart from the rest."""
    model = vehicles.shape_model("car")
    batch = make_batch(1, seed=3, outliers=0.0, model=model)
    pose = batch.estimate()[0]
    near, far = shape_lines(VIEW, pose)
    pixels = VIEW.project(pose.keypoints_3d @ pose.R.T + pose.t)
    assert len(near) > 5
    assert len(far) > 5
    for line in near + far:
        assert np.abs(pixels[:, None] - line[None]).max(axis=2).min(axis=0).max() < 1e-9
    mean = [np.linalg.norm(pose.R.T @ -pose.t - p) for p in pose.keypoints_3d]  # metres from the camera
    of = lambda lines: np.mean([mean[np.abs(pixels - end).sum(1).argmin()] for x in lines for end in x])  # noqa: E731
    assert of(near) < of(far)
    assert shape_lines(VIEW, POSES[0]) == ([], [])  # a model of other keypoints


def test_footprints_have_the_estimated_size():
    model = vehicles.shape_model("van_bus")
    shape = np.zeros(model.modes)
    shape[0] = 1.5 * np.sqrt(model.eigenvalues[0])
    batch = make_batch(1, seed=3, outliers=0.0, model=model, shape=shape)
    poses = batch.estimate()
    outline = draw.footprint_on_ground(poses, 0, poses.R[0], poses.t[0])
    length = np.linalg.norm(outline[1] - outline[0])
    true = np.ptp(model.keypoints(shape)[:, 2]) / np.ptp(model.keypoints_3d[:, 2]) * model.size[0]
    assert length == pytest.approx(true, rel=0.05)
    assert abs(length - model.size[0]) > 0.5
    told = draw.footprint_on_ground(poses, 0, batch.R[0], batch.t[0], np.array([[-1, -2, -3], [1, 0, 3.0]]))
    assert np.linalg.norm(told[1] - told[0]) == pytest.approx(6.0)
    with pytest.raises(gp.InputError, match=r"truth: expected \(R, t\) or"):
        poses.draw(truth=(batch.R,))


def test_keypoints_with_hardly_a_chance_count_as_not_seen():
    scores = np.full(POSES.keypoints_2d.shape[:2], 0.9)
    scores[:, 4] = 0.05

    class Found(gp.PoseBatch):
        keypoint_scores = scores

    fields = {f.name: getattr(POSES, f.name) for f in dataclasses.fields(gp.PoseBatch)}
    found = claimed(Found(**fields))
    assert not found[:, 4].any()
    assert found[:, :4].all()
    assert claimed(POSES).all()


def test_contact_sheet_shows_each_object(tmp_path):
    path = tmp_path / "worst.png"
    tiles = [draw.Tile(IMAGE, POSES, i, f"{i}: 3.2°") for i in range(5)]
    figure = draw.contact_sheet(tiles, path, columns=3)
    assert [axes.get_title("left") for axes in figure.axes] == [tile.title for tile in tiles]
    for axes, box in zip(figure.axes, POSES.bboxes, strict=True):
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        assert left < box[0] < box[2] < right
        assert top < box[1] < box[3] < bottom
    with Image.open(path) as image:
        assert image.width > 2 * image.height * 0.6
    unboxed = gp.estimate_poses(VIEW, BATCH.keypoints_2d, None, MODEL)
    axes = draw.contact_sheet([draw.Tile(IMAGE, unboxed, 0)]).axes[0]
    assert axes.get_xlim()[1] >= 1279
    with pytest.raises(gp.InputError, match="tiles: expected at least one"):
        draw.contact_sheet([])


def test_parts_can_be_drawn_alone_and_empty(tmp_path):
    for image in (None, IMAGE, IMAGE[..., 0], IMAGE / 255.0):
        assert draw.draw_overlay(image, POSES).images
    axes = draw.draw_birds_eye(POSES)
    (low, high), (near, far) = axes.get_xlim(), axes.get_ylim()
    ground = POSES.t @ VIEW.R_camera_from_ground
    assert (ground[:, 0] > low).all()
    assert (ground[:, 0] < high).all()
    assert (ground[:, 2] < far).all()
    assert near < 0.0
    gp.estimate_poses(VIEW, [], None, MODEL).draw(path=tmp_path / "empty.png")
    no_size = gp.View(dataclasses.replace(CAMERA, image_size=None))
    gp.estimate_poses(no_size, BATCH.keypoints_2d, None, MODEL).draw()


@pytest.mark.parametrize(
    ("image", "error", "text"),
    [
        (IMAGE[:100], gp.InputError, r"image: expected \(720, 1280\).*got \(100, 1280\)"),
        ("photo.png", TypeError, "image: expected an array"),
        (np.zeros(5), TypeError, "image: expected an array"),
        (np.zeros((720, 1280), dtype=bool), TypeError, "image: expected an array"),
    ],
)
def test_images_that_do_not_fit(image, error, text):
    with pytest.raises(error, match=text):
        POSES.draw(image)


def test_truth_must_fit():
    with pytest.raises(gp.InputError, match=r"truth t: .*\(5, 3\).*\(4, 3\)"):
        POSES.draw(truth=(BATCH.R, BATCH.t[:4]))


def test_a_file_kind_that_cannot_be_written(tmp_path):
    with pytest.raises(
        gp.InputError, match=r"path: expected a name that ends in one of .*png.*got .*poses\.xyz"
    ):
        POSES.draw(path=tmp_path / "poses.xyz")
