"""Optimizer and learning rate of a `TrainConfig`."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch

from groundpose._checks import input_error
from groundpose.lab.training.configs import TrainConfig
from groundpose.lab.training.networks import KeypointNetwork


def learning_rate(config: TrainConfig, step: int, steps: int) -> float:
    """Learning rate of a step: divided by 10 at 60/90 and 80/90 of the run, or a cosine after a warm-up."""
    fraction = step / steps
    if config.schedule == "steps":
        return config.learning_rate * 0.1 ** ((fraction >= 60 / 90) + (fraction >= 80 / 90))
    warm = min(1.0, (step + 1) / max(1.0, 0.02 * steps))
    return config.learning_rate * warm * 0.5 * (1.0 + math.cos(math.pi * fraction))


def optimizer(network: KeypointNetwork, config: TrainConfig) -> torch.optim.Optimizer:
    """The optimizer of a network's weights. Raises InputError for an unknown one."""
    kinds: dict[str, Callable[..., torch.optim.Optimizer]] = {
        "adam": torch.optim.Adam,
        "adamw": torch.optim.AdamW,
    }
    if config.optimizer not in kinds:
        raise input_error("optimizer", "adam or adamw", repr(config.optimizer))
    return kinds[config.optimizer](
        network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay, fused=True
    )
