"""From pictures to poses: `python -m groundpose.lab.evaluate.image_path` writes results/image_path.json.

Milliseconds per vehicle of an image with eight in it, on one core and by step, and `groundpose estimate` of a
folder of JPEG files with eight vehicles each, on two cores. Every number is the least of several rounds, in
which all take turns: what else the machine does only ever adds. With `--beside FOLDER` the package of another
checkout, built there, takes part.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import groundpose
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.kill_inputs import pictures
from groundpose.lab.evaluate.load import run_once

OUT = Path("results/image_path.json")
NETWORKS = ("default", "int8")
CORES = 2
CALLS, IMAGES, ROUNDS = 40, 200, 5
_VEHICLES = """
import json, sys, time
import numpy as np
from PIL import Image
import groundpose as gp
from groundpose.demo.street import IMAGE, LABELS
content = json.loads(LABELS.read_text(encoding="utf-8"))
boxes = np.array([item["bbox"] for item in content["objects"]])
view = gp.View(gp.Camera(*(content["camera"][name] for name in ("fx", "fy", "cx", "cy"))))
with Image.open(IMAGE) as street:
    image = np.asarray(street.convert("RGB"))
pipeline, least = gp.Pipeline(sys.argv[1], threads=1), {}
for _ in range(int(sys.argv[2])):
    start = time.thread_time()
    poses = pipeline(image, boxes, view)
    took = {"all": time.thread_time() - start, **poses.seconds}
    least = {step: min(seconds, least.get(step, seconds)) for step, seconds in took.items()}
print(json.dumps({step: round(1e3 * seconds / len(boxes), 4) for step, seconds in least.items()}))
"""
_COMMAND = """
import runpy, sys
if not int(sys.argv.pop(1)):
    sys.modules["simplejpeg"] = None
runpy.run_module("groundpose.cli", run_name="__main__", alter_sys=True)
"""
_STATED = ("seconds", "processor_seconds", "most_megabytes")


def of_vehicles(network: str, checkouts: dict[str, Path], rounds: int) -> dict[str, dict[str, float]]:
    """Milliseconds per vehicle of a warm call in each checkout: processor time of all, time of each step."""
    arguments = ["-c", _VEHICLES, network, str(CALLS)]
    return _least(
        {name: (arguments, checkout) for name, checkout in checkouts.items()}, rounds, leave_out=_STATED
    )


def of_folder(
    network: str, checkouts: dict[str, Path], rounds: int, count: int
) -> dict[str, dict[str, float]]:
    """Seconds of the command for `count` pictures, with the extra `jpeg` too where it is installed."""
    asked = ["estimate", "images", "--boxes", "boxes", "--calib", "camera.json", "--network", network]
    asked += ["-o", "poses.jsonl", "--no-pictures"]
    runs = {name: (["-c", _COMMAND, "0", *asked], checkout) for name, checkout in checkouts.items()}
    if find_spec("simplejpeg") is not None:
        runs["now, extra jpeg"] = (["-c", _COMMAND, "1", *asked], checkouts["now"])
    with _in_a_folder() as folder, _on_cores(CORES):
        pictures(folder, count)
        return _least(runs, rounds)


def _least(
    runs: dict[str, tuple[list[str], Path]], rounds: int, leave_out: tuple[str, ...] = ()
) -> dict[str, dict[str, float]]:
    least: dict[str, dict[str, float]] = {name: {} for name in runs}
    for turn in range(rounds):
        for name in list(runs)[:: 1 if turn % 2 else -1]:
            found: dict[str, Any] = run_once(*runs[name])
            Path("poses.jsonl").unlink(missing_ok=True)
            for key, value in found.items():
                if key not in leave_out:
                    least[name][key] = min(value, least[name].get(key, value))
    return least


@contextmanager
def _in_a_folder() -> Iterator[Path]:
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield Path()
        finally:
            os.chdir(before)


@contextmanager
def _on_cores(count: int) -> Iterator[None]:
    """This process and those that it starts, where the system can bind them."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="Of which the least counts.")
    parser.add_argument("--images", type=int, default=IMAGES, help="In the folder.")
    parser.add_argument("--beside", type=Path, help="Checkout whose package does the same, built there.")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    checkouts = {"now": Path(groundpose.__file__).parents[2]}
    if given.beside is not None:
        checkouts = {"before": given.beside.resolve(), **checkouts}
    vehicles, folder = {}, {}
    for network in NETWORKS:
        vehicles[network] = of_vehicles(network, checkouts, given.rounds)
        print(network, "ms per vehicle", json.dumps(vehicles[network]), flush=True)
        folder[network] = of_folder(network, checkouts, given.rounds, given.images)
        print(network, "folder", json.dumps(folder[network]), flush=True)
    content = {
        "command": "python -m groundpose.lab.evaluate.image_path --beside FOLDER",
        "machine": report.machine(),
        "versions": report.versions(),
        "milliseconds_per_vehicle": vehicles,
        "folder": {"images": given.images, "vehicles_each": 8, "cores": CORES, "networks": folder},
    }
    report.write_json(given.out, content)
    print(f"written: {given.out}")


if __name__ == "__main__":
    main()
