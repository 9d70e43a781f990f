"""Certainty written into the metadata of a network's file."""

from __future__ import annotations

import json
from pathlib import Path

from groundpose._writing import whole_path
from groundpose.keypoints.certainty import Certainty
from groundpose.keypoints.network import CERTAINTY


def store(path: Path, certainty: Certainty) -> None:
    """Write the numbers into the ONNX file at `path`; the file is complete at every moment."""
    import onnx

    model = onnx.load(str(path))
    said = {p.key: p.value for p in model.metadata_props} | {CERTAINTY: json.dumps(certainty.numbers())}
    onnx.helper.set_model_props(model, said)
    with whole_path(path) as part:
        onnx.save(model, str(part))
