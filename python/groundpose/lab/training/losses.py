"""Training losses: heat maps near a Gaussian, their mean on the keypoint, the right class."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from groundpose.keypoints.codec import Codec
from groundpose.lab.drive import HIDDEN, OUTSIDE, VISIBLE
from groundpose.lab.training.batches import Batch
from groundpose.lab.training.configs import TrainConfig
from groundpose.lab.training.heat_maps import heat_map_losses
from groundpose.lab.training.networks import KeypointNetwork, Raw


class Losses(NamedTuple):
    """The weighted sum and its parts, scalars."""

    total: Tensor
    cross_entropy: Tensor
    distance: Tensor
    classes: Tensor


class Loss:
    """`cross_entropy * CE(map, Gaussian) + distance * |softargmax - keypoint| + classes * CE(class)`.

    Distances are fractions of the crop's sides. The target map of a keypoint outside the crop is flat, so
    that its spread is large and its score low; keypoints of other classes have no loss.
    """

    def __init__(self, network: KeypointNetwork, codec: Codec, config: TrainConfig) -> None:
        """For the cells of `network`."""
        self._config, self._network, self._sigma = config, network, config.sigma_cells * network.stride
        self._size = torch.tensor([codec.width, codec.height], dtype=torch.float32)
        weights = {OUTSIDE: 0.5 * config.hidden_weight, HIDDEN: config.hidden_weight, VISIBLE: 1.0}
        self._weights = torch.tensor([weights[state] for state in sorted(weights)])

    def __call__(self, raw: Raw, batch: Batch) -> Losses:
        """The losses of a batch; maps and logits in any precision."""
        own = torch.isfinite(batch.keypoints).all(dim=2)
        points = torch.nan_to_num(batch.keypoints)
        inside = own & ((points > -0.5) & (points < self._size - 0.5)).all(dim=2)
        cell_x, cell_y = self._network.cell_x, self._network.cell_y
        gaussian_x = self._gaussian(cell_x, points[..., 0], inside)
        gaussian_y = self._gaussian(cell_y, points[..., 1], inside)
        entropy, means = heat_map_losses(raw.maps, gaussian_x, gaussian_y, cell_x, cell_y)
        weight = self._weights[batch.state.long()] * own
        cross_entropy = (entropy * weight).sum() / weight.sum().clamp(min=1.0)
        weight = weight * inside
        offsets = ((means - points) / self._size).abs().sum(dim=2)
        distance = (offsets * weight).sum() / weight.sum().clamp(min=1.0)
        classes = functional.cross_entropy(raw.logits.float(), batch.class_index)
        c = self._config
        total = c.cross_entropy * cross_entropy + c.distance * distance + c.classes * classes
        return Losses(total, cross_entropy, distance, classes)

    def _gaussian(self, cells: Tensor, places: Tensor, inside: Tensor) -> Tensor:
        """Weights (N, K, cells) that sum to 1; equal ones for points outside the crop."""
        exponent = -0.5 * ((cells - places[..., None]) / self._sigma) ** 2
        return (exponent * inside[..., None]).softmax(dim=2)
