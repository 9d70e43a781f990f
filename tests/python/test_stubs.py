"""The stubs of the compiled module say what the module has, and the package says it is typed."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import groundpose
import numpy as np
import pytest
from conftest import CAMERA, MODEL, VIEW
from groundpose import _core
from groundpose.lens import LENSES

PACKAGE = Path(groundpose.__file__).parent


def test_stubs_have_the_names_and_signatures_of_the_module(tmp_path):
    pytest.importorskip("mypy")
    command = [sys.executable, "-m", "mypy.stubtest", "groundpose._core"]
    result = subprocess.run(command, capture_output=True, text=True, cwd=PACKAGE.parent, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_results_of_the_core_are_the_fields_of_the_batch():
    estimator = _core.Estimator(VIEW._handle, _core.Models.of(MODEL), _core.Options(), threads=1)
    answers = estimator.estimate(np.zeros((2, 24, 2)))
    known = {"view", "nominal_view", "models", "error_dof"}
    assert set(answers.names) == {field.name for field in dataclasses.fields(groundpose.PoseBatch)} - known
    assert all(len(answers.array(name)) == 2 for name in answers.names)
    assert answers.array("models") is None
    fields = {"t": None}
    answers.fill(fields)
    assert fields.pop("t") is None
    assert set(fields) == set(answers.names) - {"t"}


def test_types_of_attributes_are_those_of_the_stubs():
    camera = _core.Camera(1.0, 2.0, 3.0, 4.0, (0.1, 0.0, 0.0, 0.0, 0.0), (5, 6))
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (1.0, 2.0, 3.0, 4.0)
    assert list(camera.distortion) == [0.1, 0.0, 0.0, 0.0, 0.0]
    assert list(camera.image_size) == [5.0, 6.0]
    assert all(isinstance(name, str) for name in (*_core.STATUS, *_core.STOP_REASONS, *_core.SOLVERS))
    assert _core.STATUS[0] == "ok"
    assert VIEW._handle.R_camera_from_ground.dtype == np.float64
    assert isinstance(VIEW._handle.horizon(), tuple)
    assert MODEL._handle.footprint.shape == (4, 2)
    assert CAMERA._handle.distortion is None


def test_lens_models_are_those_of_the_core():
    assert list(LENSES) == _core.LENSES
    for name, model in LENSES.items():
        k = (*[0.0] * (len(model.coefficients) - 1), 0.1)
        assert tuple(_core.Camera(1.0, 1.0, 0.0, 0.0, k, lens=name).distortion) == k


def test_the_package_is_typed():
    assert (PACKAGE / "py.typed").exists()
    assert (PACKAGE / "_core.pyi").exists()
