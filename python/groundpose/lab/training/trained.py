"""Networks of finished runs, for inference."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

from groundpose.keypoints.codec import ByteArray
from groundpose.keypoints.decode import Detections
from groundpose.lab.training.configs import NETWORKS, AugmentConfig, TrainConfig
from groundpose.lab.training.networks import KeypointNetwork, folded
from groundpose.lab.training.weights import load_into, read_weights


def config_of(content: dict[str, Any]) -> TrainConfig:
    """The configuration with which a checkpoint was trained."""
    return TrainConfig(**{**content["config"], "augment": AugmentConfig(**content["config"]["augment"])})


def trained(folder: Path) -> tuple[KeypointNetwork, TrainConfig, dict[str, Any]]:
    """Network for inference, configuration and checkpoint of a run."""
    content = read_weights(folder)
    config = config_of(content)
    network = KeypointNetwork(NETWORKS[config.network])
    load_into(network, content["network"])
    return folded(network), config, content


def detector(network: KeypointNetwork, mirrored: bool = False) -> Callable[[ByteArray], Detections]:
    """Function that applies the current network as an exported one is applied."""
    where = network.cell_x.device

    def detect(crops: ByteArray) -> Detections:
        network.eval()
        with torch.no_grad():
            decoded = network.detect(torch.from_numpy(crops).to(where), mirrored)
        return Detections.of(*(value.double().cpu().numpy() for value in decoded))

    return detect
