"""Networks in files without training: they answer the same for every crop, and one of version 2 takes bright
crops for vehicles. Skips without onnx."""

import json
from pathlib import Path

import numpy as np
import pytest
from groundpose.keypoints.decode import VIEWING_ANGLES
from groundpose.keypoints.network import FORMAT
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS

onnx = pytest.importorskip("onnx", reason="onnx is not installed (extra [train])")

K, WIDTH, HEIGHT = len(KEYPOINTS), 128, 96
# where it sees each keypoint, crop pixels
PLACES = np.random.default_rng(1).uniform((20, 20), (108, 76), (K, 2)).astype(np.float32)


ANGLES = np.random.default_rng(2).dirichlet(np.ones(VIEWING_ANGLES)).astype(np.float32)


def write(
    path: Path, class_name: int = 0, places: np.ndarray = PLACES, version: str = "1", **changes: str
) -> Path:
    """A network that sees keypoints (K, 2) at `places` and one class; `changes` are of its metadata.

    One of version "2" sees viewing angles `ANGLES`, and a vehicle with the probability mean(crop) / 255.
    """
    helper, of = onnx.helper, onnx.numpy_helper.from_array
    logits = np.full(len(CLASSES), 0.1, np.float32)
    logits[class_name] = 0.7
    answers = {
        "keypoints": places.astype(np.float32),
        "spread": np.full(K, 2.0, np.float32),
        "peak": np.full(K, 0.1, np.float32),
        "kind_probabilities": logits,
    }
    weights, nodes, outputs = [], [], []
    nodes.append(helper.make_node("Shape", ["crops"], ["n"], end=1))
    if version == "2":
        answers["viewing_angle"] = ANGLES
        weights += [of(np.array([1, 2, 3]), "pixels"), of(np.float32(255.0), "white")]
        nodes.append(helper.make_node("Cast", ["crops"], ["levels"], to=onnx.TensorProto.FLOAT))
        nodes.append(helper.make_node("ReduceMean", ["levels", "pixels"], ["level"], keepdims=0))
        nodes.append(helper.make_node("Div", ["level", "white"], ["vehicle"]))
        outputs.append(helper.make_tensor_value_info("vehicle", onnx.TensorProto.FLOAT, ["N"]))
    for name, value in answers.items():
        weights += [of(value[None], name + "_one"), of(np.ones(value.ndim, np.int64), name + "_rest")]
        nodes.append(helper.make_node("Concat", ["n", name + "_rest"], [name + "_shape"], axis=0))
        nodes.append(helper.make_node("Expand", [name + "_one", name + "_shape"], [name]))
        outputs.append(helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, ["N", *value.shape]))
    crops = helper.make_tensor_value_info("crops", onnx.TensorProto.UINT8, ["N", HEIGHT, WIDTH, 3])
    graph = helper.make_graph(nodes, "stand-in", [crops], outputs, weights)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    said = {
        FORMAT: version,
        "width": str(WIDTH),
        "height": str(HEIGHT),
        "margin": "0.1",
        "keypoints": json.dumps([k.name for k in KEYPOINTS]),
        "kinds": json.dumps(CLASSES),
        "score_calibration": "[-6.0, -2.0, 0.0]",
    }
    onnx.helper.set_model_props(model, said | changes)
    onnx.save(model, str(path))
    return path
