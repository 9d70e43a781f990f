"""KITTI's average precision at 40 recalls, with its rules of what counts, computed from frame to frame.

As the official evaluator: a detection is right when it overlaps an object of its class enough; objects that
are too small, hidden or cut for a difficulty, those of a neighbouring class (vans beside cars) and, in the
image, regions marked DontCare neither help nor harm; orientation similarity (AOS) weighs hits by (1 +
cos(alpha error)) / 2.

Not as there: detections are matched once, by falling score, instead of once at each of 41 scores, so that a
frame can be judged alone; and in small sets one hit stands for all of the 40 recalls it is nearest to
(there are fewer than 41 scores to choose from then, and officially the truth against itself has less than
100). On sets of some hundred objects both agree to a few tenths of a per cent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.formats.kitti.dataset import DIFFICULTIES, LEAST_HEIGHT_PX, difficulty
from groundpose.formats.kitti.labels import DONT_CARE, KittiLabel
from groundpose.lab.evaluate.kitti.overlap import Boxes, image_overlap, space_overlaps

Mask = NDArray[np.bool_]
RECALLS = 40
OVERLAPS = {"2D": 0.7, "BEV": 0.7, "3D": 0.7, "BEV loose": 0.5, "3D loose": 0.5}
"""Least overlap of a hit with a vehicle, KITTI's and a looser one."""
MEASURES = tuple(OVERLAPS)
NEIGHBOURS = {"Car": ("Van",), "Van": (), "Truck": ()}
"""Classes that are evaluated, and those that a detection of the class may be instead without harm."""
HIT, WRONG, NOTHING = "1", "0", "-"
"""What became of a detection: right, wrong, neither."""
Detection = tuple[float, float, str]
"""Score, orientation similarity with the object hit in the image (0 without), and a letter of HIT, WRONG or
NOTHING for each difficulty of each measure."""


@dataclass
class Hits:
    """Detections of one class, and how many objects there are at each difficulty."""

    objects: list[int] = field(default_factory=lambda: [0] * len(DIFFICULTIES))
    detections: list[Detection] = field(default_factory=list)

    def add(self, other: Hits) -> None:
        """Those of another frame."""
        self.objects = [a + b for a, b in zip(self.objects, other.objects, strict=True)]
        self.detections += other.detections


def boxes_of(labels: Sequence[KittiLabel]) -> Boxes:
    """Boxes in space; NaN for labels without a pose."""
    rows = np.array(
        [(x.height, x.width, x.length, *x.location, x.rotation_y) for x in labels], dtype=float
    ).reshape(-1, 7)
    rows[[not label.has_pose for label in labels]] = np.nan
    return Boxes(rows[:, :3], rows[:, 3:6], rows[:, 6])


@dataclass(frozen=True)
class Overlaps:
    """Of all detections with all labels of a frame, (N, M) each."""

    image: FloatArray
    above: FloatArray
    space: FloatArray
    excused: FloatArray
    """(N,) largest fraction of a detection inside one region marked DontCare."""

    @classmethod
    def of(cls, found: Sequence[KittiLabel], truth: Sequence[KittiLabel]) -> Overlaps:
        """Compute them."""
        mine, theirs = image_boxes(found), image_boxes(truth)
        stuff = image_boxes([x for x in truth if x.type == DONT_CARE])
        excused = image_overlap(mine, stuff, over_a=True).max(axis=1, initial=0.0)
        return cls(image_overlap(mine, theirs), *space_overlaps(boxes_of(found), boxes_of(truth)), excused)


def judge(
    truth: Sequence[KittiLabel],
    found: Sequence[KittiLabel],
    class_name: str,
    overlaps: Overlaps | None = None,
) -> Hits:
    """What detections `found` of class `class_name` are worth in one frame with labels `truth`."""
    objects = [k for k, x in enumerate(truth) if x.type == class_name or x.type in NEIGHBOURS[class_name]]
    mine = [k for k, x in enumerate(found) if x.type == class_name]
    of_class = [difficulty(truth[k]) if truth[k].type == class_name else len(DIFFICULTIES) for k in objects]
    levels = np.array(of_class, dtype=int)
    hits = Hits([int((levels <= d).sum()) for d in range(len(DIFFICULTIES))])
    if not mine:
        return hits
    overlaps = Overlaps.of(found, truth) if overlaps is None else overlaps
    mine.sort(key=lambda k: -(found[k].score or 0.0))
    pairs = np.ix_(mine, objects)
    by_name = {"2D": overlaps.image[pairs], "BEV": overlaps.above[pairs], "3D": overlaps.space[pairs]}
    excused = overlaps.excused[mine]
    heights = np.array([found[k].bbox[3] - found[k].bbox[1] for k in mine])
    posed = np.array([found[k].has_pose for k in mine])
    columns, partner = [], np.full(len(mine), -1)
    for measure, least in OVERLAPS.items():
        in_image = measure == "2D"
        for level in range(len(DIFFICULTIES)):
            letters, partners = _match(by_name[measure.split()[0]], least, levels <= level)
            aside = (heights < LEAST_HEIGHT_PX[level]) | ~(posed | in_image)
            letters[aside | ((letters == WRONG) & in_image & (excused > least))] = NOTHING
            columns.append(letters)
            if in_image:
                partner = np.where(partners >= 0, partners, partner)
    for row, k in enumerate(mine):
        similarity = 0.0 if partner[row] < 0 else _similarity(found[k], truth[objects[partner[row]]])
        hits.detections.append((found[k].score or 0.0, similarity, "".join(c[row] for c in columns)))
    return hits


def _match(overlap: FloatArray, least: float, counts: Mask) -> tuple[NDArray[np.str_], NDArray[np.int64]]:
    """Letters and partners (N,) of detections in the order of their rank; `counts` (M,): objects that
    count."""
    letters, partners = np.full(len(overlap), WRONG), np.full(len(overlap), -1)
    free = np.ones(len(counts), dtype=bool)
    for k, row in enumerate(overlap if len(counts) else ()):
        for wanted, letter in ((counts, HIT), (~counts, NOTHING)):
            able = np.where(free & wanted & (row > least), row, 0.0)
            best = int(able.argmax())
            if able[best] > 0.0:
                free[best], letters[k], partners[k] = False, letter, best
                break
    return letters, partners


def _similarity(a: KittiLabel, b: KittiLabel) -> float:
    return float((1.0 + np.cos(a.alpha - b.alpha)) / 2.0) if a.has_pose else 0.0


def image_boxes(labels: Sequence[KittiLabel]) -> FloatArray:
    """(N, 4) px"""
    return np.array([x.bbox for x in labels], dtype=float).reshape(-1, 4)


def average_precision(hits: Hits) -> dict[str, list[float | None]]:
    """Per cent at easy, moderate and hard for each of MEASURES and "AOS"; None where there is no object."""
    scores = np.array([score for score, _, _ in hits.detections])
    similarity = np.array([value for _, value, _ in hits.detections])
    letters = np.array([list(text) for _, _, text in hits.detections])
    order = np.argsort(-scores, kind="stable")
    found: dict[str, list[float | None]] = {}
    for column, measure in enumerate(MEASURES):
        for level, objects in enumerate(hits.objects):
            own = letters[order, column * len(DIFFICULTIES) + level] if len(scores) else np.zeros(0, str)
            ranked = (own == HIT, own == WRONG, scores[order])
            found.setdefault(measure, []).append(_area(*ranked, (own == HIT).astype(float), objects))
            if measure == "2D":
                weights = np.where(own == HIT, similarity[order], 0.0)
                found.setdefault("AOS", []).append(_area(*ranked, weights, objects))
    return found


def _area(hit: Mask, wrong: Mask, scores: FloatArray, weights: FloatArray, objects: int) -> float | None:
    """Mean of the interpolated precision (or weights a detection) at the recalls."""
    if objects == 0:
        return None
    hits, precision = curve(hit, wrong, scores, weights)
    best = np.append(np.maximum.accumulate(precision[::-1])[::-1], 0.0)
    most = hits[-1] if len(hits) else 0
    steps = np.arange(1, RECALLS + 1) / RECALLS * objects
    # officially the hit whose recall is nearest, and the last hit for the recall that is reached in part
    wanted = np.where(steps - objects / RECALLS < most, np.clip(np.round(steps), 1, max(most, 1)), np.inf)
    return float(100.0 * best[np.searchsorted(hits, wanted)].mean())


def curve(hit: Mask, wrong: Mask, scores: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Hits and precision down to each score, detections ranked by falling score; equal scores are one
    point."""
    last = np.append(np.diff(scores) != 0.0, True) if len(scores) else np.zeros(0, bool)
    hits, wrongs, sums = (np.cumsum(x)[last] for x in (hit, wrong, weights))
    counted = hits + wrongs
    return hits, np.divide(sums, counted, out=np.zeros(len(sums)), where=counted > 0)
