"""Measurements that build the core from its sources: instruction counts, and a build for this very processor.

They need a Rust toolchain and the repository; the counts need valgrind besides. What is missing is said.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import groundpose as gp
from groundpose import _core
from groundpose.lab.bench.races import Effort, Tell, WrongAnswer
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.contenders.own import DEFAULT
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.timing import CHUNK, Timed, clocked, in_chunks, interleaved, median_interval

BENCH = Path("benches/instructions.rs")
_TARGETS = ("groundpose", BENCH.stem)
MEASURED = "instructions::measured"
"""The function of that bench whose instructions count, once a row."""


class Missing(RuntimeError):
    """Something this measurement needs is not there."""


def repository() -> Path:
    """The folder of the sources: where we are, or where the package was installed from. Raises Missing."""
    for folder in (Path.cwd(), Path(gp.__file__).resolve().parents[2]):
        if (folder / BENCH).exists():
            return folder
    raise Missing(f"no {BENCH} here: needs the repository")


def _tool(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        raise Missing(f"{name} is not installed")
    return found


def cargo(arguments: list[str], suffix: str = "", **environment: str) -> Path:
    """Build, and the executable or the file that ends in `suffix`. Raises Missing with cargo's own words."""
    command = [_tool("cargo"), *arguments, "--message-format=json-render-diagnostics"]
    done = subprocess.run(
        command, cwd=repository(), env=os.environ | environment, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise Missing(f"cargo {arguments[0]} failed: {done.stderr.strip()[-500:]}")
    return artifact(done.stdout, suffix)


def artifact(output: str, suffix: str) -> Path:
    """The file that cargo's messages tell of: our executable, or the one that ends in `suffix`."""
    messages = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    made = [m for m in messages if m["reason"] == "compiler-artifact" and m["target"]["name"] in _TARGETS]
    files = [name for m in made for name in (m["filenames"] if suffix else [m["executable"]])]
    return Path(next(name for name in files if name and name.endswith(suffix)))


def instructions(effort: Effort, tell: Tell) -> dict[str, Any]:
    """Instructions of every stage, counted by valgrind; draws, steps, allocations and times beside them."""
    valgrind = _tool("valgrind")
    tell("building benches/instructions.rs")
    bench = cargo(["bench", "--no-run", "--bench", BENCH.stem])
    tell("running it")
    output = subprocess.run([bench, "--bench"], capture_output=True, text=True, check=False)
    if output.returncode != 0:  # it asserts the truth first
        raise WrongAnswer(f"{bench.name}: {output.stderr.strip()[:500]}")
    rows = [json.loads(line) for line in output.stdout.splitlines()]
    tell("counting its instructions")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "callgrind"
        options = ["--tool=callgrind", f"--callgrind-out-file={out}", f"--toggle-collect={MEASURED}"]
        command = [valgrind, *options, f"--dump-after={MEASURED}", str(bench)]
        subprocess.run(command, capture_output=True, check=True)
        counts = [total(out.with_name(f"{out.name}.{k + 1}").read_text()) for k in range(len(rows))]
    return {
        "group": "instructions",
        "label": "stages",
        "toolchain": subprocess.run(
            [_tool("rustc"), "--version"], capture_output=True, text=True, check=True
        ).stdout.strip(),
        "rows": [row | {"instructions": count} for row, count in zip(rows, counts, strict=True)],
    }


def total(dump: str) -> int:
    """Instructions of one dump of callgrind."""
    return next(int(line.split()[1]) for line in dump.splitlines() if line.startswith("totals:"))


def native(effort: Effort, tell: Tell) -> dict[str, Any]:
    """The installed core against one built with `target-cpu=native`, in turns on the same arrays."""
    tell("building for this processor")
    _tool("cargo")
    target = Path(os.environ.get("CARGO_TARGET_DIR", repository() / "target")) / "native"
    build = ["rustc", "--release", "--lib", "--features", "python", "--crate-type", "cdylib"]
    flags = {"RUSTFLAGS": "-C target-cpu=native", "PYO3_BUILD_EXTENSION_MODULE": "1"}
    path = cargo([*build, "--target-dir", str(target)], "groundpose.so", **flags)
    tell("timing it")
    modules = {"installed": _core, "native": load(path)}
    racing = {name: _direct(module) for name, module in modules.items()}
    return {"group": "native", "label": "installed build / native build", **_against(racing, effort)}


def load(path: Path) -> ModuleType:
    """Another build of the core beside the one that is imported."""
    loader = importlib.machinery.ExtensionFileLoader("_core", str(path))
    spec = importlib.util.spec_from_loader("_core", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def _against(racing: dict[str, Timed], effort: Effort) -> dict[str, Any]:
    chunk = min(CHUNK, effort.objects)
    found = {}
    for name, kind, options in (("V1", "vehicle", {}), ("E1 50 %", "cube", {"outlier_ratio": 0.5})):
        scenes = generate(kind, min(effort.objects, 20 * chunk), seed=effort.seed, **options)
        chunks = [c for _ in range(max(effort.rounds // 20, 1)) for c in in_chunks(scenes, chunk)]
        seconds = interleaved(chunks, racing)
        ratio = seconds["installed"] / seconds["native"]
        found[name] = {
            "us": {which: 1e6 * float(np.median(s)) for which, s in seconds.items()},
            "ratio": float(np.median(ratio)),
            "95 %": median_interval(ratio),
        }
    return {"settings": found}


def _direct(module: Any) -> Timed:
    """The batch call of a core itself, with objects of its own classes, checked before it is timed."""

    def timed(scenes: Objects) -> float:
        c = scenes.camera
        camera = module.Camera(c.fx, c.fy, c.cx, c.cy, None, c.image_size)
        view = module.View(camera, scenes.view.pitch, 0.0, None)
        models = tuple(module.Model(m.keypoints_3d, m.bbox_3d, m.basis, m.eigenvalues) for m in scenes.models)
        options = module.Options(**module.default_options())
        answers: list[Any] = []

        def call() -> None:
            made = module.Estimator(view, module.Models.of(models), options, scenes.inlier_threshold, 1)
            answers.append(made.estimate(scenes.keypoints_2d, scenes.bboxes))

        seconds = clocked(call)
        expected = DEFAULT.poses(scenes)
        if not np.allclose(answers[0].array("t"), expected.t, equal_nan=True, rtol=1e-6):
            raise AssertionError("two builds of the core give two answers")
        return seconds

    return timed
