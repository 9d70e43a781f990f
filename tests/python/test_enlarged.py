"""Maps made twice as large by copying are those of `Resize`, to the bit."""

import numpy as np
import pytest

onnx = pytest.importorskip("onnx", reason="onnx is not installed; pip install '.[train]'")

import onnxruntime as ort  # noqa: E402
from groundpose.lab.training.enlarged import enlarge_by_copies  # noqa: E402

HEIGHT, WIDTH, CHANNELS = 3, 5, 4
MAPS = np.random.default_rng(0).normal(0.0, 40.0, (2, CHANNELS, HEIGHT, WIDTH)).astype(np.float32)


def network(scale_after: float = 0.5, mode: str = "nearest", times: float = 2.0):
    """Bytes of a map made larger, as `onnxruntime.quantization` writes it."""
    make, number = onnx.helper.make_node, onnx.numpy_helper.from_array
    at = {"coordinate_transformation_mode": "asymmetric", "nearest_mode": "floor", "mode": mode}
    nodes = [
        make("QuantizeLinear", ["x", "scale", "zero"], ["bytes"]),
        make("DequantizeLinear", ["bytes", "scale", "zero"], ["small"]),
        make("Resize", ["small", "", "scales"], ["large"], name="resize", **at),
        make("QuantizeLinear", ["large", "scale_after", "zero"], ["large_bytes"]),
        make("DequantizeLinear", ["large_bytes", "scale_after", "zero"], ["y"]),
    ]
    numbers = {
        "scale": np.float32(0.5),
        "scale_after": np.float32(scale_after),
        "zero": np.uint8(100),
        "scales": np.array([1.0, 1.0, times, times], np.float32),
    }
    value = onnx.helper.make_tensor_value_info
    shape = ("N", CHANNELS, HEIGHT, WIDTH)
    graph = onnx.helper.make_graph(
        nodes,
        "maps",
        [value("x", onnx.TensorProto.FLOAT, shape)],
        [value("y", onnx.TensorProto.FLOAT, ("N", CHANNELS, "H", "W"))],
        [number(np.asarray(each), name) for name, each in numbers.items()],
    )
    return onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 18)], ir_version=10)


def answer(model) -> np.ndarray:
    onnx.checker.check_model(model)
    return ort.InferenceSession(model.SerializeToString()).run(None, {"x": MAPS})[0]


def kinds(model) -> list[str]:
    return [node.op_type for node in model.graph.node]


def test_copies_are_the_maps_of_resize():
    model = network()
    before = answer(model)
    enlarge_by_copies(model)
    assert "Resize" not in kinds(model)
    assert before.shape == (2, CHANNELS, 2 * HEIGHT, 2 * WIDTH)
    np.testing.assert_array_equal(answer(model), before)


@pytest.mark.parametrize("other", [{"scale_after": 0.25}, {"mode": "linear"}, {"times": 3.0}])
def test_what_is_no_repetition_of_bytes_stays(other):
    model = network(**other)
    before = kinds(model)
    enlarge_by_copies(model)
    assert kinds(model) == before
