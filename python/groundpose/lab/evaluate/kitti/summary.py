"""From finished frames to tables: by difficulty as the paper's Table 3, by class, distance, truncation and
tilt."""

from __future__ import annotations

import heapq
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from groundpose._checks import FloatArray
from groundpose.formats.kitti.dataset import DIFFICULTIES
from groundpose.formats.skips import Skips
from groundpose.lab.contenders.registry import by_option
from groundpose.lab.evaluate.kitti.average_precision import Hits, average_precision
from groundpose.lab.evaluate.kitti.frame import ERROR_COLUMNS, LABEL_COLUMNS, Task
from groundpose.lab.evaluate.kitti.store import Line
from groundpose.lab.metrics import FAR_OFF_E_R_DEG, NO_ANSWER_E_R_DEG, failed, percentage

Mask = npt.NDArray[np.bool_]
Group = dict[str, Any]
WORST, WORST_SILENT = 24, 6
"""Objects shown in a report, and how many of them may be without an answer."""
SELF_CHECK = "truth"
"""The name under which the labels stand among the methods."""
REVERSED_DEG = 30.0
FAR_PERCENT = 10.0
EDGES: dict[str, tuple[str, tuple[float, ...]]] = {
    "distance": ("distance_m", (0.0, 10.0, 20.0, 30.0, 45.0, 60.0, np.inf)),
    "truncation": ("truncated", (-1.5, 0.001, 0.15, 0.5, 1.1)),
    "occlusion": ("occluded", (-0.5, 0.5, 1.5, 2.5, 3.5)),
    "tilt": ("tilt_deg", (-np.inf, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, np.inf)),
}
"""Groups: their name, the column, where one ends and the next begins."""
_UNITS = {"distance": " m", "truncation": "", "occlusion": "", "tilt": " deg"}
_OCCLUSIONS = ("fully visible", "partly occluded", "largely occluded", "unknown")


@dataclass
class Collected:
    """Everything of a run that its tables need: numbers in compact arrays, some 400 bytes per object and
    method."""

    task: Task
    labels: array[float] = field(default_factory=lambda: array("f"))
    errors: dict[str, array[float]] = field(default_factory=dict)
    hits: dict[str, dict[str, Hits]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    keypoint_seconds: float = 0.0
    frames: int = 0
    left_out: int = 0
    boxes: int = 0
    missed: int = 0
    skipped: Skips = field(default_factory=Skips)
    worst: list[tuple[float, str, int]] = field(default_factory=list)
    """`(e_r of the first method, frame, object)` of answers, the worst first."""
    silent: list[tuple[str, int]] = field(default_factory=list)
    """`(frame, object)`: the first ones without an answer."""

    def table(self, name: str) -> FloatArray:
        """(N, columns) errors of a method."""
        return np.array(self.errors.get(name, ()), dtype=float).reshape(-1, len(ERROR_COLUMNS))

    @property
    def objects(self) -> FloatArray:
        """(N, columns) of the labels."""
        return np.array(self.labels, dtype=float).reshape(-1, len(LABEL_COLUMNS))


def collect(lines: Iterable[Line], task: Task, split: Skips) -> Collected:
    """Go through the frames once; `split`: what was left out before the first one."""
    found = Collected(task)
    found.skipped.merge(split)
    for line in lines:
        found.skipped.merge(line.skipped)
        if line.result is None:
            found.left_out += 1
            continue
        result = line.result
        found.frames += 1
        found.boxes += result.boxes
        found.missed += result.missed
        found.keypoint_seconds += result.keypoint_seconds
        for row in result.labels:
            found.labels.extend(row)
        for name, rows in result.errors.items():
            for errors in rows:
                found.errors.setdefault(name, array("f")).extend(errors)
        for name, seconds in result.seconds.items():
            found.seconds[name] = found.seconds.get(name, 0.0) + seconds
        for name, by_class in result.hits.items():
            for class_name, hits in by_class.items():
                found.hits.setdefault(name, {}).setdefault(class_name, Hits()).add(hits)
        _keep_worst(found, line)
    found.worst.sort(key=lambda x: (-x[0], x[1], x[2]))
    return found


def _keep_worst(found: Collected, line: Line) -> None:
    assert line.result is not None
    rows = zip(line.result.labels, line.result.errors.get(found.task.methods[0], ()), strict=True)
    for k, (label, errors) in enumerate(rows):
        if label[LABEL_COLUMNS.index("level")] >= len(DIFFICULTIES):
            continue
        if np.isnan(errors[0]):
            found.silent += [(line.id, k)] if len(found.silent) < WORST_SILENT else []
            continue
        push = heapq.heappush if len(found.worst) < WORST else heapq.heappushpop
        push(found.worst, (errors[0], line.id, k))


def _worst(found: Collected) -> list[dict[str, Any]]:
    """The worst answers, and at last some objects without one."""
    answers = found.worst[: WORST - len(found.silent)]
    rows: list[dict[str, Any]] = [{"frame": name, "object": k, "e_r deg": e} for e, name, k in answers]
    return rows + [{"frame": name, "object": k, "e_r deg": None} for name, k in found.silent]


def summary(found: Collected) -> dict[str, Any]:
    """All tables, as JSON has them."""
    counts = {"done": found.frames, "left out": found.left_out}
    return {
        "frames": counts,
        "boxes": found.boxes,
        "objects": len(found.objects),
        "missed objects": found.missed,
        "skipped": found.skipped.record(),
        "keypoints, us per box": 1e6 * found.keypoint_seconds / max(found.boxes, 1),
        "self-check": {
            class_name: average_precision(h)
            for class_name, h in found.hits.get(SELF_CHECK, {}).items()
            if h.objects[-1]
        },
        "methods": [_method(found, name) for name in found.task.methods],
        "worst": _worst(found),
    }


def _method(found: Collected, name: str) -> dict[str, Any]:
    objects, errors = found.objects, found.table(name)
    level = objects[:, LABEL_COLUMNS.index("level")]
    classes = objects[:, LABEL_COLUMNS.index("kind")]
    counted = level < len(DIFFICULTIES)
    by_difficulty = [group(word, errors[level <= k]) for k, word in enumerate(DIFFICULTIES)]
    return {
        "option": name,
        "method": by_option("kitti")[name].name,
        "us per object": 1e6 * found.seconds.get(name, 0.0) / max(found.boxes, 1),
        "by difficulty": [*by_difficulty, group("all labels", errors)],
        "by class": [
            group(class_name, errors[counted & (classes == k)])
            for k, class_name in enumerate(found.task.classes)
        ],
        **{f"by {what}": _groups(what, objects[counted], errors[counted]) for what in EDGES},
        "average precision": {
            class_name: average_precision(hits) for class_name, hits in found.hits.get(name, {}).items()
        },
    }


def _groups(what: str, objects: FloatArray, errors: FloatArray) -> list[Group]:
    column, edges = EDGES[what]
    values = objects[:, LABEL_COLUMNS.index(column)]
    return [
        group(word, errors[inside]) | {"from": low, "to": high}
        for word, low, high, inside in _ranges(what, edges, values)
        if inside.any()
    ]


def _ranges(
    what: str, edges: tuple[float, ...], values: FloatArray
) -> Iterator[tuple[str, float | None, float | None, Mask]]:
    for k, (low, high) in enumerate(pairwise(edges)):
        first, last = (edge if np.isfinite(edge) else None for edge in (low, high))
        if what == "occlusion":
            word = _OCCLUSIONS[k]
        elif what == "truncation":
            word = "none" if k == 0 else f"{max(low, 0.0):.2g} to {min(high, 1.0):.2g}"
        elif first is None or last is None:
            word = f"below {last:g}" if first is None else f"from {first:g}"
        else:
            word = f"{first:g} to {last:g}"
        yield word + _UNITS[what], first, last, (values >= low) & (values < high)


def group(name: str, errors: FloatArray) -> Group:
    """Errors of one group of objects. No answer counts as 180 deg in medians and percentages; means are of
    answers. A failure: e_r above 10 deg or e_t above 10 % or no answer."""
    e = dict(zip(ERROR_COLUMNS, errors.T, strict=True))
    silent = np.isnan(e["e_r_deg"])
    distance = np.abs(e["distance_percent"][~silent])
    held = distance <= e["distance_interval_percent"][~silent]
    stated = np.isfinite(e["distance_interval_percent"][~silent])
    e_r, yaw = (np.where(silent, NO_ANSWER_E_R_DEG, e[key]) for key in ("e_r_deg", "yaw_deg"))
    return {
        "group": name,
        "objects": len(silent),
        "no answer %": percentage(silent),
        "mean e_r deg": _mean(e["e_r_deg"]),
        "mean e_a deg": _mean(e["e_a_deg"]),
        "failures %": percentage(failed(e["e_r_deg"], e["e_t_percent"])),
        "median e_r deg": _median(e_r),
        "e_r above 15 deg %": percentage(e_r > FAR_OFF_E_R_DEG),
        "median yaw error deg": _median(yaw),
        "yaw above 15 deg %": percentage(yaw > FAR_OFF_E_R_DEG),
        "yaw above 30 deg %": percentage(yaw > REVERSED_DEG),
        "orientation similarity": _mean(np.where(silent, 0.0, (1.0 + np.cos(np.radians(yaw))) / 2.0)),
        "median depth error %": _median(e["depth_percent"]),
        "median depth error on the ground %": _median(e["depth_ground_percent"]),
        "median distance error %": _median(distance),
        "distance bias %": _median(e["distance_percent"]),
        "distance beyond 10 %": percentage(distance > FAR_PERCENT),
        "95 % interval of distance holds %": percentage(held[stated]),
        "mean overlap in space": _mean(np.nan_to_num(e["iou_3d"])),
    }


def _mean(values: FloatArray) -> float | None:
    values = values[np.isfinite(values)]
    return float(values.mean()) if len(values) else None


def _median(values: FloatArray) -> float | None:
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) else None
