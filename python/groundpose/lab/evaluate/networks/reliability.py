"""Whether keypoint scores are the probabilities they claim: inside and outside the crop, and on nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.draw.save import save_figure
from groundpose.keypoints.codec import Codec
from groundpose.keypoints.decode import Calibration
from groundpose.lab.training.evaluate import Answers
from groundpose.vehicles import CLASSES, keypoint_indices

FIGURE = Path("docs/model_reliability.png")
EDGES = np.linspace(0.0, 1.0, 11)
"""Of the bins of scores."""


def reliability(seen: Answers, codec: Codec, calibration: Calibration) -> dict[str, Any]:
    """Numbers by place of the keypoint; those of places that do not occur are left out.

    Where nothing is there, all keypoints of the class found are wrong.
    """
    scores, good = calibration.scores(seen.detections, seen.sides_in_crop), seen.good
    return {
        name: numbers(scores[chosen], good[chosen])
        for name, chosen in places(seen, codec).items()
        if chosen.any()
    }


def places(seen: Answers, codec: Codec) -> dict[str, NDArray[np.bool_]]:
    """Masks (M, K) of keypoints."""
    known = ~np.isnan(seen.errors)
    points = codec.crop_from_image(seen.labels["keypoints"].astype(np.float64), seen.windows)
    with np.errstate(invalid="ignore"):
        inside = ((points >= -0.5) & (points <= np.array([codec.width, codec.height]) - 0.5)).all(axis=2)
    nothing = np.zeros_like(known)
    found = seen.detections.class_probabilities.argmax(axis=1)
    for i in np.flatnonzero(~seen.vehicles):
        nothing[i, keypoint_indices(CLASSES[found[i]])] = True
    return {
        "inside the crop": known & inside,
        "outside the crop": known & ~inside,
        "nothing there": nothing,
        "all": known | nothing,
    }


def numbers(scores: FloatArray, good: NDArray[np.bool_]) -> dict[str, Any]:
    """Their calibration: `bins` holds mean score, fraction of good keypoints and number of each bin of
    scores; `calibration_error` is the mean distance of the first two over all keypoints."""
    bins = np.digitize(scores, EDGES[1:-1])
    rows = [
        [float(scores[bins == b].mean()), float(good[bins == b].mean()), int((bins == b).sum())]
        for b in np.unique(bins)
    ]
    return {
        "keypoints": len(scores),
        "mean_score": float(scores.mean()),
        "good": float(good.mean()),
        "calibration_error": sum(abs(score - hit) * count for score, hit, count in rows) / len(scores),
        "bins": rows,
    }


def draw(root: Path, trained: dict[str, Any]) -> None:
    """The figure of the networks that were measured, one panel for each place; none where none was."""
    measured = {name: one["reliability"] for name, one in trained.items() if "reliability" in one}
    if not measured:
        return
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(place for one in measured.values() for place in one))
    figure = Figure(figsize=(3.2 * len(names), 3.4), layout="constrained")
    for axes, place in zip(figure.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        axes.plot([0, 1], [0, 1], color="0.7", linewidth=1.0)
        for name, one in measured.items():
            if place in one:
                scores, good, _ = zip(*one[place]["bins"], strict=True)
                axes.plot(scores, good, marker="o", markersize=4, label=name)
        axes.set_title(place, fontsize=10, loc="left")
        axes.set_xlabel("mean score")
        axes.set_ylabel("fraction within 0.0375 l" if place == names[0] else "")
        axes.grid(visible=True, linewidth=0.4, alpha=0.5)
    figure.axes[0].legend(fontsize=8)
    save_figure(figure, root / FIGURE, 90, metadata={"Software": None})
