"""The networks in PyTorch: a residual backbone, heat maps, class and more; decoding inside the graph."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from groundpose._checks import input_error
from groundpose.keypoints.codec import MEAN, STD, crop_from_cell
from groundpose.keypoints.decode import VIEWING_ANGLES
from groundpose.lab.training.configs import NetworkConfig
from groundpose.lab.training.layers import HEADS, Block, ConvNorm, Extras
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS, flip_indices


class Raw(NamedTuple):
    """Output of a network before decoding, for N crops and K keypoints.

    maps (N, K, h, w); classes (N, C) logits; vehicle (N,) logit; viewing_angle (N, 16) logits; size (N, 6)
    means of log length, height, width (metres) and logs of their standard deviations; style (N, S) logits;
    place (N, K, 2) of the keypoints from the crop's middle, fractions of its sides, and place_scale (N, K),
    the log of their mean absolute error.
    """

    maps: Tensor
    classes: Tensor
    vehicle: Tensor
    viewing_angle: Tensor
    size: Tensor
    style: Tensor
    place: Tensor
    place_scale: Tensor


class Decoded(NamedTuple):
    """Decoded output of a network for N crops; see `groundpose.keypoints.decode.Detections`."""

    keypoints: Tensor
    spread: Tensor
    peak: Tensor
    class_probabilities: Tensor
    vehicle: Tensor
    viewing_angle: Tensor


class KeypointNetwork(nn.Module):
    """Backbone and heads of a `NetworkConfig`."""

    cell_x: Tensor
    partner: Tensor
    opposite: Tensor
    sides: Tensor
    cell_y: Tensor
    mean: Tensor
    std: Tensor

    def __init__(self, config: NetworkConfig) -> None:
        """The weights come from torch's random generator: seed it before."""
        super().__init__()
        self.config = config
        widths = config.widths
        if config.stem == "imagenet":
            self.stem = nn.Sequential(ConvNorm(3, 64, 7, 2), nn.MaxPool2d(3, 2, 1))
        else:
            self.stem = nn.Sequential(
                ConvNorm(3, widths[0] // 2, 3, 2), ConvNorm(widths[0] // 2, widths[0], 3, 2)
            )
        channels, inputs = [], 64 if config.stem == "imagenet" else widths[0]
        stages = []
        for i, (width, count) in enumerate(zip(widths, config.blocks, strict=True)):
            blocks = []
            for j in range(count):
                blocks.append(Block(inputs, width, 2 if i > 0 and j == 0 else 1, config.bottleneck))
                inputs = 4 * width if config.bottleneck else width
            stages.append(nn.Sequential(*blocks))
            channels.append(inputs)
        self.stages = nn.ModuleList(stages)
        self.head: nn.Module = HEADS[config.head](channels, config.head_widths, len(KEYPOINTS))
        self.classes = nn.Linear(channels[-1], len(CLASSES))
        self.extras = Extras(channels[-1], (config.height // 32) * (config.width // 32))
        self.others = nn.ModuleList()
        self.stride = 4.0 if config.head == "fpn" else 32.0 / 2 ** len(config.head_widths)
        for name, pixels in (("cell_x", config.width), ("cell_y", config.height)):
            centres = crop_from_cell(np.arange(pixels / self.stride), self.stride)
            self.register_buffer(name, torch.tensor(centres, dtype=torch.float32), persistent=False)
        self.register_buffer("partner", torch.from_numpy(flip_indices()), persistent=False)
        # the bin of alpha as seen in a mirror: pi - alpha
        opposite = (VIEWING_ANGLES // 2 - torch.arange(VIEWING_ANGLES)) % VIEWING_ANGLES
        self.register_buffer("opposite", opposite, persistent=False)
        sides = torch.tensor([config.width, config.height], dtype=torch.float32)
        self.register_buffer("sides", sides, persistent=False)
        self.register_buffer("mean", torch.tensor(MEAN).reshape(1, 3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(STD).reshape(1, 3, 1, 1), persistent=False)

    def forward(self, crops: Tensor) -> Raw:
        """Crops (N, 3, height, width), RGB 0 to 255."""
        return self._raw((crops - self.mean) / self.std)

    def _raw(self, normalised: Tensor) -> Raw:
        x = self.stem(normalised)
        stages = []
        for stage in self.stages:
            x = stage(x)
            stages.append(x)
        return Raw(self.head(stages), self.classes(x.mean(dim=(2, 3))), *self.extras(x))

    def _unmirrored(self, raw: Raw) -> Raw:
        """What the output for mirror images says of the pictures themselves."""
        place = raw.place * torch.tensor([-1.0, 1.0], device=raw.place.device)
        return raw._replace(
            maps=raw.maps.flip(3)[:, self.partner],
            viewing_angle=raw.viewing_angle[:, self.opposite],
            place=place[:, self.partner],
            place_scale=raw.place_scale[:, self.partner],
        )

    def places(self, raw: Raw) -> Tensor:
        """Directly stated places (N, K, 2) of the keypoints, crop pixels."""
        return (raw.place.float() + 0.5) * self.sides - 0.5

    def detect(self, pictures: Tensor, mirrored: bool = False) -> Decoded:
        """The decoded output for bytes (N, height, width, 3), the layout used for inference: of the mean of
        what this network and `others` say.

        `mirrored`: of the mirror images too.
        """
        # By rows: in an 8-bit file with colours last, operations on three numbers take a quarter of the time.
        row = self.config.width
        mean, std = (value.flatten().repeat(row) for value in (self.mean, self.std))
        x = ((pictures.float().flatten(2) - mean) / std).unflatten(2, (row, 3)).permute(0, 3, 1, 2)
        looks = [network._raw(x) for network in (self, *self.others)]
        if mirrored:
            flipped = x.flip(3)
            looks += [network._unmirrored(network._raw(flipped)) for network in (self, *self.others)]
        return self.decode(Raw(*(sum(values) / len(looks) for values in zip(*looks, strict=True))))

    def decode(self, raw: Raw) -> Decoded:
        """Keypoints in the crop from their heat maps: softargmax near the map's peak, the spread of the whole
        map, and its peak. Keypoints outside the crop, where no map reaches, as stated directly; peak 1.

        For a map with two peaks (front or back, left or right wheel) this is the place of the higher one; the
        mean of both would be at neither. The spread is then large.
        """
        weights = raw.maps.flatten(2).softmax(dim=2).unflatten(2, raw.maps.shape[2:])
        peak, cell = weights.flatten(2).max(dim=2)
        columns = len(self.cell_x)
        x, variance_x = self._place(weights.sum(dim=2), self.cell_x, cell % columns)
        y, variance_y = self._place(weights.sum(dim=3), self.cell_y, cell // columns)
        spread = (variance_x + variance_y).sqrt()
        places = self.places(raw)
        outside = ((places < -0.5) | (places > self.sides - 0.5)).any(dim=2)
        # a Laplace distribution of scale b has a variance of 2 b^2 along each axis
        stated = raw.place_scale.float().exp() * (2.0 * (self.sides**2).sum()).sqrt()
        return Decoded(
            torch.where(outside[..., None], places, torch.stack([x, y], dim=2)),
            torch.where(outside, stated, spread),
            torch.where(outside, torch.ones_like(peak), peak),
            raw.classes.softmax(dim=1),
            raw.vehicle.sigmoid(),
            raw.viewing_angle.softmax(dim=1),
        )

    def _place(self, weights: Tensor, cells: Tensor, peak: Tensor) -> tuple[Tensor, Tensor]:
        """Along one axis the mean of the cells near the peak, and the variance of all, from weights (N, K,
        cells) and the index of the peak (N, K)."""
        near = weights * ((cells - cells[peak][..., None]).abs() < self.config.reach * self.config.width)
        mean = (weights * cells).sum(dim=2)
        # about the mean: E[x^2] - E[x]^2 would cancel for small spreads
        variance = (weights * (cells - mean[..., None]) ** 2).sum(dim=2)
        return (near * cells).sum(dim=2) / near.sum(dim=2), variance


def joined(network: KeypointNetwork, others: Sequence[KeypointNetwork]) -> KeypointNetwork:
    """The same network (changed in place) for inference together with others: each is wrong where the others
    seldom are. Raises InputError for crops or maps of another size."""
    for other in others:
        sizes = [(n.config.width, n.config.height, n.stride) for n in (network, other)]
        if sizes[0] != sizes[1]:
            raise input_error("--with", "a network with crops and maps of the same size", str(sizes[1]))
    network.others = nn.ModuleList(others)
    return network


def folded(network: KeypointNetwork) -> KeypointNetwork:
    """The same network (changed in place) for inference: normalisations folded into the convolutions."""
    network.eval()
    for module in network.modules():
        if isinstance(module, ConvNorm):
            module.fold()
    return network


def multiply_adds(network: KeypointNetwork) -> int:
    """Multiply-adds of one crop in convolutions and linear layers, the usual count."""
    total = 0

    def count(module: nn.Module, inputs: tuple[Tensor, ...], output: Tensor) -> None:
        nonlocal total
        if isinstance(module, nn.Linear):
            total += module.in_features * module.out_features
        elif isinstance(module, (nn.Conv2d, nn.ConvTranspose2d)):
            # a kernel is applied once per output cell, a transposed one once per input cell
            cells = (inputs[0] if isinstance(module, nn.ConvTranspose2d) else output)[0, 0].numel()
            total += module.weight.numel() * cells

    hooks = [module.register_forward_hook(count) for module in _leaves(network)]
    was_training = network.training
    network.eval()
    with torch.no_grad():
        network(torch.zeros(1, 3, network.config.height, network.config.width))
    network.train(was_training)
    for hook in hooks:
        hook.remove()
    return total


def _leaves(network: nn.Module) -> Iterator[nn.Module]:
    return (m for m in network.modules() if isinstance(m, (nn.Conv2d, nn.ConvTranspose2d, nn.Linear)))
