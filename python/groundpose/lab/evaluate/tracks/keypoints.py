"""Keypoints of vehicles over time: one body per vehicle, and errors that successive frames share.

A network that sees the same vehicle from the same side a tenth of a second later makes nearly the same error.
The random numbers of the simulated detector are therefore those of the frame before, partly: a Gauss-Markov
sequence for each of them, forgotten within `time`; 0: every frame has its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.kitti.dataset import KittiFrame
from groundpose.formats.kitti.labels import CLASS_OF, KittiLabel
from groundpose.lab.evaluate.kitti.keypoints import WIDTH, Found, seen_of
from groundpose.lab.evaluate.simulated.keypoint_noise import Detector, Draws, Seen
from groundpose.vehicles import keypoint_indices, shape_model

_UNIFORM = ("confused", "band", "wrong", "kind", "another", "score", "anywhere")
_NORMAL = ("scatter",)


@dataclass
class FollowedKeypoints:
    """Keypoints of the vehicles of a sequence, frame after frame."""

    sequence: str
    time: float = 1.0
    """Within which errors are forgotten, s."""
    seed: int = 0
    quality: float = 1.0
    _last: dict[int, tuple[float, dict[str, FloatArray]]] = field(default_factory=dict)

    def __call__(
        self,
        frame: KittiFrame,
        now: float,
        bboxes: FloatArray,
        labels: Sequence[KittiLabel],
        vehicles: Sequence[int],
    ) -> Found:
        """Keypoints in boxes (N, 4) of a frame at time `now`; `vehicles` are the numbers of the labels'."""
        keys = [(self.seed, hash_of(self.sequence), vehicle) for vehicle in vehicles]
        points, states, solid = seen_of(frame, labels, keys)
        seen = Seen(points, states, solid, bboxes)
        pixels, scores = Detector("CNN", self.quality).answer(seen, self._draws(seen, now, vehicles))
        classes = [CLASS_OF[label.type] for label in labels]
        lengths = [len(keypoint_indices(class_name)) for class_name in classes]
        return Found(
            [row[:n] for row, n in zip(pixels, lengths, strict=True)],
            [np.nan_to_num(row[:n]) for row, n in zip(scores, lengths, strict=True)],
            [shape_model(class_name) for class_name in classes],
        )

    def _draws(self, seen: Seen, now: float, vehicles: Sequence[int]) -> Draws:
        """Random numbers of a frame."""
        rows = [self._row(now, vehicle) for vehicle in vehicles]
        stacked = {name: np.stack([row[name] for row in rows]) for name in (*_UNIFORM, *_NORMAL)}
        corner, extent = seen.bboxes[:, None, :2], seen.bboxes[:, None, 2:] - seen.bboxes[:, None, :2]
        stacked["scatter"] = stacked["scatter"] * seen.longer[:, None, None]
        stacked["anywhere"] = corner + extent * stacked["anywhere"]
        return Draws(**stacked)

    def _row(self, now: float, vehicle: int) -> dict[str, FloatArray]:
        """Of one vehicle: uniform and normal numbers, like those of its frame before."""
        rng = np.random.default_rng((self.seed, hash_of(self.sequence), vehicle, round(1e3 * now)))
        shapes = {
            f.name: (WIDTH, 2) if f.name in ("scatter", "anywhere") else (WIDTH,) for f in fields(Draws)
        }
        fresh = {name: rng.standard_normal(shape) for name, shape in shapes.items()}
        before, last = self._last.get(vehicle, (-np.inf, fresh))
        keep = np.exp(-(now - before) / self.time) if self.time > 0.0 else 0.0
        state = {name: keep * last[name] + np.sqrt(1.0 - keep**2) * fresh[name] for name in fresh}
        self._last[vehicle] = (now, state)
        return {name: uniform(value) if name in _UNIFORM else value for name, value in state.items()}


def uniform(normal: FloatArray) -> FloatArray:
    """Numbers from 0 to 1 of standard normal ones, by Winitzki's approximation of the error function
    (1e-4)."""
    x2 = normal**2 / 2.0
    a = 0.147
    erf = np.sqrt(1.0 - np.exp(-x2 * (4.0 / np.pi + a * x2) / (1.0 + a * x2)))
    return np.asarray(np.clip(0.5 * (1.0 + np.sign(normal) * erf), 1e-9, 1.0 - 1e-9))


def hash_of(text: str) -> int:
    """The same on every machine."""
    return int(sum(ord(c) * 131**k for k, c in enumerate(text)) % 2**31)
