"""Digests of the bits of answers, as JSON: `python answers.py INPUTS.npz`, run by test_any_machine.py."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any

import groundpose as gp
import numpy as np
from groundpose.vehicles import shape_model

MODEL = "car"
SOLVERS = ("p1p", "p3p", "up2p")
# no arrays of numbers, or what was given
_NOT_ANSWERS = ("view", "nominal_view", "nominal_tilt_sigma", "models", "keypoints_2d", "bboxes")


def digest(arrays: Iterable[Any]) -> str:
    return hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()


def digests(inputs: Path) -> dict[str, str]:
    """By what was computed from these bits."""
    given, model = np.load(inputs), shape_model(MODEL)
    found = {
        "keypoints": digest(model.keypoints(row) for row in given["shape"]),
        "boxes": digest(model.bbox_3d_of(row) for row in given["shape"]),
    }
    view = gp.View(gp.Camera(*given["camera"]), *given["tilt"])
    data = (view, given["keypoints_2d"], given["bboxes"], model, given["scores"])
    for solver in SOLVERS:
        options = gp.Options(solver=solver, max_iterations=50)
        for threads in (1, 2):
            poses = gp.estimate_poses(*data, options, threads, frame_tilt_sigma=0.01)
            answers = [getattr(poses, f.name) for f in fields(poses) if f.name not in _NOT_ANSWERS]
            tilt = np.array([poses.view.pitch, poses.view.roll])
            found[f"poses, {solver}, threads {threads}"] = digest([*answers, tilt])
    return found


if __name__ == "__main__":
    print(json.dumps(digests(Path(sys.argv[1]))))
