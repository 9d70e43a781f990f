"""What a user of the installed package meets before the first pose: its version and a quick import."""

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import groundpose
import pytest

# What pictures, networks and the command line need, and what takes longer to import than the solver itself.
HEAVY = {
    *("onnxruntime", "PIL", "typer", "rich", "matplotlib", "scipy", "moderngl", "torch", "cv2"),
    *("zipfile", "importlib.metadata", "groundpose.keypoints", "groundpose.vehicles", "groundpose.cli"),
}


def imported_by(code: str) -> set[str]:
    """Modules that a new interpreter has after running `code`."""
    command = [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"]
    return set(subprocess.run(command, check=True, capture_output=True, text=True).stdout.split())


@pytest.mark.parametrize("first", ["import groundpose", "import groundpose; groundpose.build_info()"])
def test_import_leaves_what_is_heavy_untouched(first):
    before = imported_by("import numpy")
    added = imported_by(first) - before
    assert {"groundpose._core", "groundpose.estimate"} <= added
    assert not added & HEAVY


def test_what_is_heavy_comes_with_the_pipeline():
    assert "groundpose.keypoints" in imported_by("import groundpose; groundpose.Pipeline")


def test_version_is_that_of_the_installed_package():
    assert groundpose.__version__ == version("groundpose") == groundpose.build_info()["version"]


def test_the_citation_is_of_this_version():
    citation = (Path(__file__).parents[2] / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {groundpose.__version__}\n" in citation
