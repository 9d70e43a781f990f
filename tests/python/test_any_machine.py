"""The solver's answers are the same bits whatever BLAS kernel and vector units NumPy runs on."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from answers import MODEL, SOLVERS, digests
from conftest import make_batch
from groundpose.vehicles import shape_model
from kernels import HERE, WHOLE_PROCESSOR, check_effect, run, variants

SCENES = 300


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Written down, since what makes them depends on BLAS."""
    model, draw = shape_model(MODEL), np.random.default_rng(7)
    shape = draw.normal(size=(SCENES, model.modes)) * np.sqrt(model.eigenvalues)
    batch = make_batch(SCENES, seed=7, model=model, shape=shape)
    camera, view = batch.view.camera, batch.view
    path = tmp_path_factory.mktemp("inputs") / "scenes.npz"
    np.savez(
        path,
        shape=shape,
        keypoints_2d=batch.keypoints_2d,
        bboxes=batch.bboxes,
        scores=draw.uniform(0.1, 1.0, batch.keypoints_2d.shape[:2]),
        camera=[camera.fx, camera.fy, camera.cx, camera.cy],
        tilt=[view.pitch, view.roll],
    )
    return path


@pytest.fixture(scope="module")
def here(inputs: Path) -> dict[str, str]:
    """What the NumPy of this process gives."""
    return digests(inputs)


def test_threads_give_the_same_bits(here: dict[str, str]) -> None:
    for solver in SOLVERS:
        one, two = (here[f"poses, {solver}, threads {n}"] for n in (1, 2))
        assert one == two, solver
    assert len(set(here.values())) == 2 + len(SOLVERS)


@pytest.mark.parametrize("name", variants())
def test_every_kernel_gives_the_same_bits(name: str, inputs: Path, here: dict[str, str]) -> None:
    changes = variants()[name]
    check_effect(name, changes)
    told = run([sys.executable, str(HERE / "answers.py"), str(inputs)], changes, capture_output=True)
    assert told.returncode == 0, told.stderr
    assert json.loads(told.stdout) == here


@pytest.mark.parametrize("name", variants())
def test_variables_without_effect_are_noticed(name: str) -> None:
    changes = variants()[name]
    kernel = changes["OPENBLAS_CORETYPE"]
    with pytest.raises(AssertionError, match=r"instead of|still uses"):
        check_effect("another kernel" if kernel else name, changes if kernel else WHOLE_PROCESSOR)
