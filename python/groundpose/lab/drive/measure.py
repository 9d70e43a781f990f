"""Statistics of the virtual drive: `python -m groundpose.lab.drive.measure` writes results/simulation.json.

Measures how many objects per second are labelled without pictures (including the time to make the bodies)
and the distributions of the labels.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose._writing import write_text
from groundpose.lab.drive.drive import scene
from groundpose.lab.drive.ego import FRAMES_PER_DRIVE
from groundpose.lab.drive.labels import VISIBLE, labels
from groundpose.lab.drive.splits import SPLITS, scene_seed
from groundpose.lab.processes import worker_pool

OUT = Path("results/simulation.json")
PERCENTILES = (5, 25, 50, 75, 95)
# Columns of a labelled object.
_OBJECT = (
    "depth",
    "truncation",
    "occlusion",
    "occluded_share",
    "plane_pitch",
    "plane_roll",
    "visible_keypoints",
)


def drive_numbers(seed: int, drive: int) -> tuple[list[tuple[float, ...]], FloatArray, Counter[str], float]:
    """Of one drive: a row (see `_OBJECT`) per labelled object, pitch and roll per frame, counts of names, and
    the seconds of processor time."""
    start = time.process_time()
    rows: list[tuple[float, ...]] = []
    tilt, names = [], Counter[str]()
    for number in range(drive * FRAMES_PER_DRIVE, (drive + 1) * FRAMES_PER_DRIVE):
        frame = scene(seed, number)
        tilt.append((frame.pitch, frame.roll))
        names[f"road {frame.road.layout.kind}"] += 1
        names[f"light {frame.light.kind}"] += 1
        for label in labels(frame):
            names.update([f"class {label.class_name}", f"style {label.style}", f"state {label.state}"])
            visible = float(np.count_nonzero(label.keypoint_states == VISIBLE))
            fractions = (label.truncation, label.occlusion, label.occluded_share)
            rows.append((float(label.location[2]), *fractions, label.plane_pitch, label.plane_roll, visible))
    return rows, np.array(tilt), names, time.process_time() - start


def measure(objects: int, seed: int, split: str, jobs: int) -> dict[str, Any]:
    """Drives until `objects` are labelled."""
    rows: list[tuple[float, ...]] = []
    tilt, names, drives, busy = [], Counter[str](), 0, 0.0
    start = time.perf_counter()
    with worker_pool(jobs) as pool:
        while len(rows) < objects:
            block = range(drives, drives + 4 * jobs)
            for found in pool.map(drive_numbers, [scene_seed(seed, split)] * len(block), block):
                rows += found[0]
                tilt.append(found[1])
                names += found[2]
                busy += found[3]
            drives = block.stop
    seconds = time.perf_counter() - start
    table = dict(zip(_OBJECT, np.array(rows).T, strict=True))
    speed = {
        "jobs": jobs,
        "seconds": round(seconds, 1),
        "objects_per_second": round(len(rows) / seconds, 1),
        "processor_seconds": round(busy, 1),
        "objects_per_processor_second": round(len(rows) / busy, 1),
    }
    return {
        "seed": seed,
        "split": split,
        "frames": drives * FRAMES_PER_DRIVE,
        "objects": len(rows),
        **speed,
        **_distributions(table, np.degrees(np.array(tilt)), names),
    }


def _distributions(table: dict[str, FloatArray], tilt: FloatArray, names: Counter[str]) -> dict[str, Any]:
    """Distances, tilt in degrees (drives, frames, 2), truncation, occlusion, fractions of names."""
    depth = np.percentile(table["depth"], PERCENTILES)
    truncated, level = table["truncation"], table["occlusion"]
    plane = np.degrees([table["plane_pitch"], table["plane_roll"]])
    return {
        "objects_per_frame": _number(len(level) / (tilt.shape[0] * tilt.shape[1])),
        "depth_percentiles_m": {str(p): round(float(d), 1) for p, d in zip(PERCENTILES, depth, strict=True)},
        "tilt_std_deg": {
            "pitch": _number(tilt[..., 0].std()),
            "roll": _number(tilt[..., 1].std()),
            "pitch_within_drive": _number(tilt[..., 0].std(axis=1).mean()),
            "roll_within_drive": _number(tilt[..., 1].std(axis=1).mean()),
            "pitch_against_plane_of_vehicle": _number(plane[0].std()),
            "roll_against_plane_of_vehicle": _number(plane[1].std()),
        },
        "truncation_shares": {
            "none": _number(np.mean(truncated < 0.005)),
            "up to 0.5": _number(np.mean((truncated >= 0.005) & (truncated < 0.5))),
            "above": _number(np.mean(truncated >= 0.5)),
        },
        "occlusion_level_shares": {str(n): _number(np.mean(level == n)) for n in range(4)},
        "visible_keypoints_mean": _number(table["visible_keypoints"].mean()),
        **{
            f"{group}_fractions": _fractions(names, group)
            for group in ("class", "style", "state", "road", "light")
        },
    }


def _number(value: Any) -> float:
    return round(float(value), 3)


def _fractions(names: Counter[str], group: str) -> dict[str, float]:
    found = {name.split(maxsplit=1)[1]: n for name, n in names.items() if name.startswith(f"{group} ")}
    total = sum(found.values())
    return {name: _number(n / total) for name, n in sorted(found.items(), key=lambda item: -item[1])}


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--objects", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--split", choices=SPLITS, default="train")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    result = measure(given.objects, given.seed, given.split, given.jobs)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    write_text(given.out, json.dumps(result, indent=1) + "\n")
    print(f"{result['objects']} objects, {result['objects_per_second']} a second: {given.out}")


if __name__ == "__main__":
    main()
