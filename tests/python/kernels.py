"""NumPy as it computes on other processors: with other BLAS kernels, and without its own vector units.

`python tests/python/kernels.py` runs the tests that compare numbers on each of them (`make test-kernels`).
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent

# Kernels by the vector units of NumPy (one of its names for them, old or new) that the processor must have.
_KERNELS: dict[str, tuple[str, ...]] = {
    "Nehalem": (),
    "Haswell": ("AVX2", "X86_V3"),
    "SkylakeX": ("AVX512_SKX", "X86_V4"),
}
_WHOLE_PROCESSOR = {"OPENBLAS_CORETYPE": "", "NPY_DISABLE_CPU_FEATURES": ""}

# Not repeated on every kernel: their subject is not numbers, and they take most of the suite's time.
_LEFT_OUT = (
    *("bench", "bench_numbers", "cli", "cli_images", "draw", "evaluate_page", "fork_threads", "fuzz"),
    *("packaging", "readme", "stubs"),
    # overlaps of boxes and counting, and whole experiments of parts that other tests compare
    *("experiments", "kitti_average_precision"),
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
    """Variables by the name of what they choose, of all that this processor and this NumPy can do."""
    units, kernel = vector_units_and_kernel(_WHOLE_PROCESSOR)
    of_x86 = kernel and platform.machine().lower() in ("x86_64", "amd64")
    able = [name for name, needs in _KERNELS.items() if of_x86 and (not needs or set(needs) & set(units))]
    found = {name: _WHOLE_PROCESSOR | {"OPENBLAS_CORETYPE": name} for name in able}
    if units:
        found["no vector units"] = _WHOLE_PROCESSOR | {"NPY_DISABLE_CPU_FEATURES": " ".join(units)}
    return found


def check_effect(name: str, changes: dict[str, str]) -> None:
    """Raises AssertionError where the variables do not choose what they should: tests would say nothing."""
    units, kernel = vector_units_and_kernel(changes)
    if changes["OPENBLAS_CORETYPE"]:
        assert kernel == name, f"OpenBLAS runs on {kernel} instead of {name}"
    else:
        assert not units, f"NumPy still uses {units}"


def main() -> None:
    """Run the tests on every variant; the exit status says whether all passed on all."""
    left_out = [HERE / f"test_{name}.py" for name in _LEFT_OUT]
    assert all(file.exists() for file in left_out), "a file of _LEFT_OUT is not there"
    command = [sys.executable, "-m", "pytest", "--quiet", *(f"--ignore={file}" for file in left_out)]
    failed = []
    for name, changes in variants().items():
        check_effect(name, changes)
        print(f"NumPy on: {name}", flush=True)
        if run([*command, *sys.argv[1:]], changes, cwd=HERE.parents[1]).returncode:
            failed.append(name)
    sys.exit(f"failed on: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
