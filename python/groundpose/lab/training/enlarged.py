"""Maps of quantised networks made twice as large by copying."""

from __future__ import annotations

from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import NodeProto, helper, numpy_helper

_TWICE = (1.0, 1.0, 2.0, 2.0)
_CHANNELS_LAST, _CHANNELS_FIRST = (0, 2, 3, 1), (0, 3, 1, 2)


def enlarge_by_copies(model: onnx.ModelProto) -> None:
    """Replace every `Resize` that repeats the bytes of a map by copies of rows and columns: the same bytes.

    onnxruntime's `Resize` works number by number. With channels last, in which it lays out quantised
    convolutions by itself, all channels of a place are copied at once, and the transpositions vanish.
    """
    shapes = _shapes(model)
    graph = model.graph
    numbers = {each.name: numpy_helper.to_array(each) for each in graph.initializer}
    made_by = {name: node for node in graph.node for name in node.output}
    for resize in [node for node in graph.node if node.op_type == "Resize"]:
        dequantise, (quantise, *others) = made_by[resize.input[0]], _users(graph, resize)
        if others or not _repeats_bytes(dequantise, resize, quantise, numbers):
            continue
        shape = shapes[resize.input[0]]
        copies, constants = _copies(resize.name, dequantise.input[0], quantise.output[0], shape)
        graph.initializer.extend(constants)
        place = list(graph.node).index(resize)
        for node in reversed(copies):
            graph.node.insert(place, node)
        for node in (resize, quantise):
            graph.node.remove(node)
        if not _users(graph, dequantise):
            graph.node.remove(dequantise)


def _users(graph: onnx.GraphProto, node: NodeProto) -> list[NodeProto]:
    """Those to which the answer of a node is given."""
    return [user for user in graph.node if node.output[0] in user.input]


def _repeats_bytes(
    dequantise: NodeProto, resize: NodeProto, quantise: NodeProto, numbers: dict[str, NDArray[Any]]
) -> bool:
    """Whether bytes come out as they go in, each four times."""
    scales = numbers.get(resize.input[2]) if len(resize.input) == 3 else None
    return (
        (dequantise.op_type, quantise.op_type) == ("DequantizeLinear", "QuantizeLinear")
        and scales is not None
        and tuple(scales) == _TWICE
        and ("mode", b"nearest") in ((each.name, each.s) for each in resize.attribute)
        and all(map(np.array_equal, _numbers(dequantise, numbers), _numbers(quantise, numbers)))
    )


def _numbers(node: NodeProto, numbers: dict[str, NDArray[Any]]) -> list[NDArray[Any]]:
    """Scale and zero point."""
    return [numbers[name] for name in node.input[1:]]


def _copies(
    name: str, small: str, large: str, shape: list[int]
) -> tuple[list[NodeProto], list[onnx.TensorProto]]:
    """Nodes and constants that make bytes `large` of bytes `small` (N, *shape)."""
    channels, height, width = shape
    rows: dict[str, NDArray[np.int64]] = {
        "column": np.array([-1, height, width, 1, channels]),
        "row": np.array([-1, height, 1, 2 * width * channels]),
        "whole": np.array([-1, 2 * height, 2 * width, channels]),
    }
    constants = [numpy_helper.from_array(value, f"{name}_{each}_shape") for each, value in rows.items()]
    column, row, whole = (constant.name for constant in constants)

    def node(kind: str, given: list[str], out: str, **attributes: Any) -> NodeProto:
        return helper.make_node(kind, given, [out], name=f"{out}_{kind}", **attributes)

    last, first = f"{name}_channels_last", f"{name}_channels_last_large"
    columns, wide, lines, high = (f"{name}_{each}" for each in ("columns", "wide", "rows", "high"))
    return [
        node("Transpose", [small], last, perm=_CHANNELS_LAST),
        node("Reshape", [last, column], columns),
        node("Concat", [columns, columns], wide, axis=3),
        node("Reshape", [wide, row], lines),
        node("Concat", [lines, lines], high, axis=2),
        node("Reshape", [high, whole], first),
        node("Transpose", [first], large, perm=_CHANNELS_FIRST),
    ], constants


def _shapes(model: onnx.ModelProto) -> dict[str, list[int]]:
    """Channels, height and width of all maps by name."""
    values = onnx.shape_inference.infer_shapes(model).graph.value_info
    return {each.name: [axis.dim_value for axis in each.type.tensor_type.shape.dim][1:] for each in values}
