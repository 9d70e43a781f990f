"""`groundpose evaluate networks default=FILE.onnx ... --crops FOLDER`: docs/model.md.

Costs of every network of the table; of the trained files named, each of `PARTS`. Renders of chosen vehicles
are kept in `FOLDER/evaluated`. Times want a quiet machine, pinned to nothing, as they are of one and of two
threads.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import input_error
from groundpose.keypoints.network import Network
from groundpose.keypoints.pipeline import Pipeline
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.networks import nothing, poses, real_streets, sweeps
from groundpose.lab.evaluate.networks.judged import judge
from groundpose.lab.evaluate.networks.latency import THREADS, cost, milliseconds
from groundpose.lab.evaluate.networks.page import RESULTS, write_page
from groundpose.lab.evaluate.networks.reliability import reliability
from groundpose.lab.evaluate.networks.renders import ROAD_SIDE, SMALL, moved, renders
from groundpose.lab.timing import Clock
from groundpose.lab.training.configs import NETWORKS
from groundpose.lab.training.crops import Crops, Records
from groundpose.lab.training.evaluate import answers, inside_image

TRIALS, SMALL_LOOKS = 50, 6
_TOLD = ("command", "training_seconds", "steps", "earlier_run", "data", "weights")
_WHEELS, _OF_THIS_MACHINE = Path("target/wheels"), "-linux_"
"""Where `make wheel` puts a release's; an editable installation leaves one there that holds nothing."""
MOST_OCCLUDED = 0.3
"""Fraction of a vehicle that others hide, of the easier ones; the drive goes up to 0.8."""


@dataclass(frozen=True, eq=False)
class Context:
    """One network, the folder of crops, the seed of detected boxes, where progress is told."""

    network: Network
    crops: Path
    seed: int
    tell: Callable[[str], None]


def measure(
    root: Path,
    networks: list[str],
    crops: Path,
    seed: int,
    fresh: bool,
    tell: Callable[[str], None],
    only: str = "",
) -> Path:
    """Measure and write results and page; where the results are.

    `networks`: NAME=FILE of trained ones. Costs are those of every network of the table, measured once.
    `only`: names of `PARTS`, comma separated; "": all. Other parts keep what is stored of the same file.

    Raises:
        InputError: an unknown part.
    """
    parts = [name for name in only.split(",") if name] or list(PARTS)
    if unknown := set(parts) - set(PARTS):
        raise input_error("only", f"some of {', '.join(PARTS)}", ", ".join(sorted(unknown)))
    out = root / RESULTS
    found = {} if fresh else report.read_json(out)
    found["command"] = "groundpose evaluate networks"
    found |= {"versions": report.versions(), "machine": report.machine()}
    wheels = [path for path in (root / _WHEELS).glob("*.whl") if _OF_THIS_MACHINE not in path.name]
    if wheels:
        found["wheel_mb"] = max(wheels, key=lambda path: path.stat().st_mtime).stat().st_size / 1e6
    costs = found.setdefault("costs", {})
    for name in NETWORKS:
        if name not in costs and name != "toy" and "times" in parts:
            tell(f"cost of {name}")
            costs[name] = cost(name)
            report.write_json(out, found)
    for one in networks:
        name, _, path = one.partition("=")
        network = Network(Path(path), 1)
        said = _same_file(found.setdefault("trained", {}).get(name, {}), network.path)
        found["trained"][name] = said
        said |= _told(network)
        for part in parts:
            tell(f"{name}: {part}")
            said |= PARTS[part](Context(network, crops, seed, tell))
            report.write_json(out, found)
    report.write_json(out, found)
    write_page(root, found)
    return out


def _same_file(stored: dict[str, Any], path: Path) -> dict[str, Any]:
    """What is stored of this file; nothing when it is of another file."""
    sha = hashlib.sha256(path.read_bytes()).hexdigest()
    return {**(stored if stored.get("sha256", sha) == sha else {}), "sha256": sha}


def _told(network: Network) -> dict[str, Any]:
    """What the file says of itself."""
    said: dict[str, Any] = {name: network.metadata[name] for name in _TOLD if name in network.metadata}
    said["data"] = json.loads(said["data"])
    said["mb"] = network.path.stat().st_size / 1e6
    return said


def _held_out(context: Context) -> dict[str, Any]:
    network, held_out = context.network, Crops(context.crops, poses.SPLIT)
    seen = answers(network.detect, held_out, network.codec)
    rows = groups(held_out.labels)
    return {
        "held_out": {name: seen.only(mask).metrics(network.calibration) for name, mask in rows.items()},
        "reliability": reliability(seen, network.codec, network.calibration),
    }


def _poses(context: Context) -> dict[str, Any]:
    held_out = Crops(context.crops, poses.SPLIT)
    return {
        "poses": {
            f"{experiment}, {boxes}": poses.measure(
                context.network, held_out, experiment, boxes, context.seed
            )
            for experiment in ("G1", "G2")
            for boxes in poses.BOXES
        }
    }


def _streets(context: Context) -> dict[str, Any]:
    frames = data_folder() / "kitti" / "training"
    return real_streets.measure(context.network, frames) if frames.is_dir() else {}


def _square_on(context: Context) -> dict[str, Any]:
    seen = judge(context.network, moved(renders(context.crops, SMALL, context.tell), SMALL_LOOKS))
    return {"square_on": seen.numbers() | seen.turned()}


def _road_side(context: Context) -> dict[str, Any]:
    places = {place: renders(context.crops, f"road side, {place}", context.tell) for place in ROAD_SIDE}
    return {"road_side": {place: judge(context.network, seen).numbers() for place, seen in places.items()}}


def _times(context: Context) -> dict[str, Any]:
    path = context.network.path
    alone = {f"network alone, {n} thread{'s'[: n - 1]}": milliseconds(path, n) for n in THREADS}
    return {"crop_ms": alone, "object_ms": object_times(path)}


PARTS: dict[str, Callable[[Context], dict[str, Any]]] = {
    "held-out": _held_out,
    "poses": _poses,
    "nothing": lambda context: {"nothing": nothing.rates(context.network)},
    "streets": _streets,
    "square-on": _square_on,
    "road-side": _road_side,
    "sweeps": lambda context: {"sweeps": sweeps.measure(context.network, context.crops, context.tell)},
    "times": _times,
}
"""Everything that is measured of a network, by the names that `--only` takes."""


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
