"""Random changes to a crop, drawn anew each time: other light, other cameras, coarser and noisier pictures.

Real streets are darker, softer and noisier than renders. Pictures are float tensors (3, h, w) or
(N, 3, h, w), RGB 0 to 255. Most changes are made in place, one picture at a time: one picture fits into the
processor's cache, which saves more time than batching does.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from groundpose._checks import FloatArray
from groundpose.lab.training.configs import AugmentConfig

_DARKEST, _BRIGHTEST = 0.1, 0.65  # limits of a picture's mean brightness after a change of light
_GREY = np.array([0.299, 0.587, 0.114])


class Looks:
    """The changes of an `AugmentConfig` to pictures of one size."""

    def __init__(self, how: AugmentConfig, width: int, height: int) -> None:
        """For pictures of `width` x `height`."""
        self._how, self._width, self._height = how, width, height
        # Drawing normal numbers costs more than everything else: a stored array is read at random offsets.
        self._noise = torch.randn(3, 3 * height, 3 * width, generator=torch.Generator().manual_seed(0))

    def __call__(self, x: Tensor, rng: np.random.Generator) -> Tensor:
        """Changed pictures (N, 3, h, w), whole numbers 0 to 255. `x` is overwritten."""
        how, n = self._how, len(x)
        for i in _some(rng, n, how.resolution):
            _coarser(x[i], float(np.exp(rng.uniform(np.log(how.coarsest), 0.0))))
        for i in _some(rng, n, how.shade * how.tone):
            x[i].mul_(_shade(self._height, self._width, rng))
        if how.tone > 0.0:
            x = x.mul_(1.0 / 255.0).clamp_(1e-4, 1.0)
            gamma, matrix, offset = _tones(x.mean(dim=(1, 2, 3)).numpy(), how.tone, rng)
            x = x.pow_(gamma[:, None, None, None])
            x = torch.baddbmm(offset[:, :, None], matrix, x.flatten(2)).reshape(x.shape)
        for i in _some(rng, n, how.sharpen):
            _sharper(x[i], float(rng.uniform(-0.7, 1.5)))
        for i in _some(rng, n, how.noise):
            row, column = (int(rng.integers(2 * size)) for size in (self._height, self._width))
            piece = self._noise[:, row : row + self._height, column : column + self._width]
            x[i].add_(piece, alpha=float(rng.uniform(1.0, 10.0)))
        return x.clamp_(0.0, 255.0).round_()


def _some(rng: np.random.Generator, n: int, chance: float) -> list[int]:
    """Indices of those of `n` that are chosen."""
    chosen: NDArray[np.intp] = np.flatnonzero(rng.random(n) < chance)
    return chosen.tolist()


def _coarser(x: Tensor, fraction: float) -> None:
    """Reduce a picture's resolution in place: down by averaging, up again by interpolation."""
    height, width = x.shape[1:]
    rows, columns = max(4, round(height * fraction)), max(4, round(width * fraction))
    small = _scaling(height, rows) @ x @ _scaling(width, columns).T
    torch.matmul(_scaling(rows, height) @ small, _scaling(columns, width).T, out=x)


def _shade(height: int, width: int, rng: np.random.Generator) -> Tensor:
    """Uneven light (h, w): a few soft blots of shadow or glare."""
    coarse = _tensor(np.exp(rng.normal(0.0, 0.5, (3, 4))))
    return _scaling(3, height) @ coarse @ _scaling(4, width).T


@cache
def _scaling(old: int, new: int) -> Tensor:
    """Matrix (new, old) that resamples with a triangle filter as wide as the coarser pixels.

    Two matrix products scale a picture faster than torch's own functions do.
    """
    ratio = old / new
    centres = (np.arange(new) + 0.5) * ratio - 0.5
    weights = np.maximum(0.0, 1.0 - np.abs(np.arange(old) - centres[:, None]) / max(1.0, ratio))
    return _tensor(weights / weights.sum(axis=1, keepdims=True))


def _sharper(x: Tensor, amount: float) -> None:
    """Sharpen in place, with halos as a camera makes them; a negative amount blurs a little."""
    rows = x[:, :-2] + x[:, 2:]
    rows.add_(x[:, 1:-1], alpha=2.0)
    soft = rows[:, :, :-2] + rows[:, :, 2:]
    soft.add_(rows[:, :, 1:-1], alpha=2.0)
    inner = x[:, 1:-1, 1:-1]
    inner.mul_(1.0 + amount).sub_(soft, alpha=amount / 16.0)


def _tones(
    brightness: NDArray[np.floating[Any]], strength: float, rng: np.random.Generator
) -> tuple[Tensor, Tensor, Tensor]:
    """Gamma (N,), colour matrix (N, 3, 3), offset (N, 3) of `matrix @ (value / 255) ** gamma + offset`, for
    pictures of a mean brightness (N,), 0 to 1.

    Gamma, darkening, overexposure, contrast, coloured haze, desaturation, white balance. These changes halved
    the error on real streets. Bounds on the brightness keep the vehicle visible.
    """
    n = len(brightness)
    gamma = np.exp(strength * rng.uniform(np.log(0.5), np.log(2.1), n))
    dark = rng.random(n) < strength / 3.0
    bright = ~dark & (rng.random(n) < strength / 4.0)
    gain = np.where(dark, rng.uniform(0.3, 0.8, n), np.exp(strength * rng.normal(0.0, 0.2, n)))
    gain = np.where(bright, rng.uniform(1.2, 2.2, n), gain)
    now = np.maximum(brightness, 0.02) ** gamma
    gain = np.clip(gain, _DARKEST / now, np.maximum(_BRIGHTEST / now, _DARKEST / now))
    contrast = np.exp(strength * rng.normal(0.0, 0.22, n))
    saturation = 1.0 - strength * rng.uniform(-0.3, 1.0, n) * (rng.random(n) < 0.6)
    balance = np.exp(strength * rng.normal(0.0, 0.08, (n, 3)))
    veil = strength * rng.uniform(0.0, 0.5, n) * (rng.random(n) < 0.25)
    haze = rng.uniform(0.4, 1.0, (n, 1)) * np.exp(rng.normal(0.0, 0.05, (n, 3)))
    matrix = saturation[:, None, None] * np.eye(3) + (1.0 - saturation)[:, None, None] * _GREY
    matrix *= (gain * contrast * (1.0 - veil))[:, None, None] * balance[:, :, None]
    # contrast changes about the picture's own mean
    offset = (now * gain * (1.0 - contrast) * (1.0 - veil))[:, None] + veil[:, None] * haze
    return _tensor(gamma), _tensor(255.0 * matrix), _tensor(255.0 * offset)


def _tensor(array: FloatArray) -> Tensor:
    return torch.from_numpy(array.astype(np.float32))
