"""Identities over time: switches, MOTA and HOTA of what was said of each sighted vehicle, by TrackEval."""

from __future__ import annotations

from typing import Any

import numpy as np

from groundpose._checks import input_error
from groundpose.lab.evaluate.kitti.overlap import image_overlap
from groundpose.lab.evaluate.tracks.errors import Said
from groundpose.lab.evaluate.tracks.sequence import Sequence


def identity(pairs: list[tuple[Said, Sequence]]) -> dict[str, float | int]:
    """Of all sequences together. Raises InputError without TrackEval."""
    try:
        from trackeval.metrics import CLEAR, HOTA
    except ModuleNotFoundError:
        raise input_error("evaluate tracks", "trackeval (pip install 'groundpose[tracks]')", "none") from None
    data = {str(k): compared(said, sequence) for k, (said, sequence) in enumerate(pairs)}
    found: dict[str, Any] = {}
    for metric in (HOTA(), CLEAR({"PRINT_CONFIG": False})):
        found |= metric.combine_sequences({name: metric.eval_sequence(each) for name, each in data.items()})
    switches = sum(switches_of(said, sequence) for said, sequence in pairs)
    vehicles = sum(len({v for f in s.frames for v in f.vehicle.tolist()}) for _, s in pairs)
    return {
        "vehicles": vehicles,
        "identity switches": switches,
        "identity switches per 100 vehicles": 100.0 * switches / vehicles,
        "MOTA %": 100.0 * float(found["MOTA"]),
        "HOTA %": 100.0 * float(np.mean(found["HOTA"])),
    }


def compared(said: Said, sequence: Sequence) -> dict[str, Any]:
    """What TrackEval takes: detected boxes with the vehicles' numbers, labelled boxes, their overlaps."""
    true_ids, said_ids, overlaps = [], [], []
    for number, frame in enumerate(sequence.frames):
        rows = np.flatnonzero(said.frame == number)
        true_ids.append(frame.truth.id)
        said_ids.append(said.id[rows])
        overlaps.append(image_overlap(frame.truth.bbox, frame.poses.bboxes[said.index[rows]]))
    true, own = (
        np.unique(np.concatenate(ids), return_inverse=True)[1] if ids else np.array([], int)
        for ids in (true_ids, said_ids)
    )
    return {
        "gt_ids": _split(true, true_ids),
        "tracker_ids": _split(own, said_ids),
        "similarity_scores": overlaps,
        "num_gt_dets": len(true),
        "num_tracker_dets": len(own),
        "num_gt_ids": int(true.max(initial=-1)) + 1,
        "num_tracker_ids": int(own.max(initial=-1)) + 1,
        "num_timesteps": len(true_ids),
    }


def _split(flat: Any, like: list[Any]) -> list[Any]:
    """One array per frame."""
    return list(np.split(flat, np.cumsum([len(ids) for ids in like])[:-1]))


def switches_of(said: Said, sequence: Sequence) -> int:
    """How often a vehicle gets another number than when it was last seen, by the detections' own labels."""
    last: dict[int, int] = {}
    count = 0
    for k in np.lexsort((said.index, said.frame)).tolist():
        vehicle = int(sequence.frames[said.frame[k]].vehicle[said.index[k]])
        number = int(said.id[k])
        count += vehicle in last and last[vehicle] != number
        last[vehicle] = number
    return count
