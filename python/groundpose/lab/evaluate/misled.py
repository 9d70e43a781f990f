"""Synthetic vehicles of which the caller, or the detector, says something wrong: V1 with one mistake each."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import groundpose as gp
from groundpose.lab.contenders.objects import Array, Objects, relative_thresholds
from groundpose.lab.evaluate.scenes import generate
from groundpose.vehicles import keypoint_names, shape_model

# as V1: noise 1 to 3 % of the longer box side, 20 to 50 % of the keypoints anywhere in the box
_NOISE, _OUTLIERS = (0.01, 0.03), (0.2, 0.5)
_HALF_HEIGHT = 0.75
"""Metres from the centre of V1's box, its origin, to the ground."""


@dataclass(frozen=True)
class Case:
    """One mistake."""

    id: str
    what: str
    """In a table."""
    scenes: Callable[[int, int], list[Objects]]
    """Of so many trials and a seed; a group per nominal tilt."""
    has_truth: bool = True
    """Whether the keypoints say anything of the object: if not, every answer is wrong."""


def observed(
    scenes: Objects,
    rng: np.random.Generator,
    bbox_3d: Array,
    outliers: tuple[float, float] = _OUTLIERS,
    most: int | None = None,
) -> Objects:
    """The scenes with keypoints and boxes as V1 draws them, of their R, t and `rigid` as they are now.

    `bbox_3d`: (2, 3) metres or (N, 2, 3). `outliers`: least and largest fraction; each keypoint is one with
    that probability. `most`: of so many keypoints alone, chosen at random.
    """
    count, width = scenes.keypoints_2d.shape[:2]
    points = scenes.keypoints_3d
    corners = np.stack([_corners(box) for box in np.broadcast_to(bbox_3d, (count, 2, 3))])
    extremes = scenes.camera.project(_moved(corners, scenes))
    bboxes = np.concatenate([extremes.min(axis=1), extremes.max(axis=1)], axis=1)
    longer = (bboxes[:, 2:] - bboxes[:, :2]).max(axis=1)
    noise = (longer * rng.uniform(*_NOISE, count))[:, None, None]
    pixels = scenes.camera.project(_moved(points, scenes)) + noise * rng.normal(size=(count, width, 2))
    wrong = rng.random((count, width)) < rng.uniform(*outliers, (count, 1))
    low, high = bboxes[:, None, :2], bboxes[:, None, 2:]
    anywhere = low + (high - low) * rng.random((count, width, 2))
    pixels = np.where(wrong[..., None], anywhere, pixels)
    seen = np.isfinite(points[..., 0]) & ~np.isnan(scenes.keypoints_2d[..., 0])
    if most is not None:
        ranks = np.where(seen, rng.random(seen.shape), np.inf).argsort(axis=1).argsort(axis=1)
        seen &= ranks < most
    return replace(
        scenes,
        keypoints_2d=np.where(seen[..., None], pixels, np.nan),
        bboxes=bboxes,
        inlier_threshold=relative_thresholds(bboxes),
        inlier_truth=seen & ~wrong,
    )


def _corners(bbox_3d: Array) -> Array:
    return np.array(list(itertools.product(*zip(*bbox_3d, strict=True))))


def _moved(points: Array, scenes: Objects) -> Array:
    return np.asarray(points @ np.swapaxes(scenes.R, 1, 2) + scenes.t[:, None, :])


def _about(axes: Array, angles: float | Array) -> Array:
    """Rotations (N, 3, 3) about unit axes (N, 3) by radians (Rodrigues)."""
    x, y, z = axes.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    sine, cosine = (np.reshape(f(angles), (-1, 1, 1)) for f in (np.sin, np.cos))
    return np.asarray(np.eye(3) + sine * cross + (1.0 - cosine) * cross @ cross)


def vehicles(trials: int, seed: int) -> Objects:
    """V1 as it is."""
    return generate("vehicle", trials, seed=seed)


def _stream(seed: int, case: int) -> np.random.Generator:
    return np.random.default_rng([seed, case])


def pitched(degrees: float) -> Callable[[int, int], list[Objects]]:
    """The nominal pitch is wrong: half the scenes either way."""

    def scenes(trials: int, seed: int) -> list[Objects]:
        right = vehicles(trials, seed)
        halves = (right[: trials // 2], degrees), (right[trials // 2 :], -degrees)
        return [
            replace(half, view=gp.View(half.camera, pitch=float(np.radians(pitch)))) for half, pitch in halves
        ]

    return scenes


def leaning(degrees: float) -> Callable[[int, int], list[Objects]]:
    """The object leans about a random horizontal axis."""

    def scenes(trials: int, seed: int) -> list[Objects]:
        upright, rng = vehicles(trials, seed), _stream(seed, 1)
        azimuth = rng.uniform(-np.pi, np.pi, trials)
        axes = np.stack([np.cos(azimuth), np.zeros(trials), np.sin(azimuth)], axis=1)
        lean = _about(axes, np.radians(degrees))
        return [observed(replace(upright, R=upright.R @ lean), rng, upright.models[0].bbox_3d)]

    return scenes


def upside_down(trials: int, seed: int) -> list[Objects]:
    """The image is turned by half a turn, and nobody said so."""
    upright = vehicles(trials, seed)
    turn, centre = np.diag([-1.0, -1.0, 1.0]), np.array([upright.camera.cx, upright.camera.cy])
    boxes = 2.0 * np.tile(centre, 2) - upright.bboxes
    return [
        replace(
            upright,
            R=turn @ upright.R,
            t=upright.t @ turn,
            keypoints_2d=2.0 * centre - upright.keypoints_2d,
            bboxes=boxes[:, [2, 3, 0, 1]],
        )
    ]


def of_another_class(true: str, given: str) -> Callable[[int, int], list[Objects]]:
    """Vehicles of class `true` with the model of class `given`: the keypoints that both have."""

    def scenes(trials: int, seed: int) -> list[Objects]:
        rng, model, truth = _stream(seed, 2), shape_model(given), shape_model(true)
        names = keypoint_names(true)
        place = {name: k for k, name in enumerate(names)}
        shared = [place.get(name, -1) for name in keypoint_names(given)]
        coefficients = rng.normal(size=(trials, truth.modes)) * np.sqrt(truth.eigenvalues)
        padded = [np.vstack([truth.keypoints(c), np.full((1, 3), np.nan)])[shared] for c in coefficients]
        boxes = np.stack([truth.bbox_3d_of(c) for c in coefficients])
        upright = vehicles(trials, seed)
        down = np.array([0.0, _HALF_HEIGHT, 0.0])
        whole = replace(
            upright,
            t=upright.t + upright.R @ down,
            rigid=np.stack(padded),
            keypoints_2d=np.zeros((trials, len(shared), 2)),
            models=[model] * trials,
        )
        return [observed(whole, rng, boxes)]

    return scenes


def with_outliers(
    least: float, largest: float, most: int | None = None
) -> Callable[[int, int], list[Objects]]:
    """Other fractions of wrong keypoints; `most`: of so many keypoints in all."""

    def scenes(trials: int, seed: int) -> list[Objects]:
        right, rng = vehicles(trials, seed), _stream(seed, 3)
        return [observed(right, rng, right.models[0].bbox_3d, (least, largest), most)]

    return scenes


def collapsed(spread: float) -> Callable[[int, int], list[Objects]]:
    """All keypoints in one place of the box: noise of `spread` longer sides, and nothing else."""

    def scenes(trials: int, seed: int) -> list[Objects]:
        right, rng = vehicles(trials, seed), _stream(seed, 4)
        size = right.bboxes[:, 2:] - right.bboxes[:, :2]
        place = right.bboxes[:, :2] + size * rng.uniform(0.1, 0.9, (trials, 2))
        noise = spread * size.max(axis=1)[:, None, None] * rng.normal(size=right.keypoints_2d.shape)
        pixels = np.where(np.isnan(right.keypoints_2d), np.nan, place[:, None] + noise)
        return [replace(right, keypoints_2d=pixels)]

    return scenes


def shrunk(factor: float) -> Callable[[int, int], list[Objects]]:
    """A picture of the object, `factor` times as large as the box says, somewhere in the box."""

    def scenes(trials: int, seed: int) -> list[Objects]:
        right, rng = vehicles(trials, seed), _stream(seed, 5)
        low, high = right.bboxes[:, :2], right.bboxes[:, 2:]
        centre, place = 0.5 * (low + high), low + (high - low) * rng.uniform(0.1, 0.9, (trials, 2))
        pixels = place[:, None] + factor * (right.keypoints_2d - centre[:, None])
        return [replace(right, keypoints_2d=pixels)]

    return scenes


def chance(trials: int, seed: int) -> list[Objects]:
    """Every keypoint anywhere in the box."""
    return with_outliers(1.0, 1.0)(trials, seed)


CASES = (
    Case("v1", "nothing wrong (V1)", lambda trials, seed: [vehicles(trials, seed)]),
    Case("pitch-20", "nominal pitch wrong by 20 deg", pitched(20.0)),
    Case("pitch-30", "nominal pitch wrong by 30 deg", pitched(30.0)),
    Case("lean-15", "object leans by 15 deg", leaning(15.0)),
    Case("lean-30", "object leans by 30 deg", leaning(30.0)),
    Case("upside-down", "image upside down", upside_down),
    Case("class", "a truck with the model of a car", of_another_class("box_truck", "car")),
    Case("four", "four keypoints, each wrong with probability 0.3", with_outliers(0.3, 0.3, most=4)),
    Case("outliers", "70 to 90 % of the keypoints wrong", with_outliers(0.7, 0.9)),
    Case("collapsed", "keypoints on one point, 2 % of the box", collapsed(0.02), has_truth=False),
    Case("shrunk", "keypoints of an object 50 times too far", shrunk(0.02), has_truth=False),
    Case("tiny", "keypoints of an object 10 times too far", shrunk(0.1), has_truth=False),
    Case("chance", "keypoints anywhere in the box", chance, has_truth=False),
)
