"""`groundpose evaluate networks default=FILE.onnx ... --crops FOLDER`: docs/model.md.

Costs of every network of the table, accuracy of the trained files named, poses from them, time of an object.
What is measured already is kept unless --fresh. On a quiet machine, pinned to nothing, as times are of one
and of two threads.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose.keypoints.network import Network
from groundpose.keypoints.pipeline import Pipeline
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.networks import nothing, poses
from groundpose.lab.evaluate.networks.latency import THREADS, cost, milliseconds
from groundpose.lab.evaluate.networks.page import RESULTS, write_page
from groundpose.lab.timing import Clock
from groundpose.lab.training.configs import NETWORKS
from groundpose.lab.training.crops import Crops, Records
from groundpose.lab.training.evaluate import answers, inside_image
from groundpose.lab.training.streets import judge, streets, summary

TRIALS = 50
_TOLD = ("command", "training_seconds", "steps", "earlier_run", "data", "weights")
MOST_OCCLUDED = 0.3
"""Fraction of a vehicle that others hide, of the easier ones; the drive goes up to 0.8."""


def measure(
    root: Path, networks: list[str], crops: Path, seed: int, fresh: bool, tell: Callable[[str], None]
) -> Path:
    """Measure what is missing and write results and page; where the results are.

    `networks`: NAME=FILE of trained ones. Costs are those of every network of the table.
    """
    out = root / RESULTS
    found = {} if fresh else report.read_json(out)
    found["command"] = "groundpose evaluate networks"
    found |= {"versions": report.versions(), "machine": report.machine()}
    costs = found.setdefault("costs", {})
    for name in NETWORKS:
        if name not in costs and name != "toy":
            tell(f"cost of {name}")
            costs[name] = cost(name)
            report.write_json(out, found)
    for one in networks:
        name, _, path = one.partition("=")
        tell(f"accuracy of {name}")
        found.setdefault("trained", {})[name] = trained(Network(Path(path), 1), crops, seed)
        report.write_json(out, found)
    write_page(root, found)
    return out


def trained(network: Network, folder: Path, seed: int) -> dict[str, Any]:
    """Everything about one file."""
    held_out = Crops(folder, poses.SPLIT)
    said: dict[str, Any] = {name: network.metadata[name] for name in _TOLD if name in network.metadata}
    said["data"] = json.loads(said["data"])
    said["mb"] = network.path.stat().st_size / 1e6
    seen = answers(network.detect, held_out, network.codec)
    said["held_out"] = {
        name: seen.only(rows).metrics(network.calibration) for name, rows in groups(held_out.labels).items()
    }
    said["poses"] = {
        f"{experiment}, {boxes}": poses.measure(network, held_out, experiment, boxes, seed)
        for experiment in ("G1", "G2")
        for boxes in poses.BOXES
    }
    said["nothing"] = nothing.rates(network)
    frames = data_folder() / "kitti" / "training"
    if frames.is_dir():
        pipeline = Pipeline(network)
        said["streets"] = summary([judge(pipeline, street) for street in streets(frames)])
    said["crop_ms"] = {
        f"network alone, {n} thread{'s'[: n - 1]}": milliseconds(network.path, n) for n in THREADS
    }
    said["object_ms"] = object_times(network.path)
    return said


def groups(labels: Records) -> dict[str, NDArray[np.bool_]]:
    """Vehicles by how much of them is to be seen, as masks: each is part of the one before."""
    inside = inside_image(labels)
    return {
        "all": np.ones(len(labels), dtype=bool),
        "inside the image": inside,
        f"and at most {100 * MOST_OCCLUDED:.0f} % hidden": inside & (labels["occluded"] <= MOST_OCCLUDED),
    }


def object_times(path: Path) -> dict[str, float]:
    """Milliseconds per object, one thread, image in memory to pose and shape, by step: medians over calls."""
    from groundpose.demo import example

    street = example()
    pipeline = Pipeline(path, threads=1)
    laps: list[dict[str, float]] = []
    for _ in range(TRIALS):
        clock = Clock()
        found = clock(pipeline, street.image, street.bboxes, street.view)
        laps.append({**found.seconds, "all": clock.seconds})
    count = len(street.bboxes)
    return {name: 1e3 * float(np.median([lap[name] for lap in laps])) / count for name in laps[0]}
