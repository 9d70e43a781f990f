"""Training losses: heat maps and places on the keypoints, class, vehicle or nothing, viewing angle, size."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from groundpose.keypoints.codec import Codec
from groundpose.keypoints.decode import VIEWING_ANGLES
from groundpose.lab.drive import HIDDEN, OUTSIDE, VISIBLE
from groundpose.lab.training.batches import Batch
from groundpose.lab.training.configs import TrainConfig
from groundpose.lab.training.crops import NO_STYLE
from groundpose.lab.training.heat_maps import heat_map_losses
from groundpose.lab.training.networks import KeypointNetwork, Raw

_LEAST_SCALE, _LARGEST_SCALE = -6.0, 2.0  # limits of learned log scales


class Losses(NamedTuple):
    """The weighted sum and its parts, scalars."""

    total: Tensor
    cross_entropy: Tensor
    distance: Tensor
    places: Tensor
    classes: Tensor
    vehicle: Tensor
    viewing_angle: Tensor
    size: Tensor
    style: Tensor


class Loss:
    """The sum of the parts, each with its weight of the `TrainConfig`.

    - cross_entropy: of each heat map against a Gaussian at the keypoint. It is flat where the keypoint lies
      outside the crop or there is no vehicle, so that spread is large and the score low.
    - distance: of the softargmax from the keypoint, as a fraction of the crop's sides.
    - places: negative log likelihood of a Laplace distribution about the place that the network states
      directly, for all keypoints, also outside the crop.
    - classes, vehicle, viewing_angle, style: cross-entropies; a viewing angle is shared between two bins.
    - size: negative log likelihood of a normal distribution of log length, height and width.

    Keypoints of other classes have no loss.
    """

    def __init__(self, network: KeypointNetwork, codec: Codec, config: TrainConfig) -> None:
        """For the cells of `network`, on its device."""
        device = network.cell_x.device
        self._config, self._network, self._sigma = config, network, config.sigma_cells * network.stride
        self._size = torch.tensor([codec.width, codec.height], dtype=torch.float32, device=device)
        weights = {OUTSIDE: 0.5 * config.hidden_weight, HIDDEN: config.hidden_weight, VISIBLE: 1.0}
        self._weights = torch.tensor([weights[state] for state in sorted(weights)], device=device)

    def __call__(self, raw: Raw, batch: Batch) -> Losses:
        """The losses of a batch; raw outputs in any precision."""
        vehicle = batch.vehicle.float()
        cross_entropy, distance, places = self._keypoints(raw, batch)
        classes = _mean(
            functional.cross_entropy(raw.classes.float(), batch.class_index, reduction="none"), vehicle
        )
        is_vehicle = functional.binary_cross_entropy_with_logits(raw.vehicle.float(), vehicle)
        angle = _viewing_angle(raw.viewing_angle.float(), batch.alpha)
        size = _sizes(raw.size.float(), batch)
        known = batch.style != NO_STYLE
        style = functional.cross_entropy(
            raw.style.float(), torch.where(known, batch.style, 0), reduction="none"
        )
        parts = {
            "cross_entropy": cross_entropy,
            "distance": distance,
            "places": places,
            "classes": classes,
            "vehicle": is_vehicle,
            "viewing_angle": angle,
            "size": size,
            "style": _mean(style, known.float()),
        }
        total = sum(getattr(self._config, name) * part for name, part in parts.items())
        assert isinstance(total, Tensor)
        return Losses(total, **parts)

    def _keypoints(self, raw: Raw, batch: Batch) -> tuple[Tensor, Tensor, Tensor]:
        own = torch.isfinite(batch.keypoints).all(dim=2)
        points = torch.nan_to_num(batch.keypoints)
        inside = own & ((points > -0.5) & (points < self._size - 0.5)).all(dim=2)
        cell_x, cell_y = self._network.cell_x, self._network.cell_y
        gaussian_x = self._gaussian(cell_x, points[..., 0], inside)
        gaussian_y = self._gaussian(cell_y, points[..., 1], inside)
        entropy, means = heat_map_losses(raw.maps, gaussian_x, gaussian_y, cell_x, cell_y)
        weight = self._weights[batch.state.long()]
        cross_entropy = _mean(entropy, weight * (own | ~batch.vehicle[:, None]))
        offsets = ((means - points) / self._size).abs().sum(dim=2)
        scale = raw.place_scale.float().clamp(_LEAST_SCALE, _LARGEST_SCALE)
        missed = ((self._network.places(raw) - points) / self._size).abs().sum(dim=2)
        # outside the crop nothing else finds a keypoint
        likelihood = missed * torch.exp(-scale) + 2.0 * scale
        return (
            cross_entropy,
            _mean(offsets, weight * inside),
            _mean(likelihood, torch.where(inside, weight, 1.0) * own),
        )

    def _gaussian(self, cells: Tensor, places: Tensor, inside: Tensor) -> Tensor:
        """Weights (N, K, cells) that sum to 1; equal ones for points outside the crop."""
        exponent = -0.5 * ((cells - places[..., None]) / self._sigma) ** 2
        return (exponent * inside[..., None]).softmax(dim=2)


def _mean(values: Tensor, weight: Tensor) -> Tensor:
    """Weighted mean; 0 without weight."""
    return (values * weight).sum() / weight.sum().clamp(min=1.0)


def _viewing_angle(logits: Tensor, alpha: Tensor) -> Tensor:
    known = torch.isfinite(alpha)
    place = (torch.nan_to_num(alpha) / (2.0 * math.pi) * VIEWING_ANGLES) % VIEWING_ANGLES
    low = place.floor().long() % VIEWING_ANGLES
    fraction = place - place.floor()
    log_p = logits.log_softmax(dim=1)
    below, above = (log_p.gather(1, bins[:, None])[:, 0] for bins in (low, (low + 1) % VIEWING_ANGLES))
    return _mean(-((1.0 - fraction) * below + fraction * above), known.float())


def _sizes(answer: Tensor, batch: Batch) -> Tensor:
    """`answer` (N, 6): means of log length, height, width, and logs of their standard deviations."""
    known = torch.isfinite(batch.size).all(dim=1)
    log_size = torch.where(known[:, None], batch.size, 1.0).log()
    scale = answer[:, 3:].clamp(_LEAST_SCALE, _LARGEST_SCALE)
    missed = (log_size - answer[:, :3]) * torch.exp(-scale)
    return _mean((0.5 * missed**2 + scale).mean(dim=1), known.float())
