"""Install a wheel into a new environment and see whether it works: `python tests/try_wheel.py WHEEL`.

With `--alone` only numpy is installed beside it, and only the solver is tried: not every dependency has
wheels for every interpreter. This script needs the standard library alone.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

IMPORT_RUNS = 20
# What `import groundpose` may take beyond numpy, as a share of numpy's time: measured 0.2 to 0.35. A limit in
# milliseconds would judge the machine.
IMPORT_LIMIT = 0.6

SOLVER = """
import sys
import groundpose as gp

heavy = {"onnxruntime", "PIL", "typer", "rich", "matplotlib", "scipy", "torch"} & set(sys.modules)
assert not heavy, f"imported before they are needed: {heavy}"

from importlib.metadata import version
import numpy as np

assert gp.__version__ == version("groundpose") == gp.build_info()["version"]
assert gp.build_info()["profile"] == "release"
print("  ", gp.build_info())

view = gp.View(gp.Camera(1000, 1000, 960, 540), pitch=-0.07)
points = np.array([[-0.8, -0.3, 1.35], [0.8, -0.3, 1.35], [0.8, -0.3, -1.35], [-0.8, -0.3, -1.35],
                   [-0.65, -0.7, 2.1], [0.65, -0.7, 2.1], [0.7, -0.9, -2.15], [-0.7, -0.9, -2.15]])
pixels = np.array([[919.3, 560.1], [813.5, 565.4], [725.2, 552.5], [820.8, 547.6],
                   [942.8, 533.3], [854.3, 537.5], [708.1, 509.2], [790.8, 507.7]])
model = gp.ShapeModel(points, bbox_3d=[[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]])
poses = gp.estimate_poses(view, [pixels] * 100, [[694.1, 470.1, 963.0, 597.8]] * 100, model)
assert poses.ok.all() and np.abs(poses.yaw - 2.5).max() < 0.1, poses.yaw
"""

# A free-threaded interpreter switches its lock on for a module that does not promise to do without.
GIL = """
import sysconfig, sys, groundpose
if sysconfig.get_config_var("Py_GIL_DISABLED"):
    assert not sys._is_gil_enabled(), "the module asks for the GIL"
"""


def installed(wheel: Path, folder: Path, alone: bool) -> Path:
    """A new environment with the wheel; the folder of its programs."""
    venv.create(folder, with_pip=True)
    scripts = folder / ("Scripts" if sys.platform == "win32" else "bin")
    pip = [scripts / "python", "-m", "pip", "--quiet", "--disable-pip-version-check", "install"]
    if alone:
        subprocess.run([*pip, "numpy"], check=True)
    subprocess.run([*pip, *(["--no-deps"] if alone else []), wheel], check=True)
    return scripts


def milliseconds(python: Path, code: str, folder: Path) -> float:
    """Median processor time of a new interpreter that runs `code`; other programs hardly count."""
    command = [python, "-c", f"{code}; import time; print(time.process_time())"]
    runs = (subprocess.run(command, check=True, cwd=folder, capture_output=True) for _ in range(IMPORT_RUNS))
    return statistics.median(1e3 * float(run.stdout) for run in runs)


def megabytes(folder: Path) -> float:
    """Size of the files in a folder, without compiled byte code."""
    files = (file for file in folder.rglob("*") if file.is_file() and "__pycache__" not in file.parts)
    return sum(file.stat().st_size for file in files) / 1e6


def measure(python: Path, environment: Path, folder: Path) -> None:
    """Print sizes and the time of an import; exits when it takes too long."""
    packages = next(environment.rglob("groundpose/__init__.py")).parents[1]
    own, everything = megabytes(packages / "groundpose"), megabytes(packages)
    print(f"   installed: {own:.1f} MB; with pip and all that it needs {everything:.0f} MB")
    codes = ("pass", "import numpy", "import groundpose")
    bare, numpy, ours = (milliseconds(python, code, folder) for code in codes)
    print(f"   processor time, ms: python {bare:.0f}, import numpy {numpy:.0f}, import groundpose {ours:.0f}")
    if ours - numpy > IMPORT_LIMIT * numpy:
        sys.exit(f"import groundpose takes {ours - numpy:.0f} ms beyond numpy's {numpy:.0f} ms")


def main() -> None:
    """Try one wheel; the exit code says whether it works."""
    parser = argparse.ArgumentParser(description="Install a wheel into a new environment and try it.")
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--alone", action="store_true", help="only numpy beside it, only the solver")
    arguments = parser.parse_args()
    wheel = arguments.wheel.resolve(strict=True)
    print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB, Python {sys.version.split()[0]}")
    with tempfile.TemporaryDirectory() as name:
        # Programs run where nothing of this repository can be imported.
        environment, folder = Path(name) / "venv", Path(name) / "work"
        folder.mkdir()
        scripts = installed(wheel, environment, arguments.alone)
        for code in (SOLVER, GIL):
            subprocess.run([scripts / "python", "-W", "error", "-c", code], check=True, cwd=folder)
        if not arguments.alone:
            subprocess.run([scripts / "groundpose", "demo"], check=True, cwd=folder)
        measure(scripts / "python", environment, folder)


if __name__ == "__main__":
    main()
