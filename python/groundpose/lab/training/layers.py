"""Layers of the networks: residual blocks, heads of heat maps, the small heads beside them."""

from __future__ import annotations

import itertools

import torch
from torch import Tensor, nn
from torch.nn import functional

from groundpose.keypoints.decode import VIEWING_ANGLES
from groundpose.lab.bodies import STYLE_NAMES
from groundpose.vehicles.keypoints import KEYPOINTS

HIDDEN_WIDTH = 256
"""Width of the layers before the small heads."""


class ConvNorm(nn.Module):
    """Convolution (or transposed convolution), batch normalisation and ReLU unless disabled."""

    def __init__(
        self, inputs: int, outputs: int, kernel: int, stride: int = 1, *, relu: bool = True, up: bool = False
    ) -> None:
        """`up`: transposed, doubling the size."""
        super().__init__()
        self.conv: nn.Conv2d | nn.ConvTranspose2d
        if up:
            self.conv = nn.ConvTranspose2d(
                inputs, outputs, kernel, stride, (kernel - stride) // 2, bias=False
            )
        else:
            self.conv = nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False)
        self.norm: nn.Module = nn.BatchNorm2d(outputs)
        self.relu = relu

    def forward(self, x: Tensor) -> Tensor:
        """(N, inputs, h, w) to (N, outputs, h', w')."""
        x = self.norm(self.conv(x))
        return functional.relu(x, inplace=True) if self.relu else x

    def fold(self) -> None:
        """Fold the normalisation into the convolution's weights, for inference only."""
        norm = self.norm
        assert isinstance(norm, nn.BatchNorm2d)
        assert norm.running_mean is not None
        assert norm.running_var is not None
        factor = norm.weight.detach() * torch.rsqrt(norm.running_var + norm.eps)
        shape = (1, -1, 1, 1) if isinstance(self.conv, nn.ConvTranspose2d) else (-1, 1, 1, 1)
        self.conv.weight.data *= factor.reshape(shape)
        self.conv.bias = nn.Parameter(norm.bias.detach() - norm.running_mean * factor)
        self.norm = nn.Identity()


class Block(nn.Module):
    """A residual block (He et al., 2016): two 3 x 3 convolutions, or 1 x 1, 3 x 3, 1 x 1."""

    def __init__(self, inputs: int, width: int, stride: int, bottleneck: bool) -> None:
        """`inputs` channels to `width` (4 `width` with a bottleneck)."""
        super().__init__()
        outputs = 4 * width if bottleneck else width
        if bottleneck:
            path = [
                ConvNorm(inputs, width, 1),
                ConvNorm(width, width, 3, stride),
                ConvNorm(width, outputs, 1, relu=False),
            ]
        else:
            path = [ConvNorm(inputs, width, 3, stride), ConvNorm(width, outputs, 3, relu=False)]
        self.path = nn.Sequential(*path)
        same = stride == 1 and inputs == outputs
        self.shortcut = nn.Identity() if same else ConvNorm(inputs, outputs, 1, stride, relu=False)

    def forward(self, x: Tensor) -> Tensor:
        """(N, inputs, h, w) to (N, outputs, h / stride, w / stride)."""
        return functional.relu(self.path(x) + self.shortcut(x), inplace=True)


class DeconvHead(nn.Sequential):
    """Transposed convolutions on the last stage (Xiao et al., 2018: simple baselines)."""

    def __init__(self, channels: list[int], widths: tuple[int, ...], maps: int) -> None:
        """`channels` of the four stages."""
        sizes = (channels[-1], *widths)
        steps = [ConvNorm(a, b, 4, 2, up=True) for a, b in itertools.pairwise(sizes)]
        super().__init__(*steps, nn.Conv2d(sizes[-1], maps, 1))

    def forward(self, stages: list[Tensor]) -> Tensor:
        """Maps from the last stage."""
        maps: Tensor = super().forward(stages[-1])
        return maps


class PyramidHead(nn.Module):
    """A feature pyramid (Lin et al., 2017): 1 x 1 laterals, nearest upsampling, 3 x 3 per level, stride 4."""

    def __init__(self, channels: list[int], widths: tuple[int, ...], maps: int) -> None:
        """`channels` of the four stages; one width for all levels."""
        super().__init__()
        (width,) = widths
        self.laterals = nn.ModuleList([nn.Conv2d(c, width, 1) for c in channels])
        self.smooth = nn.ModuleList([ConvNorm(width, width, 3) for _ in channels[:-1]])
        self.maps = nn.Conv2d(width, maps, 1)

    def forward(self, stages: list[Tensor]) -> Tensor:
        """Maps from all stages."""
        x = self.laterals[-1](stages[-1])
        for i in reversed(range(len(self.smooth))):
            x = functional.interpolate(x, scale_factor=2.0, mode="nearest")
            x = self.smooth[i](x + self.laterals[i](stages[i]))
        maps: Tensor = self.maps(x)
        return maps


HEADS = {"deconv": DeconvHead, "fpn": PyramidHead}


class Extras(nn.Module):
    """What is read from the last stage beside the class: vehicle or nothing, viewing angle, size, style, and
    the places of all keypoints, in the crop or not."""

    def __init__(self, channels: int, cells: int) -> None:
        """`channels` and `cells` of the last stage."""
        super().__init__()
        self.whole = nn.Sequential(nn.Linear(channels, HIDDEN_WIDTH), nn.ReLU())
        self.vehicle = nn.Linear(HIDDEN_WIDTH, 1)
        self.viewing_angle = nn.Linear(HIDDEN_WIDTH, VIEWING_ANGLES)
        self.size = nn.Linear(HIDDEN_WIDTH, 6)
        self.style = nn.Linear(HIDDEN_WIDTH, len(STYLE_NAMES))
        narrow = 32
        self.cells = nn.Sequential(
            nn.Conv2d(channels, narrow, 1), nn.ReLU(), nn.Flatten(),
            nn.Linear(narrow * cells, HIDDEN_WIDTH), nn.ReLU(),
        )  # fmt: skip
        self.place = nn.Linear(HIDDEN_WIDTH, 3 * len(KEYPOINTS))

    def forward(self, stage: Tensor) -> tuple[Tensor, ...]:
        """The fields of `Raw` from `vehicle` on."""
        whole = self.whole(stage.mean(dim=(2, 3)))
        place = self.place(self.cells(stage)).unflatten(1, (len(KEYPOINTS), 3))
        return (
            self.vehicle(whole)[:, 0], self.viewing_angle(whole), self.size(whole), self.style(whole),
            place[..., :2], place[..., 2],
        )  # fmt: skip
