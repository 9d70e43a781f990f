"""Random changes to crops, drawn anew each time: other light, other cameras, coarser and noisier pictures.

Real streets are darker, softer and noisier than renders. All random numbers are drawn by NumPy on the
processor (`draw`) and applied by PyTorch where the pictures are (`Looks`), so a recipe gives the same
pictures on every device, up to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from groundpose.lab.training.configs import AugmentConfig

_DARKEST, _BRIGHTEST = 0.1, 0.65  # limits of a picture's mean brightness after a change of light
_GREY = (0.299, 0.587, 0.114)
_LEVELS = 24  # of coarser resolution
_SHADE = (3, 4)  # rows and columns of uneven light

Floats = NDArray[np.float32]
Rows = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Changes:
    """What happens to each of N pictures; the rows of a change that is not made mean nothing.

    Attributes:
        coarse, shaded, covered, sharpened, noisy: (N,) whether the change is made.
        level: (N,) of resolution, 0 to `_LEVELS` - 1. shade: (N, 3, 4) factors of light.
        gamma, gain, contrast, saturation, veil: (N,). balance, haze: (N, 3).
        cover: (N, 4) left, top, right, bottom of a thing in front, fractions of the crop; colour: (N, 3).
        sharpness: (N,) below 0 blurs. noise: (N,) standard deviation. corner: (N, 2) row and column of the
            stored noise, fractions.
    """

    coarse: NDArray[np.bool_]
    shaded: NDArray[np.bool_]
    covered: NDArray[np.bool_]
    sharpened: NDArray[np.bool_]
    noisy: NDArray[np.bool_]
    level: Rows
    shade: Floats
    gamma: Floats
    gain: Floats
    contrast: Floats
    saturation: Floats
    veil: Floats
    balance: Floats
    haze: Floats
    cover: Floats
    colour: Floats
    sharpness: Floats
    noise: Floats
    corner: Floats

    def __getitem__(self, part: slice) -> Changes:
        """Those of some pictures."""
        return Changes(**{field.name: getattr(self, field.name)[part] for field in fields(self)})


def draw(n: int, how: AugmentConfig, rng: np.random.Generator) -> Changes:
    """Changes for `n` pictures.

    Gamma, darkening, overexposure, contrast, coloured haze, desaturation and white balance halved the error
    on real streets.
    """
    tone = how.tone
    dark = rng.random(n) < tone / 3.0
    bright = ~dark & (rng.random(n) < tone / 4.0)
    gain = np.where(dark, rng.uniform(0.3, 0.8, n), np.exp(tone * rng.normal(0.0, 0.2, n)))
    gain = np.where(bright, rng.uniform(1.2, 2.2, n), gain)
    middle, half = rng.random((n, 2)), 0.5 * rng.uniform((0.08, 0.1), (0.38, 0.6), (n, 2))
    numbers: dict[str, NDArray[Any]] = {
        "shade": np.exp(rng.normal(0.0, 0.5, (n, *_SHADE))),
        "gamma": np.exp(tone * rng.uniform(np.log(0.5), np.log(2.1), n)),
        "gain": gain,
        "contrast": np.exp(tone * rng.normal(0.0, 0.22, n)),
        "saturation": 1.0 - tone * rng.uniform(-0.3, 1.0, n) * (rng.random(n) < 0.6),
        "veil": tone * rng.uniform(0.0, 0.5, n) * (rng.random(n) < 0.25),
        "balance": np.exp(tone * rng.normal(0.0, 0.08, (n, 3))),
        "haze": rng.uniform(0.4, 1.0, (n, 1)) * np.exp(rng.normal(0.0, 0.05, (n, 3))),
        "cover": np.concatenate([middle - half, middle + half], axis=1),
        "colour": rng.uniform(0.0, 255.0, (n, 3)),
        "sharpness": rng.uniform(-0.7, 1.5, n),
        "noise": rng.uniform(1.0, 10.0, n),
        "corner": rng.random((n, 2)),
    }
    return Changes(
        coarse=rng.random(n) < how.resolution,
        shaded=rng.random(n) < how.shade * tone,
        covered=rng.random(n) < how.cover,
        sharpened=rng.random(n) < how.sharpen,
        noisy=rng.random(n) < how.noise,
        level=rng.integers(_LEVELS, size=n),
        **{name: value.astype(np.float32) for name, value in numbers.items()},
    )


class Looks:
    """Applies changes to pictures of one size, on one device."""

    def __init__(self, how: AugmentConfig, width: int, height: int, device: torch.device) -> None:
        """For pictures of `width` x `height`."""
        self._how, self._device = how, device
        # Normal numbers cost more than everything else: windows of a stored array are read instead.
        noise = torch.randn(3, 3 * height, 3 * width, generator=torch.Generator().manual_seed(0)).to(device)
        self._noise = noise.unfold(1, height, 1).unfold(2, width, 1)
        factors = np.exp(np.linspace(np.log(how.coarsest), 0.0, _LEVELS + 1))[:-1]
        self._coarser = [_stacked([_coarser(n, f) for f in factors]).to(device) for n in (height, width)]
        self._shade = [_scaling(a, b).to(device) for a, b in zip(_SHADE, (height, width), strict=True)]
        self._grey = torch.tensor(_GREY, device=device)
        self._cells = [((torch.arange(n, device=device) + 0.5) / n) for n in (height, width)]

    def __call__(self, x: Tensor, changes: Changes) -> Tensor:
        """Changed pictures (N, 3, h, w), whole numbers 0 to 255. `x` is overwritten."""
        self._change(x, changes.coarse, self._resolution, changes.level)
        self._change(x, changes.shaded, self._light, changes.shade)
        if self._how.tone > 0.0:
            x = self._tones(x, changes)
        self._change(x, changes.covered, self._cover, changes.cover, changes.colour)
        self._change(x, changes.sharpened, self._sharper, changes.sharpness)
        self._change(x, changes.noisy, self._grain, changes.noise, changes.corner)
        return x.clamp_(0.0, 255.0).round_()

    def _change(self, x: Tensor, chosen: NDArray[np.bool_], how: Any, *numbers: NDArray[Any]) -> None:
        """Change some of the pictures in place."""
        rows = np.flatnonzero(chosen)
        if len(rows):
            index = self._on(rows)
            x[index] = how(x[index], *(self._on(values[rows]) for values in numbers))

    def _on(self, values: NDArray[Any]) -> Tensor:
        return torch.from_numpy(values).to(self._device, non_blocking=True)

    def _resolution(self, x: Tensor, level: Tensor) -> Tensor:
        """Down by averaging, up again by interpolation."""
        rows, columns = (table[level][:, None] for table in self._coarser)
        return rows @ x @ columns.transpose(2, 3)

    def _light(self, x: Tensor, shade: Tensor) -> Tensor:
        """A few soft blots of shadow or glare."""
        rows, columns = self._shade
        return x * (rows @ shade @ columns.T)[:, None]

    def _tones(self, x: Tensor, changes: Changes) -> Tensor:
        """`matrix @ (value / 255) ** gamma + offset`; bounds on the brightness keep the vehicle visible."""
        gamma, gain, contrast, saturation, veil, balance, haze = (
            self._on(getattr(changes, name))
            for name in ("gamma", "gain", "contrast", "saturation", "veil", "balance", "haze")
        )
        x = x.mul_(1.0 / 255.0).clamp_(1e-4, 1.0)
        now = x.mean(dim=(1, 2, 3)).clamp(min=0.02) ** gamma
        gain = torch.maximum(torch.minimum(gain, (_BRIGHTEST / now).clamp(min=0.0)), _DARKEST / now)
        matrix = saturation[:, None, None] * torch.eye(3, device=x.device)
        matrix = matrix + (1.0 - saturation)[:, None, None] * self._grey
        matrix = matrix * (gain * contrast * (1.0 - veil))[:, None, None] * balance[:, :, None]
        # contrast changes about the picture's own mean
        offset = (now * gain * (1.0 - contrast) * (1.0 - veil))[:, None] + veil[:, None] * haze
        x = x.pow_(gamma[:, None, None, None]).flatten(2)
        return torch.baddbmm(255.0 * offset[:, :, None], 255.0 * matrix, x).unflatten(
            2, self._noise.shape[3:]
        )

    def _cover(self, x: Tensor, cover: Tensor, colour: Tensor) -> Tensor:
        """A plain thing in front."""
        left, top, right, bottom = (cover[:, i, None] for i in range(4))
        rows, columns = self._cells
        inside = ((rows > top) & (rows < bottom))[:, :, None] & ((columns > left) & (columns < right))[
            :, None
        ]
        return torch.where(inside[:, None], colour[:, :, None, None], x)

    def _sharper(self, x: Tensor, sharpness: Tensor) -> Tensor:
        """Sharpen with halos as a camera makes them, or blur a little; the outermost pixels stay."""
        rows = x[:, :, :-2] + x[:, :, 2:] + 2.0 * x[:, :, 1:-1]
        soft = (rows[..., :-2] + rows[..., 2:] + 2.0 * rows[..., 1:-1]) / 16.0
        inner = x[:, :, 1:-1, 1:-1]
        inner += sharpness[:, None, None, None] * (inner - soft)
        return x

    def _grain(self, x: Tensor, noise: Tensor, corner: Tensor) -> Tensor:
        """Sensor noise."""
        row, column = ((corner[:, i] * size).long() for i, size in enumerate(self._noise.shape[1:3]))
        return x + noise[:, None, None, None] * self._noise[:, row, column].transpose(0, 1)


def _coarser(size: int, fraction: float) -> NDArray[np.float64]:
    """Matrix (size, size) that reduces the resolution along one axis to `fraction` of it."""
    fewer = max(4, round(size * fraction))
    return _scaling_matrix(fewer, size) @ _scaling_matrix(size, fewer)


def _scaling(old: int, new: int) -> Tensor:
    return _stacked([_scaling_matrix(old, new)])[0]


def _scaling_matrix(old: int, new: int) -> NDArray[np.float64]:
    """Matrix (new, old) that resamples with a triangle filter as wide as the coarser pixels."""
    ratio = old / new
    centres = (np.arange(new) + 0.5) * ratio - 0.5
    weights = np.maximum(0.0, 1.0 - np.abs(np.arange(old) - centres[:, None]) / max(1.0, ratio))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _stacked(matrices: list[NDArray[np.float64]]) -> Tensor:
    return torch.from_numpy(np.stack(matrices).astype(np.float32))
