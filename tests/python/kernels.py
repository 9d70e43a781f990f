"""NumPy as it computes on other processors: with other BLAS kernels, and without its own vector units.

`python tests/python/kernels.py` runs the tests that compare numbers on each of them (`make test-kernels`).
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent

# Kernels by the vector units of NumPy (one of its names for them, old or new) that the processor must have.
_KERNELS: dict[str, tuple[str, ...]] = {
    "Nehalem": (),
    "Haswell": ("AVX2", "X86_V3"),
    "SkylakeX": ("AVX512_SKX", "X86_V4"),
}
WHOLE_PROCESSOR = {"OPENBLAS_CORETYPE": "", "NPY_DISABLE_CPU_FEATURES": ""}

# Not repeated on every kernel.
_LEFT_OUT = (
    # what files, terminals, processes and pages hold, or how long something takes
    *(
        "arrow",
        "bench",
        "bench_numbers",
        "box_formats",
        "boxes",
        "camera_files",
        "cases",
        "class_words",
        "cli",
    ),
    *(
        "cli_detector",
        "cli_images",
        "docs",
        "draw",
        "evaluate_page",
        "examples",
        "fleet",
        "fork_threads",
        "fuzz",
    ),
    *("kills", "mutations", "neighbours", "one_bad_item", "onnx_files", "options", "outputs", "packaging"),
    *("processes", "readme", "rerun_log", "stubs", "terminal"),
    *("convert_tracks", "crew", "fleet_engines", "growth", "recordings", "track_images", "track_live"),
    # overlaps of boxes and counting; whole experiments made of parts that other tests compare
    *("experiments", "kitti_average_precision"),
    # pictures of the drive, which the renderer makes
    *("nothing", "render_faces", "render_surroundings", "simulation_cameras", "simulation_video"),
    # runs what is run here
    "any_machine",
)

_SHOW = """
import json, numpy as np
np.ones((64, 64)) @ np.ones((64, 64))
print(json.dumps(np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])))
"""


def vector_units_and_kernel(changes: dict[str, str]) -> tuple[list[str], str]:
    """What a NumPy started with these variables uses; kernel "": another BLAS than OpenBLAS."""
    told = run([sys.executable, "-c", _SHOW], changes | {"OPENBLAS_VERBOSE": "2"}, capture_output=True)
    told.check_returncode()
    kernels = [line[6:] for line in told.stderr.splitlines() if line.startswith("Core: ")]
    return json.loads(told.stdout), kernels[0] if kernels else ""


def run(command: list[str], changes: dict[str, str], **more: Any) -> subprocess.CompletedProcess[str]:
    """A command with other variables, of which an empty one is unset."""
    variables = {k: v for k, v in (os.environ | changes).items() if v or k not in changes}
    return subprocess.run(command, env=variables, text=True, check=False, **more)


def variants() -> dict[str, dict[str, str]]:
    """Variables by the name of what they choose, of all that this processor and this NumPy can do without
    what they do untold, on which `make test` runs."""
    units, kernel = vector_units_and_kernel(WHOLE_PROCESSOR)
    _, usual = vector_units_and_kernel({})
    of_x86 = kernel and platform.machine().lower() in ("x86_64", "amd64")
    able = [name for name, needs in _KERNELS.items() if of_x86 and (not needs or set(needs) & set(units))]
    able = [name for name in able if name != usual]
    found = {name: WHOLE_PROCESSOR | {"OPENBLAS_CORETYPE": name} for name in able}
    if units:
        found["no vector units"] = WHOLE_PROCESSOR | {"NPY_DISABLE_CPU_FEATURES": " ".join(units)}
    return found


def check_effect(name: str, changes: dict[str, str]) -> None:
    """Raises AssertionError where the variables do not choose what they should: tests would say nothing."""
    units, kernel = vector_units_and_kernel(changes)
    if changes["OPENBLAS_CORETYPE"]:
        assert kernel == name, f"OpenBLAS runs on {kernel} instead of {name}"
    else:
        assert not units, f"NumPy still uses {units}"


def run_tests(name: str, changes: dict[str, str]) -> bool:
    """Whether the tests pass on a variant; prints what they say."""
    check_effect(name, changes)
    ignored = [f"--ignore={HERE / f'test_{left_out}.py'}" for left_out in _LEFT_OUT]
    command = [sys.executable, "-m", "pytest", "--quiet", "-p", "no:cacheprovider", *ignored, *sys.argv[1:]]
    told = run(command, changes, cwd=HERE.parents[1], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    print(f"NumPy on: {name}\n{told.stdout}", flush=True)
    return told.returncode == 0


def main() -> None:
    """Run the tests on every variant, one on each core; the exit status says whether all passed on all."""
    assert all((HERE / f"test_{name}.py").exists() for name in _LEFT_OUT), "a file of _LEFT_OUT is not there"
    chosen = variants()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        passed = dict(zip(chosen, pool.map(run_tests, chosen, chosen.values()), strict=True))
    failed = [name for name in chosen if not passed[name]]
    sys.exit(f"failed on: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
