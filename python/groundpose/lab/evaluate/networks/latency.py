"""What every network of the table costs: multiply-adds, parameters, bytes, milliseconds a crop."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import torch

from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.decode import Calibration
from groundpose.keypoints.network import Network
from groundpose.lab.timing import times_of
from groundpose.lab.training.configs import NETWORKS
from groundpose.lab.training.export import export, metadata, quantise
from groundpose.lab.training.networks import KeypointNetwork, folded, multiply_adds

THREADS = (1, 2)
REPEATS, SECONDS = 60, 6.0
"""A network is timed so often, or for so long."""
_DATA = {"source": "none: random weights", "seed": 0, "version": 0}


def cost(name: str) -> dict[str, Any]:
    """A row of `NETWORKS` with random weights: they cost what trained ones do."""
    config = NETWORKS[name]
    torch.manual_seed(0)
    network = KeypointNetwork(config)
    found: dict[str, Any] = {
        "size": f"{config.width} x {config.height}",
        "gmac": multiply_adds(network) / 1e9,
        "paper_gmac": config.gmac,
        "parameters_m": sum(p.numel() for p in network.parameters()) / 1e6,
    }
    codec = Codec(config.width, config.height)
    with tempfile.TemporaryDirectory() as folder:
        full, small = Path(folder) / "full.onnx", Path(folder) / "int8.onnx"
        export(folded(network), full, metadata(codec, Calibration(), "", _DATA, {}, {}))
        quantise(full, small, _noise(codec, 32))
        for weights, path in (("fp32", full), ("int8", small)):
            found[f"{weights}_mb"] = path.stat().st_size / 1e6
            for threads in THREADS:
                found[f"{weights}_ms_{threads}_threads"] = milliseconds(path, threads)
    return found


def milliseconds(path: Path, threads: int) -> float:
    """Median of calls with one crop."""
    network = Network(path, threads)
    crop = _noise(network.codec, 1)
    for _ in range(5):
        network.detect(crop)
    return 1e3 * float(np.median(times_of(lambda: network.detect(crop), REPEATS, SECONDS)))


def _noise(codec: Codec, count: int) -> ByteArray:
    return np.random.default_rng(0).integers(0, 255, (count, codec.height, codec.width, 3), dtype=np.uint8)
