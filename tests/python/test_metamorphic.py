"""Change the input in a way whose effect on the pose is known, and see that the answer changes so."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))

import bridge
import groundpose_reference as ref

THRESHOLD = 4.0
# rad, and share of |t|, that answers may differ by: GN and the last stage of HRE converge like Newton, the
# robust stages of the others linearly, and RE while its scale settles
TOLERANCE = {"gn": 1e-6, "re": 5e-5, "hre": 1e-6, "default": 1e-5}
MIRROR = np.diag([-1.0, 1.0, 1.0])


@dataclass(frozen=True)
class Case:
    """Everything `estimate_batch` is told about one object."""

    view: ref.RefView
    pixels: ref.Array
    bbox: ref.Array
    keypoints_3d: ref.Array
    bbox_3d: ref.Array
    basis: ref.Array
    footprint: ref.Array | None = None
    threshold: float = THRESHOLD

    def estimate(self, **options: Any) -> dict[str, Any]:
        model = bridge.core_model(self.keypoints_3d, self.bbox_3d, self.basis, self.footprint)
        one = bridge.estimate(self.view, self.pixels, self.bbox, model, self.threshold, **options)
        assert one["status"] == "ok"
        return one


@dataclass(frozen=True)
class Expected:
    """How the answer must have changed: R, t, order of the keypoints, left factor of the covariance."""

    R: ref.Array
    t: ref.Array
    order: NDArray[np.int64]
    factor: ref.Array


Change = Callable[[Case, dict[str, Any], np.random.Generator], tuple[Case, Expected]]


def unchanged(case: Case, one: dict[str, Any]) -> Expected:
    return Expected(one["R"], one["t"], np.arange(len(case.pixels)), np.eye(6))


def with_camera(case: Case, **fields: Any) -> ref.RefView:
    return replace(case.view, camera=replace(case.view.camera, **fields))


def mirror(case: Case, one: dict[str, Any], draw: np.random.Generator) -> tuple[Case, Expected]:
    """u -> 2 cx - u, x -> -x in the model and in the world: the roll changes sign."""
    pixels = case.pixels.copy()
    pixels[:, 0] = 2.0 * case.view.camera.cx - pixels[:, 0]
    left, top, right, bottom = case.bbox
    bbox = np.array([2.0 * case.view.camera.cx - right, top, 2.0 * case.view.camera.cx - left, bottom])
    box = case.bbox_3d @ MIRROR
    new = replace(
        case,
        view=replace(case.view, roll=-case.view.roll),
        pixels=pixels,
        bbox=bbox,
        keypoints_3d=case.keypoints_3d @ MIRROR,
        bbox_3d=np.sort(box, axis=0),
        basis=case.basis @ MIRROR,
    )
    # a mirrored rotation vector is the negative of the mirrored vector
    factor = np.block([[-MIRROR, np.zeros((3, 3))], [np.zeros((3, 3)), MIRROR]])
    R, t = MIRROR @ one["R"] @ MIRROR, MIRROR @ one["t"]
    return new, Expected(R, t, np.arange(len(pixels)), factor)


def permute(case: Case, one: dict[str, Any], draw: np.random.Generator) -> tuple[Case, Expected]:
    order = draw.permutation(len(case.pixels))
    new = replace(
        case, pixels=case.pixels[order], keypoints_3d=case.keypoints_3d[order], basis=case.basis[:, order]
    )
    return new, replace(unchanged(case, one), order=order)


def scale_image(case: Case, one: dict[str, Any], draw: np.random.Generator) -> tuple[Case, Expected]:
    s = draw.uniform(0.3, 3.0)
    camera = case.view.camera
    view = with_camera(case, fx=s * camera.fx, fy=s * camera.fy, cx=s * camera.cx, cy=s * camera.cy)
    new = replace(case, view=view, pixels=s * case.pixels, bbox=s * case.bbox, threshold=s * case.threshold)
    return new, unchanged(case, one)


def shift_principal_point(
    case: Case, one: dict[str, Any], draw: np.random.Generator
) -> tuple[Case, Expected]:
    d = draw.uniform(-500.0, 500.0, 2)
    view = with_camera(case, cx=case.view.camera.cx + d[0], cy=case.view.camera.cy + d[1])
    new = replace(case, view=view, pixels=case.pixels + d, bbox=case.bbox + np.tile(d, 2))
    return new, unchanged(case, one)


def scale_world(case: Case, one: dict[str, Any], draw: np.random.Generator) -> tuple[Case, Expected]:
    s = draw.uniform(0.2, 5.0)
    new = replace(case, keypoints_3d=s * case.keypoints_3d, bbox_3d=s * case.bbox_3d, basis=s * case.basis)
    factor = np.diag([1.0, 1.0, 1.0, s, s, s])
    return new, replace(unchanged(case, one), t=s * one["t"], factor=factor)


def move_object_origin(case: Case, one: dict[str, Any], draw: np.random.Generator) -> tuple[Case, Expected]:
    d = draw.uniform(-4.0, 4.0, 3)
    new = replace(case, keypoints_3d=case.keypoints_3d + d, bbox_3d=case.bbox_3d + d)
    expected = replace(unchanged(case, one), t=one["t"] - one["R"] @ d)
    # t' = t - R d moves with the rotation: dt' = dt + hat(R d) w
    factor = np.eye(6)
    factor[3:, :3] = ref.hat(one["R"] @ d)
    return new, replace(expected, factor=factor)


def turn_object_frame(case: Case, one: dict[str, Any], draw: np.random.Generator) -> tuple[Case, Expected]:
    """Object axes turned about its vertical by any angle: the box goes as a footprint."""
    A = ref.rot_y(draw.uniform(-np.pi, np.pi))
    corners = ref.box_corners(case.bbox_3d)
    turned = corners @ A.T
    new = replace(
        case,
        keypoints_3d=case.keypoints_3d @ A.T,
        bbox_3d=np.array([turned.min(axis=0), turned.max(axis=0)]),
        basis=case.basis @ A.T,
        footprint=turned[:4][:, [0, 2]],
    )
    return new, replace(unchanged(case, one), R=one["R"] @ A.T)


CHANGES: list[Change] = [
    mirror, permute, scale_image, shift_principal_point, scale_world, move_object_origin, turn_object_frame
]  # fmt: skip


def drawn_cases(seed: int, with_shape: bool, count: int, noise: float) -> list[tuple[Case, ref.Scene]]:
    draw = np.random.Generator(np.random.PCG64(seed))
    out: list[tuple[Case, ref.Scene]] = []
    while len(out) < count:
        mean, basis, box = ref.car_model(draw)
        basis = basis if with_shape else basis[:0]
        sigma = 0.3 * with_shape
        s = ref.random_scene(
            draw, (mean, basis, box), (-25.0, 5.0), distance=(8.0, 25.0), noise=noise, outliers=6,
            shape_sigma=sigma,
        )  # fmt: skip
        problem = ref.Problem.of(s.view.camera, s.pixels, mean, basis)
        r = problem.residuals(ref.State(s.R, s.t, s.shape))
        # a keypoint near the threshold would let rounding choose the inliers
        if r[~s.inliers].min() > 25.0:
            out.append((Case(s.view, s.pixels, s.bbox, mean, box, basis), s))
    return out


def assert_answer(one: dict[str, Any], expected: Expected, base: dict[str, Any], tolerance: float) -> None:
    assert ref.rotation_angle(one["R"], expected.R) < tolerance
    scale = np.linalg.norm(expected.t)
    np.testing.assert_allclose(one["t"] / scale, expected.t / scale, atol=tolerance)
    np.testing.assert_array_equal(one["inlier_mask"], base["inlier_mask"][expected.order])
    np.testing.assert_allclose(one["shape_coefficients"], base["shape_coefficients"], atol=100 * tolerance)
    covariance = expected.factor @ base["covariance"] @ expected.factor.T
    deviations = np.sqrt(np.diag(covariance))
    unit = np.outer(deviations, deviations)
    np.testing.assert_allclose(one["covariance"] / unit, covariance / unit, atol=1000 * tolerance)


def depends_on_the_draw(change: Change, refinement: str, with_shape: bool) -> bool:
    """In another order other keypoints are drawn, the RANSAC pose is another; GN keeps its inliers.

    Those are the same for a known model here; with the mean shape of a varying one they are not, and the
    scale of RE may settle elsewhere.
    """
    return change is permute and with_shape and refinement in ("gn", "re")


TABLE = [
    pytest.param(change, refinement, with_shape, id=f"{change.__name__}-{refinement}-{name}")
    for change in CHANGES
    for refinement in TOLERANCE
    for with_shape, name in ((False, "rigid"), (True, "shape"))
    if not depends_on_the_draw(change, refinement, with_shape)
]


@pytest.mark.parametrize(("change", "refinement", "with_shape"), TABLE)
def test_the_answer_changes_with_the_input(change: Change, refinement: str, with_shape: bool) -> None:
    draw = np.random.Generator(np.random.PCG64(52))
    for case, _ in drawn_cases(51, with_shape, 12, noise=0.5):
        base = case.estimate(refinement=refinement)
        new, expected = change(case, base, draw)
        assert_answer(new.estimate(refinement=refinement), expected, base, TOLERANCE[refinement])


@pytest.mark.parametrize("refinement", TOLERANCE)
def test_another_tilt_of_the_camera_gives_the_same_object(refinement: str) -> None:
    """The camera turned about its centre: pixels by the homography K Q K^-1, the box from the truth.

    Exact inliers, because the metric of the image changes with the camera.
    """
    draw = np.random.Generator(np.random.PCG64(53))
    for case, scene in drawn_cases(54, False, 12, noise=0.0):
        view = replace(case.view, pitch=np.radians(draw.uniform(-25.0, 5.0)), roll=draw.uniform(-0.1, 0.1))
        Q = view.R_cg @ ref.rot_y(draw.uniform(-0.2, 0.2)) @ case.view.R_cg.T
        rays = np.column_stack([case.pixels, np.ones(len(case.pixels))]) @ np.linalg.inv(view.camera.K).T
        pixels = ref.project(view.camera, rays @ Q.T)
        bbox = np.array(ref.box_columns(view, Q @ scene.R, Q @ scene.t, ref.box_corners(case.bbox_3d)))
        one = case.estimate(refinement=refinement)
        turned = replace(case, view=view, pixels=pixels, bbox=bbox).estimate(refinement=refinement)
        assert ref.rotation_angle(turned["R"], Q @ one["R"]) < 1e-6
        np.testing.assert_allclose(turned["t"], Q @ one["t"], atol=1e-6 * float(np.linalg.norm(one["t"])))
        np.testing.assert_array_equal(turned["inlier_mask"], one["inlier_mask"])
