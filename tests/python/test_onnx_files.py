"""ONNX files of others, and damaged ones, are refused in a line that names the file and what is missing; the
runtime that reads them leaves nothing in the home folder."""

import json
import os
import subprocess
import sys
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from groundpose import Network
from groundpose.keypoints.network import CERTAINTY, FORMAT
from groundpose.keypoints.onnx import OnnxFile
from stand_in import onnx, write


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return write(tmp_path_factory.mktemp("networks") / "whole.onnx", version="2")


def said(**changes):
    """A change of the metadata; None: the member is missing."""

    def change(model):
        kept = {p.key: p.value for p in model.metadata_props} | changes
        del model.metadata_props[:]
        onnx.helper.set_model_props(model, {k: v for k, v in kept.items() if v is not None})

    return change


def renamed(kind, old):
    """An input or output that is called otherwise."""

    def change(model):
        for node in model.graph.node:
            for names in (node.input, node.output):
                for k, name in enumerate(names):
                    names[k] = "other" if name == old else name
        for value in getattr(model.graph, kind):
            value.name = "other" if value.name == old else value.name

    return change


def sized(width, height):
    """Crops of another size."""

    def change(model):
        said(width=str(width), height=str(height))(model)
        sides = model.graph.input[0].type.tensor_type.shape.dim
        sides[1].dim_value, sides[2].dim_value = height, width

    return change


DAMAGED = {
    "no metadata": (lambda model: model.ClearField("metadata_props"), "version 1 or 2, got another ONNX"),
    **{
        f"no {key}": (said(**{key: None}), f"metadata '{key}': expected a value, got none")
        for key in ("keypoints", "kinds", "width", "height", "margin", "score_calibration")
    },
    "another version": (said(**{FORMAT: "99"}), "version 1 or 2"),
    "broken JSON": (said(keypoints='["nose"'), "metadata 'keypoints': expected JSON"),
    "deep JSON": (said(kinds="[" * 100_000), "metadata 'kinds': expected JSON"),
    "other keypoints": (said(keypoints='["nose"]'), "the keypoints of this version"),
    "a width in words": (said(width="wide"), "metadata 'width': expected a number from 1 to 2048"),
    "a width with a fraction": (said(width="1.5"), "metadata 'width': expected a whole number"),
    "a margin that is none": (said(margin="nan"), "metadata 'margin': expected a number from 0"),
    "a margin of kilometres": (said(margin="1e9"), "metadata 'margin': expected a number from 0"),
    "a threshold above 1": (said(vehicle_threshold="2"), "metadata 'vehicle_threshold': expected a number"),
    "two numbers of calibration": (said(score_calibration="[1, 2]"), "'score_calibration': .* 3 or 5"),
    "calibration in words": (said(score_calibration='["a", 1, 2]'), "'score_calibration': .* 3 or 5"),
    "calibration infinite": (said(score_calibration="[1e400, 1, 2]"), "'score_calibration': .* 3 or 5"),
    "certainty of another kind": (said(**{CERTAINTY: "[1]"}), f"metadata '{CERTAINTY}': expected numbers"),
    "unknown certainty": (said(**{CERTAINTY: '{"a": 1}'}), f"metadata '{CERTAINTY}': expected numbers"),
    "negative certainty": (
        said(**{CERTAINTY: '{"error_factor": -1}'}),
        f"metadata '{CERTAINTY}': expected numbers .*keypoint_error_factor",
    ),
    "crops of another name": (renamed("input", "crops"), "an input 'crops', got 'other'"),
    "keypoints of another name": (renamed("output", "keypoints"), "an output 'keypoints', got "),
    "no viewing angle": (renamed("output", "viewing_angle"), "an output 'viewing_angle', got "),
    "crops of another size": (said(width="64"), r"an input 'crops' of shape \(N, 96, 64, 3\)"),
    "crops of gigabytes": (sized(10**6, 10**6), "metadata 'width': expected a number from 1 to 2048"),
    "crops without pixels": (sized(0, 96), "metadata 'width': expected a number from 1 to 2048"),
    "a type that is none": (
        lambda model: setattr(model.graph.node[0], "op_type", "Nonsense"),
        "an ONNX network, got .*",
    ),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_what_is_wrong_is_said(case, whole, tmp_path):
    change, text = DAMAGED[case]
    model = onnx.load(str(whole))
    change(model)
    path = tmp_path / "damaged.onnx"
    onnx.save(model, str(path))
    with pytest.raises(gp.InputError, match=text) as caught:
        Network(path, threads=1)
    assert str(caught.value).startswith(str(path))
    assert len(str(caught.value)) < 600


def test_cut_and_foreign_files(whole, tmp_path):
    path, content = tmp_path / "cut.onnx", whole.read_bytes()
    for size in (0, 1, 10, len(content) // 2, len(content) - 1):
        path.write_bytes(content[:size])
        with pytest.raises(gp.InputError, match=r"cut\.onnx: expected "):
            Network(path, threads=1)
    path.write_text(json.dumps({"no": "network"}))
    with pytest.raises(gp.InputError, match=r"cut\.onnx: expected an ONNX network"):
        Network(path)
    with pytest.raises(gp.InputError, match=r"expected a file, got a folder"):
        Network(tmp_path)


def test_answers_of_another_shape(whole, monkeypatch):
    """Where the file does not say how long its outputs are, its answers do."""
    network = Network(whole, threads=1)
    answers = [
        np.zeros((2, 54, 2)),
        *[np.zeros((2, 53))] * 2,
        np.zeros((2, 4)),
        np.zeros(2),
        np.zeros((2, 16)),
    ]
    monkeypatch.setattr(OnnxFile, "run", lambda *_, **__: answers)
    with pytest.raises(
        gp.InputError, match=r"whole\.onnx: expected 2 rows \(53, 2\) of keypoints, got \(2, 54"
    ):
        network.detect(np.zeros((2, 96, 128, 3), np.uint8))


def test_a_network_that_cannot_be_run(whole):
    with pytest.raises(gp.InputError, match=r"whole\.onnx: expected a network that runs"):
        OnnxFile(whole, 1).run(["keypoints"], crops=np.zeros((1, 2, 3, 3), np.uint8))


USE = """
import numpy as np
from groundpose import Network
Network({path!r}, threads=1).detect(np.zeros((1, 96, 128, 3), np.uint8))
"""


def test_nothing_is_written_to_the_home_folder(whole, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    package = str(Path(gp.__file__).parents[1])
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("ORT_", "XDG_"))}
    environment |= {"HOME": str(home), "USERPROFILE": str(home), "PYTHONPATH": package}
    command = [sys.executable, "-c", USE.format(path=str(whole))]
    subprocess.run(command, check=True, timeout=60, env=environment, cwd=tmp_path)
    assert list(home.iterdir()) == []


def test_what_the_caller_says_of_telemetry_stays(monkeypatch):
    from groundpose.keypoints.onnx import runtime

    monkeypatch.setenv("ORT_DISABLE_TELEMETRY", "0")
    assert runtime().__name__ == "onnxruntime"
    assert os.environ["ORT_DISABLE_TELEMETRY"] == "0"
