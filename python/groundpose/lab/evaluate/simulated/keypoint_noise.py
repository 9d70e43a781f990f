"""Keypoints and scores of a simulated detector, drawn as a real CNN's on KITTI.

A keypoint draws a band of scores (visible and hidden ones from different fractions); its band says how
likely it is wrong and how large its noise is when it is not. A wrong one sits at another place: where its
left/right partner is, where the keypoint is that half a turn puts in its place, on top of another keypoint
that was found, or anywhere in the box. A fraction of the objects is confused: keypoints of their hidden end
look found, half a turn away. `groundpose evaluate detector` fits the numbers to 108 cars of three tracks.

Left out: the shift that all keypoints of a car share (8 to 10 % of the box, constant over a track: it comes
from the stretched mean shape and the label, so it was taken away before the fit), errors that neighbours or
successive frames share, places that attract wrong keypoints, any dependence on size, light and occluders.
Three tracks are few: the fraction of confused objects (one car of three) is little more than a guess.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from groundpose.lab.contenders.objects import Array

OUTSIDE, HIDDEN, VISIBLE = 0, 1, 2
"""States of a keypoint: outside the image, behind something or the vehicle itself, seen."""
EDGES = (0.003, 0.015, 0.05, 0.1, 0.3, 0.5, 0.65, 0.87)
"""Of the bands of scores; inside a band log-uniform."""
FOUND, DOUBTFUL = 4, 2
"""First band of keypoints that count as found, and of those in doubt; below them nothing was found."""
NOISE = (0.104, 0.070, 0.058, 0.058, 0.040, 0.037, 0.023)
"""Standard deviation of a coordinate of a right keypoint by band, over the longer side l of the box."""
KINDS = ("left/right", "half turn", "another", "box")
"""Where a wrong keypoint is."""
LEFT_RIGHT, HALF_TURN, ANOTHER, BOX, RIGHT = range(len(KINDS) + 1)
CROP_MARGIN = 0.1
"""What a detector sees around the box, fraction of l."""
STREAM = 2
"""Sets the random numbers of keypoints apart from those of boxes of the same seed."""


@dataclass(frozen=True)
class Habit:
    """How the detector treats the keypoints of one kind of object: fractions by band of scores."""

    bands: tuple[tuple[float, ...], tuple[float, ...]]
    """Of hidden and of visible keypoints, each adds up to 1."""
    wrong: tuple[tuple[float, ...], tuple[float, ...]]
    """Of hidden and of visible keypoints."""
    kinds: tuple[tuple[float, ...], tuple[float, ...]]
    """Of KINDS among the wrong ones, below and from band DOUBTFUL on."""


CLEAR = Habit(
    bands=(
        (0.204, 0.479, 0.119, 0.112, 0.040, 0.017, 0.030),
        (0.053, 0.177, 0.035, 0.064, 0.070, 0.222, 0.378),
    ),
    wrong=((0.94, 0.79, 0.22, 0.05, 0.06, 0.0, 0.0), (0.52, 0.77, 0.06, 0.18, 0.0, 0.0, 0.0)),
    kinds=((0.16, 0.16, 0.46, 0.22), (0.48, 0.03, 0.03, 0.46)),
)
# seen from behind, where all of these were, left/right and half turn look the same: here they are half turns
CONFUSED = Habit(
    bands=(
        (0.281, 0.356, 0.063, 0.150, 0.112, 0.019, 0.019),
        (0.234, 0.234, 0.078, 0.235, 0.078, 0.063, 0.078),
    ),
    wrong=((0.89, 0.91, 0.70, 0.96, 1.0, 1.0, 1.0), (0.93, 0.40, 0.0, 0.07, 0.0, 0.0, 0.0)),
    kinds=((0.0, 0.21, 0.47, 0.32), (0.0, 0.67, 0.0, 0.33)),
)
CONFUSED_SHARE = 16 / 108


@dataclass(frozen=True)
class Seen:
    """N objects as a camera sees them, P keypoints each; what a perfect detector would answer."""

    keypoints_2d: Array
    """(N, P, 2) px, NaN beyond an object's own."""
    state: npt.NDArray[np.int64]
    """(N, P) OUTSIDE, HIDDEN or VISIBLE"""
    keypoints_3d: Array
    """(N, P, 3) metres, object frame, NaN beyond an object's own."""
    bboxes: Array
    """(N, 4) px"""

    def __getitem__(self, rows: slice) -> Seen:
        """Some of the objects."""
        return Seen(self.keypoints_2d[rows], self.state[rows], self.keypoints_3d[rows], self.bboxes[rows])

    @property
    def longer(self) -> Array:
        """(N,) px: the longer side of the box."""
        return np.asarray((self.bboxes[:, 2:] - self.bboxes[:, :2]).max(axis=1))

    def partners(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """(N, P) twice: the keypoint that mirroring left and right, or half a turn, puts in its place."""
        low, high = np.nanmin(self.keypoints_3d, axis=1), np.nanmax(self.keypoints_3d, axis=1)
        centred = np.nan_to_num(self.keypoints_3d - ((low + high) / 2)[:, None], nan=1e3)
        moved = (centred * [-1.0, 1.0, 1.0], centred * [-1.0, 1.0, -1.0])
        mirror, turn = (_nearest(m, centred) for m in moved)
        return mirror, turn


def _nearest(points: Array, others: Array) -> npt.NDArray[np.int64]:
    """(N, P) row of `others` (N, P, 3) nearest to each of `points` (N, P, 3)."""
    squares = sum((points[:, :, None, k] - others[:, None, :, k]) ** 2 for k in range(3))
    return np.asarray(np.argmin(squares, axis=2))


@dataclass(frozen=True)
class Detector:
    """A detector of keypoints. `quality` scales the noise, the fraction of keypoints that are not found
    (bands below DOUBTFUL) and that of confused objects; 1 = as measured. What a score means stays."""

    name: str
    quality: float
    note: str = ""

    def __call__(self, seen: Seen, seed: int) -> tuple[Array, Array]:
        """Keypoints (N, P, 2) px and scores (N, P), NaN beyond an object's own.

        Object k's depend on `seed`, k and P only.
        """
        return self.answer(seen, Draws.of(seen, seed))

    def answer(self, seen: Seen, draw: Draws) -> tuple[Array, Array]:
        """The same from random numbers that are given."""
        own = np.isfinite(seen.keypoints_3d[..., 0])
        confused = np.where(draw.confused[:, :1] < CONFUSED_SHARE * self.quality, 1, 0)
        band = _pick(draw.band, self._bands()[confused, seen.state])
        wrong = draw.wrong < _wrong()[confused, seen.state, band]
        kind = _pick(
            draw.kind, np.array([CLEAR.kinds, CONFUSED.kinds])[confused, np.where(band < DOUBTFUL, 0, 1)]
        )
        kind = np.where(wrong, kind, RIGHT)
        noise = self.quality * np.where(wrong, NOISE[FOUND], np.array(NOISE)[band])[..., None] * draw.scatter
        at = np.where((kind == BOX)[..., None], draw.anywhere, _places(seen, kind) + noise)
        at = _on_another(at, kind == ANOTHER, own & (band >= FOUND), draw)
        low, high = np.log(EDGES[:-1])[band], np.log(EDGES[1:])[band]
        scores = np.where(own, np.exp(low + (high - low) * draw.score), np.nan)
        return np.where(own[..., None], _in_crop(at, seen.bboxes), np.nan), scores

    def _bands(self) -> Array:
        """(2, 3, bands): fractions for clear and confused objects, by state."""
        fractions = np.array([[habit.bands[0], *habit.bands] for habit in (CLEAR, CONFUSED)])
        lost = np.arange(fractions.shape[-1]) < DOUBTFUL
        fractions[:, OUTSIDE] *= lost  # what is not in the image cannot be found
        low = fractions[..., lost].sum(axis=-1, keepdims=True)
        better = np.where(lost, self.quality, (1.0 - self.quality * low) / np.maximum(1.0 - low, 1e-9))
        better[:, OUTSIDE] = 1.0
        scaled = fractions * better
        return np.asarray(scaled / scaled.sum(axis=-1, keepdims=True))


@dataclass(frozen=True)
class Draws:
    """Random numbers of N objects, one stream each: those of object k do not depend on how many follow."""

    confused: Array
    band: Array
    wrong: Array
    kind: Array
    another: Array
    score: Array
    """(N, P) from 0 to 1, each of these"""
    scatter: Array
    """(N, P, 2) normal, px for a deviation of the whole longer side"""
    anywhere: Array
    """(N, P, 2) px, in the box"""

    @classmethod
    def of(cls, seen: Seen, seed: int) -> Draws:
        """Those of N objects with P keypoints."""
        children = np.random.SeedSequence((seed, STREAM)).spawn(8)
        streams = [np.random.Generator(np.random.PCG64(child)) for child in children]
        shape, corner = seen.state.shape, seen.bboxes[:, None, :2]
        scatter = streams[6].standard_normal((*shape, 2)) * seen.longer[:, None, None]
        anywhere = corner + (seen.bboxes[:, None, 2:] - corner) * streams[7].random((*shape, 2))
        confused, band, wrong, kind, another, score = (stream.random(shape) for stream in streams[:6])
        return cls(confused, band, wrong, kind, another, score, scatter, anywhere)


def _pick(u: Array, fractions: Array) -> npt.NDArray[np.int64]:
    """Index into the last axis of `fractions`, which adds up to 1, by u from 0 to 1."""
    return np.asarray((u[..., None] > np.cumsum(fractions, axis=-1)[..., :-1]).sum(axis=-1))


def _wrong() -> Array:
    """(2, 3, bands): chance of being wrong."""
    return np.array([[np.ones(len(NOISE)), *habit.wrong] for habit in (CLEAR, CONFUSED)])


def _places(seen: Seen, kind: npt.NDArray[np.int64]) -> Array:
    """(N, P, 2) where a keypoint is looked for: its own place or that of the one it is taken for."""
    mirror, turn = seen.partners()
    own = np.broadcast_to(np.arange(kind.shape[1]), kind.shape)
    index = np.select([kind == LEFT_RIGHT, kind == HALF_TURN], [mirror, turn], own)
    return np.take_along_axis(seen.keypoints_2d, index[..., None], axis=1)


def _on_another(at: Array, chosen: npt.NDArray[np.bool_], found: npt.NDArray[np.bool_], draw: Draws) -> Array:
    """Puts the chosen keypoints on one that was found, each its own draw; anywhere when none was."""
    usable = found & ~chosen
    count = usable.sum(axis=1, keepdims=True)
    order = np.argsort(~usable, axis=1, kind="stable")  # usable ones first
    rank = np.minimum(np.floor(draw.another * count).astype(int), np.maximum(count - 1, 0))
    target = np.take_along_axis(order, rank, axis=1)
    there = np.where((count > 0)[..., None], np.take_along_axis(at, target[..., None], axis=1), draw.anywhere)
    return np.where(chosen[..., None], there, at)


def _in_crop(at: Array, bboxes: Array) -> Array:
    """A detector answers inside the picture it is given: the box and some of its surroundings."""
    margin = CROP_MARGIN * (bboxes[:, 2:] - bboxes[:, :2]).max(axis=1)[:, None, None]
    inside: Array = np.clip(at, bboxes[:, None, :2] - margin, bboxes[:, None, 2:] + margin)
    return inside
