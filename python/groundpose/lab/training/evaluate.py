"""Accuracy of a network on held-out crops, and calibration of its scores."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.decode import VIEWING_ANGLES, Calibration, Detections
from groundpose.keypoints.network import VEHICLE_THRESHOLD
from groundpose.lab.drive import HIDDEN, VISIBLE
from groundpose.lab.metrics import RELATIVE_THRESHOLD
from groundpose.lab.training.crops import NOTHING, Crops, Records
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import keypoint_indices

Detect = Callable[[ByteArray], Detections]
"""Function from crops (N, height, width, 3) to detections: a trained torch network or an exported one."""


@dataclass(frozen=True, eq=False)
class Answers:
    """Detections of M crops and the truth.

    Attributes:
        detections: the network's output.
        labels: (M,) records. windows: (M, 4) image pixels of the crops.
        errors: (M, K) image pixels, NaN = not a keypoint of the class.
        sides: (M,) longer side of the box, image pixels. sides_in_crop: the same, crop pixels.
    """

    detections: Detections
    labels: Records
    windows: FloatArray
    errors: FloatArray
    sides: FloatArray
    sides_in_crop: FloatArray

    @property
    def good(self) -> NDArray[np.bool_]:
        """(M, K): whether the error is below 0.0375 of the box's longer side (paper, sec. 4.2.3)."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.errors <= RELATIVE_THRESHOLD * self.sides[:, None])

    def only(self, rows: NDArray[np.bool_]) -> Answers:
        """The answers of the crops in a mask (M,)."""
        chosen = {
            name: getattr(self, name)[rows] for name in self.__dataclass_fields__ if name != "detections"
        }
        names = self.detections.__dataclass_fields__
        return Answers(Detections(*(getattr(self.detections, name)[rows] for name in names)), **chosen)

    @property
    def vehicles(self) -> NDArray[np.bool_]:
        """(M,): whether there is a vehicle."""
        return np.asarray(self.labels["kind"] != NOTHING)

    def calibration(self) -> Calibration:
        """Calibration of scores to the probability of a good keypoint; fit it on a split not evaluated.

        Where nothing is there, the keypoints of the class found are all wrong.
        """
        shown = ~np.isnan(self.errors)
        found = self.detections.class_probabilities.argmax(axis=1)
        for i in np.flatnonzero(~self.vehicles):
            shown[i, keypoint_indices(CLASSES[found[i]])] = True
        return Calibration.fit(self.detections, self.sides_in_crop, self.good, shown)

    def metrics(self, calibration: Calibration | None = None) -> dict[str, float]:
        """Metrics by name: errors in pixels of the original image, fractions from 0 to 1."""
        calibration = self.calibration() if calibration is None else calibration
        scores = calibration.scores(self.detections, self.sides_in_crop)
        good, relative = self.good, self.errors / self.sides[:, None]
        named = {"": ~np.isnan(self.errors)}
        named |= {
            f"_{n}": named[""] & (self.labels["state"] == s)
            for n, s in (("visible", VISIBLE), ("hidden", HIDDEN))
        }
        numbers: dict[str, float] = {"crops": float(len(self.labels))}
        for name, chosen in named.items():
            if chosen.any():
                numbers["within" + name] = float(good[chosen].mean())
                numbers["error_px" + name] = float(self.errors[chosen].mean())
                numbers["error_share" + name] = float(relative[chosen].mean())
        own, vehicles = named[""], self.vehicles
        right = self.detections.class_probabilities.argmax(axis=1) == self.labels["kind"]
        numbers["class_accuracy"] = float(right[vehicles].mean())
        return (
            numbers | self._vehicle_or_nothing() | self._viewing_angles() | _ranking(scores[own], good[own])
        )

    def _vehicle_or_nothing(self) -> dict[str, float]:
        """Fractions of vehicles called nothing, and of boxes without one called a vehicle."""
        said, vehicles = self.detections.vehicle >= VEHICLE_THRESHOLD, self.vehicles
        numbers = {"vehicles_missed": float((~said[vehicles]).mean())}
        if not vehicles.all():
            numbers["nothing_taken"] = float(said[~vehicles].mean())
        return numbers

    def _viewing_angles(self) -> dict[str, float]:
        """Fraction of vehicles whose likeliest viewing angle is more than 90 degrees wrong; median error."""
        probabilities, alpha = self.detections.viewing_angle, self.labels["alpha"].astype(np.float64)
        known = np.isfinite(alpha) & np.isfinite(probabilities).all(axis=1)
        if not known.any():
            return {}
        found = probabilities[known].argmax(axis=1) * (2.0 * np.pi / VIEWING_ANGLES)
        error = np.abs((found - alpha[known] + np.pi) % (2.0 * np.pi) - np.pi)
        return {
            "viewing_angle_turned": float((error > 0.5 * np.pi).mean()),
            "viewing_angle_error_deg": float(np.degrees(np.median(error))),
        }


def inside_image(labels: Records) -> NDArray[np.bool_]:
    """(M,): all keypoints lie in the image."""
    points, size = labels["keypoints"], labels["image_size"][:, None]
    outside = (points < -0.5) | (points > size - 0.5)  # NaN, not a keypoint of the class: False
    return ~np.asarray(outside.any(axis=(1, 2)))


def _ranking(scores: FloatArray, good: NDArray[np.bool_]) -> dict[str, float]:
    """Metrics of the scores: how well they rank the keypoints, and how well they are calibrated."""
    order = np.argsort(-scores, kind="stable")
    ranked, count, hits = good[order], len(good), int(good.sum())
    ranks = np.arange(count, 0, -1)
    pairs = max(hits * (count - hits), 1)
    bins = np.array_split(order, 10)
    return {
        "score_auc": float((ranks[ranked].sum() - hits * (hits + 1) / 2) / pairs),
        "within_best_quartile": float(ranked[: max(count // 4, 1)].mean()),
        "within_worst_decile": float(ranked[-max(count // 10, 1) :].mean()),
        "score_calibration_error": float(
            np.mean([abs(scores[b].mean() - good[b].mean()) for b in bins if len(b)])
        ),
    }


def answers(detect: Detect, crops: Crops, codec: Codec, batch: int = 64) -> Answers:
    """Run `detect` on every crop, cut from the labels' boxes as for inference."""
    parts = list(_batches(detect, crops, codec, batch))
    detections = Detections(
        *(
            np.concatenate([getattr(p.detections, name) for p in parts])
            for name in Detections.__dataclass_fields__
        )
    )
    rest = (
        np.concatenate([getattr(p, name) for p in parts])
        for name in Answers.__dataclass_fields__
        if name != "detections"
    )
    return Answers(detections, *rest)


def _batches(detect: Detect, crops: Crops, codec: Codec, batch: int) -> Iterator[Answers]:
    from groundpose.lab.training.batches import Batcher

    batcher, rng = Batcher(codec, crops.codec), np.random.default_rng(0)
    for start in range(0, len(crops), batch):
        images, labels = crops.take(np.arange(start, min(start + batch, len(crops))))
        made = batcher(images, labels, rng)
        found = detect(made.pictures())
        points = codec.image_from_crop(found.keypoints, made.windows)
        errors = np.linalg.norm(points - labels["keypoints"].astype(np.float64), axis=2)
        boxes = labels["box"].astype(np.float64)
        sides = (boxes[:, 2:] - boxes[:, :2]).max(axis=1)
        pixel = (made.windows[:, 2] - made.windows[:, 0]) / codec.width
        yield Answers(found, labels, made.windows, errors, sides, sides / pixel)


def main(network: Path, data: Path, split: str = "test", limit: int | None = None) -> None:
    """`python -m groundpose.lab.training.evaluate NETWORK.onnx CROPS [--split test]`: metrics as JSON."""
    from groundpose.keypoints.network import Network

    loaded = Network(network)
    found = answers(loaded.detect, Crops(data, split, limit), loaded.codec)
    print(json.dumps(found.metrics(loaded.calibration), indent=1))


if __name__ == "__main__":
    import typer

    typer.run(main)
