"""What a contender is given of scores and thresholds."""

from __future__ import annotations

from dataclasses import dataclass, replace

from groundpose.lab.contenders.contender import Answers, Contender
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.contenders.own import Own
from groundpose.lab.contenders.polish import Polished
from groundpose.lab.timing import Clock

LOWEST_SCORE = 0.1
"""Contenders that cannot weigh keypoints leave out those with a lower score."""
NO_SCORES, WEIGHTS = "", "scores as weights"


def cut_at(lowest: float) -> str:
    """How tables call leaving out keypoints by their score."""
    return f"score >= {lowest:g}"


CUT = cut_at(LOWEST_SCORE)


@dataclass(frozen=True)
class Use:
    """A contender with scores or another threshold; a contender itself."""

    contender: Contender
    scores: str = NO_SCORES
    """NO_SCORES, WEIGHTS or `cut_at`: for the name."""
    lowest: float | None = None
    """Score below which keypoints are left out; None: scores are handed on, or not used."""
    threshold_factor: float = 1.0
    """On the paper's inlier threshold."""

    @property
    def name(self) -> str:
        """Of the contender, with what is special."""
        factor = f"threshold x {self.threshold_factor:g}" if self.threshold_factor != 1.0 else ""
        return ", ".join(part for part in (self.contender.name, self.scores, factor) if part)

    @property
    def note(self) -> str:
        """Of the contender."""
        return self.contender.note

    @property
    def weighs_scores(self) -> bool:
        """Whether scores are handed on."""
        return self.scores == WEIGHTS

    @property
    def slow_with_outliers(self) -> bool:
        """Of the contender."""
        return self.contender.slow_with_outliers

    def missing(self) -> str | None:
        """Of the contender."""
        return self.contender.missing()

    def solve(self, objects: Objects, clock: Clock) -> Answers:
        """See `Contender`."""
        if self.lowest is not None:
            objects = objects.cut(self.lowest)
        elif not self.weighs_scores:
            objects = objects.without_scores()
        thresholds = self.threshold_factor * objects.inlier_threshold
        return self.contender.solve(replace(objects, inlier_threshold=thresholds), clock)


def without_scores(contender: Contender) -> Use:
    """Scores are not used."""
    return Use(contender)


def with_scores(contender: Contender) -> Use:
    """The most that it can do with scores; where that is said already, it stays as it is."""
    if isinstance(contender, Use):
        return contender
    return Use(contender, WEIGHTS) if contender.weighs_scores else with_cut(contender)


def with_cut(contender: Contender, lowest: float = LOWEST_SCORE) -> Use:
    """Keypoints with a lower score are left out."""
    return Use(contender, cut_at(lowest), lowest)


def at_threshold(contender: Contender, factor: float) -> Use:
    """Scores as before, `factor` times the paper's inlier threshold."""
    if isinstance(contender, Use):
        return replace(contender, threshold_factor=factor)
    return Use(contender, threshold_factor=factor)


def batched(contender: Contender, size: int) -> Contender:
    """The same, our own calls with so many objects each; random samples depend on the place in a call."""
    if isinstance(contender, Own):
        return replace(contender, batch=size)
    if isinstance(contender, Use):
        return replace(contender, contender=batched(contender.contender, size))
    if isinstance(contender, Polished):
        return replace(contender, search=batched(contender.search, size))
    return contender
