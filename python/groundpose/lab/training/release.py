"""Release of a finished run: calibrate scores, measure metrics, write float16 and int8 files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from groundpose._checks import input_error
from groundpose._writing import whole_path
from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.network import Network
from groundpose.lab.training.batches import Batcher
from groundpose.lab.training.crops import Crops
from groundpose.lab.training.evaluate import answers
from groundpose.lab.training.export import STORED, export, metadata, quantise
from groundpose.lab.training.networks import joined
from groundpose.lab.training.trained import detector, trained

_CPU = torch.device("cpu")
RANGES = 256
"""Number of crops from which the ranges of int8 are taken."""


@dataclass(frozen=True)
class Released:
    """The files written, and the metrics of each on the evaluated crops."""

    path: Path
    metrics: dict[str, float]
    int8: Path | None
    int8_metrics: dict[str, float]


def release(
    run: Path,
    data: Path,
    path: Path,
    *,
    int8: Path | None = None,
    others: Sequence[Path] = (),
    mirrored: bool = False,
    stored: str = "float16",
    command: str = "",
    limit: int | None = None,
    device: torch.device = _CPU,
) -> Released:
    """Export the network of a run.

    Args:
        run: folder of the run. data: folder of crops.
        path: ONNX file to write. int8: quantised file to write, or None.
        others: folders of runs whose networks are asked too; the answer is the mean.
        mirrored, stored: see `export`.
        command: that trained the network, for the metadata.
        limit: largest number of crops for calibration and for evaluation.
        device: where the network runs meanwhile.

    Scores are calibrated on the validation crops; metrics are of the test crops if there are any.

    Raises:
        InputError: no run, no crops, an unknown type of stored weights.
    """
    if stored not in STORED:
        raise input_error("stored", f"one of {', '.join(STORED)}", repr(stored))
    network, _, content = trained(run)
    network = joined(network, [trained(other)[0] for other in others])
    codec = Codec(network.config.width, network.config.height)
    validation = Crops(data, "validation", limit)
    detect = detector(network.to(device), mirrored)
    calibration = answers(detect, validation, codec).calibration()
    judged = Crops(data, "test", limit) if any(data.glob("test-*-labels.npy")) else validation
    metrics = answers(detect, judged, codec).metrics(calibration)
    said = metadata(codec, calibration, command, content["data"], content["config"], metrics)
    said |= {
        "mirrored": str(mirrored).lower(),
        "others": json.dumps([trained(other)[1].network for other in others]),
        "steps": f"{content['step']} of {content['steps']}",
        "training_seconds": f"{content['seconds']:.0f}",
        "earlier_run": json.dumps(content["before"]),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_path(path) as part:
        export(network.cpu(), part, said, stored=stored, mirrored=mirrored)
    if int8 is None:
        return Released(path, metrics, None, {})
    with whole_path(int8) as part:
        quantise(path, part, _pictures(Crops(data, "train", RANGES), codec))
    small = Network(int8)
    return Released(path, metrics, int8, answers(small.detect, judged, codec).metrics(calibration))


def _pictures(crops: Crops, codec: Codec) -> ByteArray:
    """Crops cut as for inference, (N, height, width, 3)."""
    images, labels = crops.take(np.arange(len(crops)))
    return Batcher(codec, crops.codec)(images, labels, np.random.default_rng(0)).pictures()
