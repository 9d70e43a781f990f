"""Identities over time: switches, MOTA and HOTA of what was said of each sighted vehicle, by motmetrics."""

from __future__ import annotations

from typing import Any

import numpy as np

from groundpose._checks import input_error
from groundpose.lab.evaluate.kitti.overlap import image_overlap
from groundpose.lab.evaluate.tracks.errors import Said
from groundpose.lab.evaluate.tracks.sequence import Sequence

_OVERLAP = 0.5
"""Of 2D boxes, for MOTA."""
_HOTA = np.arange(0.05, 0.96, 0.05)


def identity(pairs: list[tuple[Said, Sequence]]) -> dict[str, float | int]:
    """Of all sequences together. Raises InputError without motmetrics."""
    try:
        import motmetrics as mm
    except ModuleNotFoundError:
        raise input_error(
            "evaluate tracks", "motmetrics (pip install 'groundpose[tracks]')", "none"
        ) from None
    metrics = mm.metrics.create()
    plain = [accumulated(mm, said, sequence, _OVERLAP) for said, sequence in pairs]
    names = [sequence.name for _, sequence in pairs]
    found = metrics.compute_many(plain, ["num_switches", "mota", "idf1", "num_unique_objects"], names, True)
    row = found.loc["OVERALL"]
    hota = [_hota(mm, metrics, pairs, names, float(alpha)) for alpha in _HOTA]
    switches = sum(switches_of(said, sequence) for said, sequence in pairs)
    vehicles = sum(len({v for f in s.frames for v in f.vehicle.tolist()}) for _, s in pairs)
    return {
        "vehicles": vehicles,
        "identity switches": switches,
        "identity switches per 100 vehicles": 100.0 * switches / vehicles,
        "MOTA %": 100.0 * float(row["mota"]),
        "IDF1 %": 100.0 * float(row["idf1"]),
        "HOTA %": 100.0 * float(np.mean(hota)),
    }


def _hota(mm: Any, metrics: Any, pairs: list[tuple[Said, Sequence]], names: list[str], alpha: float) -> float:
    accumulators = [accumulated(mm, said, sequence, alpha) for said, sequence in pairs]
    found = metrics.compute_many(accumulators, ["hota_alpha"], names, True)
    return float(found.loc["OVERALL", "hota_alpha"])


def accumulated(mm: Any, said: Said, sequence: Sequence, least: float) -> Any:
    """Hypotheses are the detected boxes with the vehicles' numbers, truth the labelled boxes."""
    found = mm.MOTAccumulator(auto_id=True)
    for number, frame in enumerate(sequence.frames):
        rows = np.flatnonzero(said.frame == number)
        boxes = frame.poses.bboxes[said.index[rows]]
        overlap = image_overlap(frame.truth.bbox, boxes)
        distance = np.where(overlap >= least, 1.0 - overlap, np.nan)
        found.update(frame.truth.id.tolist(), said.id[rows].tolist(), distance)
    return found


def switches_of(said: Said, sequence: Sequence) -> int:
    """How often a vehicle gets another number than when it was last seen: the detections' own labels, no
    boxes."""
    last: dict[int, int] = {}
    count = 0
    for k in np.lexsort((said.index, said.frame)).tolist():
        vehicle = int(sequence.frames[said.frame[k]].vehicle[said.index[k]])
        number = int(said.id[k])
        count += vehicle in last and last[vehicle] != number
        last[vehicle] = number
    return count
