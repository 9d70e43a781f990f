"""Export of a training run to an ONNX file with metadata, in float16 weights or int8."""

from __future__ import annotations

import json
import logging
import tempfile
import warnings
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn

from groundpose.keypoints.codec import MEAN, STD, ByteArray, Codec
from groundpose.keypoints.decode import Calibration
from groundpose.keypoints.network import FORMAT, FORMAT_VERSION, OUTPUTS, VEHICLE_THRESHOLD
from groundpose.keypoints.onnx import runtime
from groundpose.lab.training.enlarged import enlarge_by_copies
from groundpose.lab.training.networks import Decoded, KeypointNetwork
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS

OPSET = 18
QUANTISED = ("Conv", "ConvTranspose", "Add", "Relu", "Resize", "MaxPool")
"""Operations in int8; softmax and decoding stay in float32, because int8 destroys their accuracy."""


class _Graph(nn.Module):
    """The exported function: bytes (N, height, width, 3) to the outputs."""

    def __init__(self, network: KeypointNetwork, mirrored: bool) -> None:
        super().__init__()
        self.network, self.mirrored = network, mirrored

    def forward(self, crops: Tensor) -> Decoded:
        return self.network.detect(crops, self.mirrored)


def export(
    network: KeypointNetwork,
    path: Path,
    metadata: dict[str, str],
    stored: str = "float16",
    mirrored: bool = False,
) -> None:
    """Write a network with folded normalisations as ONNX.

    Args:
        network: see `networks.folded`.
        path: the file.
        metadata: see `metadata`.
        stored: type of the stored weights, one of `STORED`. They are made float32 when the file is loaded.
        mirrored: average with the maps of the mirror image: twice the time, fewer wrong keypoints.
    """
    example = torch.zeros(2, network.config.height, network.config.width, 3, dtype=torch.uint8)
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter's deprecation warnings
        program = torch.onnx.export(
            _Graph(network, mirrored).eval(),
            (example,),
            input_names=["crops"],
            output_names=list(OUTPUTS[FORMAT_VERSION]),
            dynamic_shapes={"crops": {0: torch.export.Dim("N")}},
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    model = program.model_proto
    STORED[stored](model)
    _describe(model, metadata)
    onnx.save(model, str(path))


def metadata(
    codec: Codec,
    calibration: Calibration,
    command: str,
    data: dict[str, Any],
    config: dict[str, Any],
    metrics: dict[str, float],
) -> dict[str, str]:
    """Metadata of a file; `data` is the index of the crops, with source and seed."""
    said: dict[str, Any] = {
        "mean": MEAN,
        "std": STD,
        "keypoints": [keypoint.name for keypoint in KEYPOINTS],
        "kinds": CLASSES,
        "score_calibration": calibration.numbers,
        "data": {name: data[name] for name in ("source", "seed", "version")},
        "config": config,
        "metrics": {name: round(value, 6) for name, value in metrics.items()},
    }
    return {
        FORMAT: FORMAT_VERSION,
        "groundpose_version": version("groundpose"),
        "width": str(codec.width),
        "height": str(codec.height),
        "margin": repr(codec.margin),
        "channels": "RGB, uint8, (N, height, width, 3)",
        "vehicle_threshold": repr(VEHICLE_THRESHOLD),
        "command": command,
        **{name: json.dumps(value) for name, value in said.items()},
    }


def quantise(path: Path, out: Path, crops: ByteArray) -> None:
    """An int8 version of the file at `path`, its ranges taken from crops (N, height, width, 3).

    Weights are scaled per channel, activations per tensor; only the operations in `QUANTISED` change.
    """
    runtime()
    from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
    from onnxruntime.quantization.shape_inference import quant_pre_process

    class Reader(CalibrationDataReader):  # type: ignore[misc]
        def __init__(self) -> None:
            self._batches: Iterator[ByteArray] = iter(np.array_split(crops, max(1, len(crops) // 16)))

        def get_next(self) -> dict[str, ByteArray] | None:
            batch = next(self._batches, None)
            return None if batch is None else {"crops": batch}

    said = {p.key: p.value for p in onnx.load(str(path)).metadata_props}
    with tempfile.TemporaryDirectory() as folder:
        prepared = Path(folder) / "prepared.onnx"
        quant_pre_process(str(path), str(prepared), skip_symbolic_shape=True)
        quantize_static(
            str(prepared),
            str(out),
            Reader(),
            quant_format=QuantFormat.QDQ,
            op_types_to_quantize=list(QUANTISED),
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            reduce_range=True,  # 7 bits, because 8 bits overflow the 16-bit sums of processors without VNNI
        )
    model = onnx.load(str(out))
    enlarge_by_copies(model)
    _as_float16(model)  # what is left in float32
    _describe(model, {**said, "weights": "int8"})
    onnx.save(model, str(out))


def _describe(model: onnx.ModelProto, said: dict[str, str]) -> None:
    del model.metadata_props[:]
    helper.set_model_props(model, said)
    model.producer_name, model.doc_string = "groundpose", "keypoints of vehicles"
    for node in model.graph.node:  # remove the exporter's stack traces, which hold paths of this machine
        del node.metadata_props[:]
        node.doc_string = ""
    for value in (*model.graph.value_info, *model.graph.input, *model.graph.output):
        del value.metadata_props[:]


def _large(model: onnx.ModelProto, least: int = 64) -> list[TensorProto]:
    """The float32 weights with more numbers than this."""
    weights = model.graph.initializer
    return [w for w in weights if w.data_type == TensorProto.FLOAT and np.prod(w.dims) > least]


def _as_float16(model: onnx.ModelProto) -> None:
    """Store the weights of convolutions and linear layers as float16, followed by a Cast."""
    casts = []
    for weight in _large(model):
        name, value = weight.name, numpy_helper.to_array(weight)
        weight.CopyFrom(numpy_helper.from_array(value.astype(np.float16), name + "_half"))
        casts.append(
            helper.make_node("Cast", [name + "_half"], [name], name=name + "_cast", to=TensorProto.FLOAT)
        )
    _insert(model, casts)


def _as_int8(model: onnx.ModelProto) -> None:
    """Store weights as int8 with a factor for each output channel; what is smaller as float16."""
    nodes = []
    for weight in _large(model, 2000):
        name, value = weight.name, numpy_helper.to_array(weight)
        if value.ndim < 2:
            continue
        factors = np.maximum(np.abs(value.reshape(len(value), -1)).max(axis=1), 1e-12) / 127.0
        whole = np.rint(value / factors.reshape(-1, *[1] * (value.ndim - 1))).astype(np.int8)
        weight.CopyFrom(numpy_helper.from_array(whole, name + "_whole"))
        model.graph.initializer.append(numpy_helper.from_array(factors.astype(np.float32), name + "_factors"))
        given = [name + "_whole", name + "_factors"]
        nodes.append(helper.make_node("DequantizeLinear", given, [name], name=name + "_float", axis=0))
    _insert(model, nodes)
    _as_float16(model)


def _insert(model: onnx.ModelProto, nodes: list[onnx.NodeProto]) -> None:
    """Put nodes before all others."""
    for i, node in enumerate(nodes):
        model.graph.node.insert(i, node)


STORED = {"float32": lambda model: None, "float16": _as_float16, "int8": _as_int8}
"""Types in which weights are stored. Arithmetic is float32 with each of them."""
