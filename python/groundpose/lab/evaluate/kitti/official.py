"""Average precision to the digit as KITTI's own evaluator has it: detections are matched again at each of 41
scores, which takes all frames at once.

`average_precision.py` judges frame by frame and gives the same in large sets; below some hundred objects
there are fewer than 41 scores, and KITTI's own number is too small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.kitti.dataset import LEAST_HEIGHT_PX, difficulty
from groundpose.formats.kitti.labels import KittiLabel
from groundpose.lab.evaluate.kitti.average_precision import NEIGHBOURS, OVERLAPS, RECALLS, Mask, Overlaps

_SAMPLES = RECALLS + 1


@dataclass(frozen=True)
class Case:
    """One frame, for one measure and difficulty: N detections of a class, M objects of it and of its
    neighbours."""

    overlap: FloatArray
    """(N, M)"""
    least: float
    """Overlap of a hit."""
    scores: FloatArray
    aside: Mask
    """(N,) detections that are too small: neither right nor wrong."""
    excused: Mask
    """(N,) detections that are not wrong, being where nothing is labelled."""
    counts: Mask
    """(M,) objects that count."""

    @classmethod
    def of(
        cls,
        truth: Sequence[KittiLabel],
        found: Sequence[KittiLabel],
        class_name: str,
        measure: str,
        level: int,
        overlaps: Overlaps | None = None,
    ) -> Case:
        """`measure`: a name of `OVERLAPS`; `level`: 0 easy, 1 moderate, 2 hard."""
        overlaps = Overlaps.of(found, truth) if overlaps is None else overlaps
        objects = [k for k, x in enumerate(truth) if x.type in (class_name, *NEIGHBOURS[class_name])]
        in_image = measure == "2D"
        mine = [k for k, x in enumerate(found) if x.type == class_name and (in_image or x.has_pose)]
        space = {"2D": overlaps.image, "BEV": overlaps.above, "3D": overlaps.space}[measure.split()[0]]
        least = OVERLAPS[measure]
        heights = np.array([found[k].bbox[3] - found[k].bbox[1] for k in mine])
        of_class = [truth[k].type == class_name and difficulty(truth[k]) <= level for k in objects]
        return cls(
            space[np.ix_(mine, objects)],
            least,
            np.array([found[k].score or 0.0 for k in mine]),
            heights < LEAST_HEIGHT_PX[level],
            in_image & (overlaps.excused[mine] > least),
            np.array(of_class, dtype=bool),
        )

    def hit_scores(self) -> list[float]:
        """Scores of the hits when each object takes the best-scored detection that overlaps it."""
        free, found = np.ones(len(self.scores), dtype=bool), []
        for column, counts in zip(self.overlap.T, self.counts, strict=True):
            able = np.flatnonzero(free & (column > self.least))
            if len(able):
                best = able[self.scores[able].argmax()]
                free[best] = False
                if counts and not self.aside[best]:
                    found.append(float(self.scores[best]))
        return found

    def judged(self, threshold: float) -> tuple[int, int]:
        """Right and wrong ones among the detections from a score on, when each object takes the detection
        that overlaps it most."""
        there = self.scores >= threshold
        free, hits = there.copy(), 0
        for column, counts in zip(self.overlap.T, self.counts, strict=True):
            able = np.flatnonzero(free & (column > self.least))
            if len(able):
                best = max(able, key=lambda k: (not self.aside[k], column[k] if not self.aside[k] else -k))
                free[best] = False
                hits += bool(counts and not self.aside[best])
        return hits, int((free & ~self.aside & ~self.excused).sum())


def thresholds(scores: Sequence[float], objects: int) -> list[float]:
    """The scores of hits whose recalls are nearest to 0, 1/40, ... 1."""
    ranked = sorted(scores, reverse=True)
    found: list[float] = []
    recall = 0.0
    for k, score in enumerate(ranked):
        left, last = (k + 1) / objects, k == len(ranked) - 1
        right = left if last else (k + 2) / objects
        if last or right - recall >= recall - left:
            found.append(score)
            recall += 1.0 / RECALLS  # summed as officially: ties depend on it
    return found[:_SAMPLES]


def official_precision(cases: Sequence[Case]) -> float | None:
    """Per cent; None without objects that count."""
    objects = sum(int(case.counts.sum()) for case in cases)
    if objects == 0:
        return None
    precision = np.zeros(_SAMPLES)
    for k, threshold in enumerate(thresholds([s for case in cases for s in case.hit_scores()], objects)):
        hits, wrong = np.sum([case.judged(threshold) for case in cases], axis=0)
        precision[k] = hits / (hits + wrong) if hits else 0.0
    best = np.maximum.accumulate(precision[::-1])[::-1]
    return float(100.0 * best[1:].mean())
