"""Cross-entropy and softargmax of heat maps in one pass, with their gradient.

As separate torch operations, each a pass over all maps, they took a third of a training step of the paper's
smaller network. Here they are computed crop by crop, in the processor's cache.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

_CELLS = 1 << 17
"""Number of heat-map cells processed at a time: half a megabyte."""


def heat_map_losses(
    maps: Tensor, gaussian_x: Tensor, gaussian_y: Tensor, cell_x: Tensor, cell_y: Tensor
) -> tuple[Tensor, Tensor]:
    """Cross-entropy (N, K) of each map against a Gaussian, and the map's mean (N, K, 2).

    Args:
        maps: (N, K, h, w) before the softmax, in any precision.
        gaussian_x, gaussian_y: (N, K, w) and (N, K, h), whose product is the Gaussian; it is never built.
        cell_x, cell_y: (w,) and (h,) centres of the cells, crop pixels.
    """
    entropy, means = _HeatMapLosses.apply(maps, gaussian_x, gaussian_y, cell_x, cell_y)  # type: ignore[no-untyped-call]
    return entropy, means


class _HeatMapLosses(torch.autograd.Function):
    """With p = softmax(map) and the Gaussian g: d entropy = p - g, d mean = p (cell - mean)."""

    @staticmethod
    def forward(ctx: Any, maps: Tensor, *others: Tensor) -> tuple[Tensor, Tensor]:
        """See `heat_map_losses`."""
        gaussian_x, gaussian_y, cell_x, cell_y = others
        softmax = torch.empty_like(maps)
        entropy, means = torch.empty_like(gaussian_x[..., 0]), torch.empty_like(gaussian_x[..., :2])
        for part in _parts(maps):
            own = maps[part].to(gaussian_x.dtype, memory_format=torch.contiguous_format)
            top = own.amax(dim=(2, 3), keepdim=True)
            p = (own - top).exp_()
            total = p.sum(dim=(2, 3), keepdim=True)
            p /= total
            expected = ((own @ gaussian_x[part][..., None])[..., 0] * gaussian_y[part]).sum(dim=2)
            entropy[part] = (top + total.log())[..., 0, 0] - expected
            means[part] = torch.stack([p.sum(dim=2) @ cell_x, p.sum(dim=3) @ cell_y], dim=2)
            softmax[part] = p
        ctx.save_for_backward(softmax, means, *others)
        return entropy, means

    @staticmethod
    def backward(ctx: Any, entropy: Tensor, means: Tensor) -> tuple[Tensor | None, ...]:
        """Gradient with respect to the maps; the other inputs have none."""
        softmax, mean, gaussian_x, gaussian_y, cell_x, cell_y = ctx.saved_tensors
        gradient = torch.empty_like(softmax)
        along_x = means[..., :1] * (cell_x - mean[..., :1]) + entropy[..., None]
        along_y = means[..., 1:] * (cell_y - mean[..., 1:])
        weighed_y = entropy[..., None] * gaussian_y
        for part in _parts(softmax):
            p = softmax[part].to(gaussian_x.dtype, memory_format=torch.contiguous_format)
            p = p * (along_x[part][..., None, :] + along_y[part][..., None])
            gradient[part] = p.sub_(weighed_y[part][..., None] * gaussian_x[part][..., None, :])
        return gradient, None, None, None, None


def _parts(maps: Tensor) -> list[slice]:
    count = max(1, _CELLS // max(1, maps[0].numel()))
    return [slice(first, first + count) for first in range(0, len(maps), count)]
