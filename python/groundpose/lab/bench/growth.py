"""How time and memory grow with objects, keypoints and images: `python -m groundpose.lab.bench.growth`.

Every size is measured in a process of its own, so that memory is what the system says of it. Writes
results/growth.json, and from it docs/growth.png and the tables of docs/growth.md.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

import groundpose as gp
from groundpose._writing import whole_file
from groundpose.lab.bench import growth_figure, growth_images, growth_page
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.scenes import generate

OBJECTS = (1, 10, 100, 1_000, 10_000, 100_000, 1_000_000)
KEYPOINTS = (8, 14, 28, 66, 300, 1000)
THREADS = (1, 2)
DISTINCT = 1000
"""Different objects; larger batches repeat them."""
SECONDS = 2.0
"""Short calls are repeated for so long; the fastest counts."""


def scenes(objects: int, keypoints: int | None) -> Objects:
    """V1's vehicles, or objects of one number of keypoints."""
    distinct = min(objects, DISTINCT)
    if keypoints is None:
        return generate("vehicle", distinct, seed=0)
    return generate("cube", distinct, seed=0, n_points=keypoints, outlier_ratio=0.25)


def measured(objects: int, keypoints: int | None, threads: int, single: bool = False) -> dict[str, Any]:
    """Microseconds and bytes per object of one call; bytes beyond what was given, before and after all fields
    were asked for. `single`: of keypoints that single precision holds."""
    found = scenes(objects, keypoints)
    rows = np.arange(objects) % len(found.models)
    points, boxes = found.keypoints_2d[rows], found.bboxes[rows]
    if single:
        points = points.astype(np.float32).astype(float)
    models = tuple(found.models[k] for k in rows.tolist())

    def call() -> gp.PoseBatch:
        return gp.estimate_poses(found.view, points, boxes, models, threads=threads)

    gp.estimate_poses(found.view, points[:20], boxes[:20], models[:20], threads=threads)
    before, fastest, began = _resident(), np.inf, time.monotonic()
    while True:
        start = time.monotonic()
        poses = call()
        fastest = min(fastest, time.monotonic() - start)
        if time.monotonic() - began > SECONDS:
            break
        del poses
    held = _resident() - before
    vars(poses)
    return {
        "scene": "cube" if keypoints else "vehicle",
        "objects": objects,
        "keypoints": points.shape[1],
        "threads": threads,
        "single precision": single,
        "us per object": 1e6 * fastest / objects,
        "bytes per object": held / objects,
        "bytes per object, all fields": (_resident() - before) / objects,
    }


def _resident() -> int:
    """Bytes of this process in memory."""
    text = Path("/proc/self/status").read_text(encoding="ascii")
    return 1024 * int(next(line.split()[1] for line in text.splitlines() if line.startswith("VmRSS")))


Size = tuple[int, int | None, int, bool]


def sizes(quick: bool) -> list[Size]:
    """Objects, keypoints (None: V1's vehicles), threads of each measurement, and whether single precision
    holds the keypoints."""
    counts = OBJECTS[:4] if quick else OBJECTS
    widths = KEYPOINTS[:2] if quick else KEYPOINTS
    found: list[Size] = [(n, None, threads, False) for n in counts for threads in THREADS]
    found += [(100 if quick else 1000, p, 1, False) for p in widths]
    return [*found, (counts[-2], None, 1, True)]


def image_sizes(quick: bool) -> list[tuple[int, int]]:
    """Images and threads of each measurement."""
    counts = growth_images.IMAGES[:2] if quick else growth_images.IMAGES
    return [(count, threads) for count in counts for threads in THREADS]


def main() -> None:
    """Measure, and write one file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few objects: whether it runs")
    parser.add_argument("-o", "--out", type=Path, default=Path("results/growth.json"))
    parser.add_argument("--figure", type=Path, help="default: beside --out")
    parser.add_argument("--page", type=Path, help="page whose tables are made anew")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.one:
        print(json.dumps(measured(*json.loads(asked.one))))
        return
    content: dict[str, Any] = {"machine": report.machine(), "versions": report.versions()}
    content["load at the beginning"] = round(os.getloadavg()[0], 1)
    content["rows"] = [_in_a_process(size) for size in track(sizes(asked.quick), "objects", transient=True)]
    _store(asked.out, content)
    several = track(image_sizes(asked.quick), "images", transient=True)
    content["images"] = [growth_images.measured(*size) for size in several]
    _store(asked.out, content)
    print(f"{len(content['rows']) + len(content['images'])} sizes: {asked.out.resolve()}")
    figure = asked.out.with_suffix(".png") if asked.figure is None else asked.figure
    limits = growth_page.limits(content, report.read_json(growth_page.BENCH))
    growth_figure.write(content, limits, figure)
    print(f"figure: {figure.resolve()}")
    if asked.page is not None:
        growth_page.write_page(asked.page, content, report.read_json(growth_page.BENCH))
        print(f"tables: {asked.page.resolve()}")


def _store(path: Path, content: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path, "w") as file:
        json.dump(content, file, indent=1)


def _in_a_process(size: Size) -> dict[str, Any]:
    command = [sys.executable, "-m", "groundpose.lab.bench.growth", "--one", json.dumps(size)]
    found: dict[str, Any] = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    return found


if __name__ == "__main__":
    main()
