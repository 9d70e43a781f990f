"""Objects of every quality, with keypoints of the caller: what `callers` fits and tests probabilities on.

Nobody knows which keypoints a caller has. So there is a part of everything: exact boxes, boxes of a
detector, of the visible part alone, and none; few and many wrong keypoints; the mistakes of `misled`;
models of another class.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from groundpose.lab.contenders.objects import Array, Objects
from groundpose.lab.evaluate.misled import CASES, Case, of_another_class, vehicles, with_outliers
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.evaluate.simulated.box_noise import draw_boxes
from groundpose.lab.evaluate.simulated.keypoint_noise import DOUBTFUL, EDGES
from groundpose.lab.evaluate.simulated.objects import collect
from groundpose.lab.evaluate.simulated.run import SETTINGS, Setting
from groundpose.vehicles import shape_model

Scenes = Callable[[int, int], list[Objects]]
_CUBES = (0.1, 0.3, 0.5, 0.7, 0.9)
_CUBE_POINTS = (20, 50, 100, 300)
_CLASSES = (
    ("car", "car"),
    ("van_bus", "van_bus"),
    ("box_truck", "box_truck"),
    ("car", "box_truck"),
    ("van_bus", "car"),
    ("car", "van_bus"),
    ("pickup", "car"),
    ("box_truck", "van_bus"),
)
_LEAST_SCORE = 0.3
"""Of keypoints that are handed on without their scores."""
_HIDDEN = (0.1, 0.5)
"""Range of the hidden fraction of a box."""


def _boxless(trials: int, seed: int) -> list[Objects]:
    seen = vehicles(trials, seed)
    return [replace(seen, bboxes=np.full_like(seen.bboxes, np.nan))]


def _detected(trials: int, seed: int) -> list[Objects]:
    seen, rng = vehicles(trials, seed), np.random.default_rng([seed, 6])
    size = seen.camera.image_size
    assert size is not None
    return [replace(seen, bboxes=draw_boxes(seen.bboxes, rng.integers(0, 3, trials), size, seed))]


def _cut(trials: int, seed: int) -> list[Objects]:
    """One side of the box is not known, or two of opposite or neighbouring ones."""
    seen, rng = vehicles(trials, seed), np.random.default_rng([seed, 9])
    boxes = seen.bboxes.copy()
    for sides in rng.integers(0, 4, (2, trials)):
        boxes[np.arange(trials), sides] = np.nan
    return [replace(seen, bboxes=boxes)]


def _half_hidden(trials: int, seed: int) -> list[Objects]:
    """Vehicles of which one side is hidden: no keypoints there, and the box ends before it."""
    seen, rng = vehicles(trials, seed), np.random.default_rng([seed, 7])
    rows, side = np.arange(trials), rng.integers(0, 4, trials)
    axis, boxes = side % 2, seen.bboxes.copy()
    length = boxes[rows, axis + 2] - boxes[rows, axis]
    inward = np.where(side < 2, 1.0, -1.0)
    boxes[rows, side] += inward * rng.uniform(*_HIDDEN, trials) * length
    position = np.take_along_axis(seen.keypoints_2d, axis[:, None, None], axis=2)[..., 0]
    visible = inward[:, None] * (position - boxes[rows, side][:, None]) >= 0.0
    return [replace(seen, bboxes=boxes, keypoints_2d=np.where(visible[..., None], seen.keypoints_2d, np.nan))]


def _cubes(outlier_ratio: float) -> Scenes:
    def scenes(trials: int, seed: int) -> list[Objects]:
        each = {"seed": seed, "outlier_ratio": outlier_ratio}
        count = trials // (2 * len(_CUBE_POINTS))
        kinds = [(n, outliers) for n in _CUBE_POINTS for outliers in ("image", "box")]
        return [generate("cube", count, n_points=n, outliers=outliers, **each) for n, outliers in kinds]

    return scenes


def _simulated(setting: Setting, experiment: str) -> Scenes:
    return lambda trials, seed: [setting.given(experiment, collect(trials, seed), seed, shape_model)]


def _without_scores(scenes: Scenes) -> Scenes:
    return lambda trials, seed: [objects.cut(_LEAST_SCORE) for objects in scenes(trials, seed)]


def _nothing(scenes: Scenes) -> Scenes:
    """Keypoints of a vehicle that is not there: in place, with scores of a detector that found nothing."""

    def without(objects: Objects, seed: int) -> Objects:
        rng = np.random.default_rng([seed, 8])
        low, high = np.log(EDGES[0]), np.log(EDGES[DOUBTFUL])
        scores: Array = np.exp(rng.uniform(low, high, objects.keypoints_2d.shape[:2]))
        return replace(
            objects, keypoint_scores=np.where(np.isnan(objects.keypoints_2d[..., 0]), np.nan, scores)
        )

    return lambda trials, seed: [without(objects, seed) for objects in scenes(trials, seed)]


_DETECTORS = {
    f"{setting.key}, {experiment}": _simulated(setting, experiment)
    for setting in SETTINGS
    for experiment in ("G1", "G2")
}
"""Simulated detectors with true and with detected boxes; known models (G1), those of the class (G2)."""
_SAYS_NOTHING = {"collapsed", "shrunk", "tiny"}
"""Cases of `misled` that get no probability: they are refused for their looks."""


def _case(id: str, scenes: Scenes, has_truth: bool = True) -> Case:
    return Case(id, id, scenes, has_truth)


WITHOUT_SCORES = (
    *(case for case in CASES if case.id not in _SAYS_NOTHING),
    _case("no box", _boxless),
    _case("sides not known", _cut),
    _case("detected box", _detected),
    _case("half hidden", _half_hidden),
    *(_case(f"E1, {ratio:.0%} outliers", _cubes(ratio)) for ratio in _CUBES),
    *(_case(f"{true} as {given}", of_another_class(true, given)) for true, given in _CLASSES),
    _case("eight keypoints", with_outliers(0.0, 0.5, 8)),
    _case("five keypoints", with_outliers(0.0, 0.5, 5)),
    _case("0 to 20 % wrong", with_outliers(0.0, 0.2)),
    _case("50 to 70 % wrong", with_outliers(0.5, 0.7)),
    *(_case(name, _without_scores(scenes)) for name, scenes in _DETECTORS.items()),
)
WITH_SCORES = (
    *(_case(name, scenes) for name, scenes in _DETECTORS.items()),
    _case("nothing there, V1", _nothing(lambda trials, seed: [vehicles(trials, seed)]), has_truth=False),
    _case("nothing there, drive", _nothing(next(reversed(_DETECTORS.values()))), has_truth=False),
)
