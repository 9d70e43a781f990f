"""Pictures: geometry against its definition, and that what is promised is on the paper."""

import dataclasses

import groundpose as gp
import matplotlib
import numpy as np
import pytest
from conftest import CAMERA, MODEL, VIEW, make_batch
from groundpose import draw
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
    for colour in (draw.POSE, draw.BOX, draw.INLIER, draw.OUTLIER, draw.MISSING, draw.NO_POSE, draw.TRUTH):
        assert has_colour(path, colour), colour
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
    line = draw._segment(POSES, ends)
    assert np.isfinite(line).all()
    np.testing.assert_allclose(line[-1], VIEW.project(ends[1:])[0])
    np.testing.assert_allclose(line[0], VIEW.project([[1.0, 0.5, 0.1]])[0])
    assert draw._segment(POSES, ends * [1, 1, -1] - [0, 0, 5]) is None


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
