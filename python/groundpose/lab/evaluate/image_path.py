"""From pictures to poses: `python -m groundpose.lab.evaluate.image_path` writes results/image_path.json.

Milliseconds per vehicle of an image with eight in it, on one core and by step; `groundpose estimate` of a
folder of JPEG files with eight vehicles each, on two cores; the networks alone, by the crops of a call and by
what is computed; decoding a picture; the start of a process. Every number is the least of several rounds, in
which all take turns: what else the machine does only ever adds. With `--beside FOLDER` the package of another
checkout, built there, takes part.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections.abc import Callable, Iterator
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
TARGETS = {"default": 0.9 / 1.31, "int8": 0.5 / 0.86}
"""Time per vehicle, as a part of that before."""
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
    start = time.process_time()
    poses = pipeline(image, boxes, view)
    took = {"all": time.process_time() - start, **poses.seconds}
    least = {step: min(seconds, least.get(step, seconds)) for step, seconds in took.items()}
print(json.dumps({step: round(1e3 * seconds / len(boxes), 4) for step, seconds in least.items()}))
"""
_ALONE = """
import json, sys, tempfile, time
from collections import Counter
from pathlib import Path
import numpy as np
from groundpose.keypoints.network import bundled
from groundpose.keypoints.onnx import runtime
options = runtime().SessionOptions()
options.intra_op_num_threads, options.log_severity_level = 1, 4
path, calls = str(bundled(sys.argv[1])), int(sys.argv[2])
session = runtime().InferenceSession(path, options, providers=["CPUExecutionProvider"])
_, height, width, _ = session.get_inputs()[0].shape
crops = np.random.default_rng(0).integers(0, 256, (16, height, width, 3), dtype=np.uint8)
least = {}
for _ in range(calls):
    for count in (1, 2, 4, 8, 16):
        start = time.process_time()
        session.run(None, {"crops": crops[:count]})
        took = 1e3 * (time.process_time() - start) / count
        least[f"ms per crop of {count}"] = min(took, least.get(f"ms per crop of {count}", took))
options.enable_profiling, options.profile_file_prefix = True, tempfile.mkdtemp() + "/profile"
session = runtime().InferenceSession(path, options, providers=["CPUExecutionProvider"])
for _ in range(calls):
    session.run(None, {"crops": crops[:8]})
nodes = {}
for event in json.loads(Path(session.end_profiling()).read_text(encoding="utf-8")):
    if event["name"].endswith("_kernel_time"):
        node = event["args"]["op_name"], event["name"]
        nodes[node] = min(event["dur"], nodes.get(node, event["dur"]))
sums = Counter()
for (kind, _), took in nodes.items():
    part = "convolutions" if "Conv" in kind else "all else"
    sums[part] += took
least |= {f"{part}, %": 100 * took / sums.total() for part, took in sums.items()}
print(json.dumps({name: round(value, 3) for name, value in least.items()}))
"""
_PICTURE = """
import json, sys, time
from groundpose.demo.street import IMAGE
from groundpose.keypoints.image import as_rgb
if not int(sys.argv[1]):
    sys.modules["simplejpeg"] = None
least = 1e9
for _ in range(int(sys.argv[2])):
    start = time.process_time()
    picture = as_rgb(IMAGE)
    least = min(least, 1e3 * (time.process_time() - start))
    del picture
print(json.dumps({"ms": round(least, 3)}))
"""
_START = """
import json, time
start = time.monotonic()
import groundpose
imported = time.monotonic()
from groundpose.demo.street import IMAGE, LABELS
content = json.loads(LABELS.read_text(encoding="utf-8"))
boxes = [item["bbox"] for item in content["objects"]]
view = groundpose.View(groundpose.Camera(*(content["camera"][name] for name in ("fx", "fy", "cx", "cy"))))
poses = groundpose.Pipeline(threads=1)(IMAGE, boxes, view)
assert poses.ok.all()
times = {"import groundpose": imported - start, "first poses of a picture": time.monotonic() - start}
print(json.dumps({name: round(seconds, 4) for name, seconds in times.items()}))
"""
_COMMAND = """
import runpy, sys
if not int(sys.argv.pop(1)):
    sys.modules["simplejpeg"] = None
runpy.run_module("groundpose.cli", run_name="__main__", alter_sys=True)
"""
_NAMES = {"seconds": "s", "processor_seconds": "processor s", "most_megabytes": "MB at most"}
_STATED = tuple(_NAMES)


Runs = dict[str, tuple[list[str], Path]]
Found = dict[str, dict[str, float]]


def of_vehicles(network: str, checkouts: dict[str, Path], rounds: int) -> Found:
    """Milliseconds per vehicle of a warm call in each checkout: processor time of all, time of each step."""
    arguments = ["-c", _VEHICLES, network, str(CALLS)]
    runs = {name: (arguments, checkout) for name, checkout in checkouts.items()}
    return _least(runs, rounds, leave_out=_STATED)


def of_folder(network: str, checkouts: dict[str, Path], rounds: int, count: int) -> Found:
    """Seconds of the command for `count` pictures, with the extra `jpeg` too where it is installed."""
    asked = ["estimate", "images", "--boxes", "boxes", "--calib", "camera.json", "--network", network]
    asked += ["-o", "poses.jsonl", "--no-pictures"]
    with _in_a_folder() as folder, _on_cores(CORES):
        pictures(folder, count)
        return _least(_with_and_without_extra(_COMMAND, asked, checkouts), rounds)


def of_network(network: str, checkouts: dict[str, Path], rounds: int) -> Found:
    """A network alone on one core: milliseconds by the crops of a call, percent of the time by operation."""
    return _least({"now": (["-c", _ALONE, network, str(CALLS)], checkouts["now"])}, rounds, leave_out=_STATED)


def of_picture(checkouts: dict[str, Path], rounds: int) -> Found:
    """Milliseconds of processor time for a JPEG file of 1914 x 1080."""
    runs = _with_and_without_extra(_PICTURE, [str(CALLS)], checkouts)
    return _least(runs, rounds, leave_out=_STATED)


def of_start(checkouts: dict[str, Path], rounds: int) -> Found:
    """Seconds from the start of a program to the package, and to the poses of the example's picture."""
    runs: Runs = {name: (["-c", _START], checkout) for name, checkout in checkouts.items()}
    return _least(runs, 2 * rounds, leave_out=_STATED)


def _with_and_without_extra(script: str, arguments: list[str], checkouts: dict[str, Path]) -> Runs:
    runs = {name: (["-c", script, "0", *arguments], checkout) for name, checkout in checkouts.items()}
    if find_spec("simplejpeg") is not None:
        runs["now, extra jpeg"] = (["-c", script, "1", *arguments], checkouts["now"])
    return runs


def _least(runs: Runs, rounds: int, leave_out: tuple[str, ...] = ()) -> Found:
    least: Found = {name: {} for name in runs}
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


def vehicles_table(content: dict[str, Any]) -> str:
    """Machine, and milliseconds per vehicle."""
    lines = []
    for file, packages in content["parts"]["vehicles"].items():
        before = packages.get("before", {}).get("all", float("nan"))
        for package, found in packages.items():
            against = {"all / before": found["all"] / before, "target": TARGETS[file]}
            lines.append({"file": file, "package": package} | found | (against if package == "now" else {}))
    packages = ("python", "groundpose", "numpy")
    versions = ", ".join(f"{name} {content['versions'][name]}" for name in packages)
    return f"{content['machine']}. {versions}.\n\n{report.table(lines)}"


def folder_table(content: dict[str, Any]) -> str:
    """The folder, and how much less time each needs than the package before."""
    lines = []
    for file, packages in content["parts"]["folder"].items():
        slowest = packages.get("before", packages["now"])
        for package, found in packages.items():
            named = {name: found[key] for key, name in _NAMES.items()}
            times = {
                f"before / this, {_NAMES[key]}": slowest[key] / found[key]
                for key in ("seconds", "processor_seconds")
            }
            lines.append({"file": file, "package": package} | named | times)
    return f"{content['images']} images.\n\n{report.table(lines)}"


def networks_table(content: dict[str, Any]) -> str:
    """The networks alone."""
    found = content["parts"]["networks"]
    return report.table([{"file": file} | packages["now"] for file, packages in found.items()])


def picture_table(content: dict[str, Any]) -> str:
    """Decoding a picture."""
    found = content["parts"]["picture"]["street"]
    return report.table([{"package": package} | times for package, times in found.items()])


def start_table(content: dict[str, Any]) -> str:
    """A process from its start."""
    found = content["parts"]["start"]["street"]
    return report.table([{"package": package} | times for package, times in found.items()])


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="One of vehicles, folder, networks, picture, start.")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="Of which the least counts.")
    parser.add_argument("--images", type=int, default=IMAGES, help="In the folder.")
    parser.add_argument("--beside", type=Path, help="Checkout whose package does the same, built there.")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    checkouts = {"now": Path(groundpose.__file__).parents[2]}
    if given.beside is not None:
        checkouts = {"before": given.beside.resolve(), **checkouts}
    parts: dict[str, Callable[[], Any]] = {
        "vehicles": lambda: {name: of_vehicles(name, checkouts, given.rounds) for name in NETWORKS},
        "folder": lambda: {name: of_folder(name, checkouts, given.rounds, given.images) for name in NETWORKS},
        "networks": lambda: {name: of_network(name, checkouts, given.rounds) for name in NETWORKS},
        "picture": lambda: {"street": of_picture(checkouts, given.rounds)},
        "start": lambda: {"street": of_start(checkouts, given.rounds)},
    }
    found = report.read_json(given.out).get("parts", {})
    for name, measure in parts.items():
        if given.only in ("", name):
            found[name] = measure()
            print(name, json.dumps(found[name]), flush=True)
            content = {
                "command": "python -m groundpose.lab.evaluate.image_path --beside FOLDER "
                f"--rounds {given.rounds} --images {given.images}",
                "machine": report.machine(),
                "versions": report.versions(),
                "images": given.images,
                "cores": CORES,
                "parts": found,
            }
            report.write_json(given.out, content)
    print(f"written: {given.out}")


if __name__ == "__main__":
    main()
