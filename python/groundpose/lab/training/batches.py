"""Batches from stored crops: the cut and the changes of each crop are drawn anew each time.

What is drawn at random and all coordinates are computed by NumPy; the pictures are cut and changed by PyTorch
where they lie. A batch is therefore the same on every device, up to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from groundpose._checks import FloatArray
from groundpose.keypoints.codec import FILL, ByteArray, Codec
from groundpose.lab.training.augment import Changes, Looks, draw
from groundpose.lab.training.configs import AugmentConfig
from groundpose.lab.training.crops import NOTHING, Records
from groundpose.vehicles.keypoints import flip_indices

_CHUNK = {"cpu": 8}
"""Number of pictures made at a time: as many as a processor's cache holds; on other devices, all."""
CPU = torch.device("cpu")


@dataclass(frozen=True)
class Batch:
    """A batch of training crops and their labels; tensors are on the device of the pictures.

    Attributes:
        crops: (N, 3, height, width) float, RGB, whole numbers 0 to 255.
        keypoints: (N, K, 2) crop pixels, NaN = not a keypoint of the class.
        state: (N, K) as in the records.
        class_index: (N,) index of the class, 0 where nothing is there.
        vehicle: (N,) bool, whether there is a vehicle.
        alpha: (N,) viewing angle in the crop as shown, NaN = unknown.
        size: (N, 3) length, height, width, metres, NaN = unknown.
        style: (N,) as in the records.
        windows: (N, 4) image pixels that the crops show (before rotation and mirroring).
        labels: (N,) the records.
    """

    crops: Tensor
    keypoints: Tensor
    state: Tensor
    class_index: Tensor
    vehicle: Tensor
    alpha: Tensor
    size: Tensor
    style: Tensor
    windows: FloatArray
    labels: Records

    def pictures(self) -> ByteArray:
        """The crops in the layout used for inference, (N, height, width, 3)."""
        return np.ascontiguousarray(self.crops.permute(0, 2, 3, 1).byte().cpu().numpy())


class Batcher:
    """Makes batches for one size of crop from crops stored with another."""

    def __init__(
        self, codec: Codec, stored: Codec, augment: AugmentConfig | None = None, device: torch.device = CPU
    ) -> None:
        """`augment` None: the boxes of the labels and the stored pictures, unchanged."""
        self.codec, self.stored, self.augment, self.device = codec, stored, augment, device
        self._looks = None if augment is None else Looks(augment, codec.width, codec.height, device)
        self._flip = flip_indices()
        self._fill = torch.tensor(FILL, dtype=torch.float32, device=device)[:, None, None]
        self._x = torch.linspace(0.0, 1.0, codec.width, device=device)[:, None]
        self._y = torch.linspace(0.0, 1.0, codec.height, device=device)[:, None, None]

    def __call__(self, images: Tensor | ByteArray, labels: Records, rng: np.random.Generator) -> Batch:
        """A batch of stored crops (N, 3, h, w) bytes and their records."""
        n = len(labels)
        boxes = labels["box"].astype(np.float64)
        turn = np.broadcast_to(np.eye(2), (n, 2, 2))
        flip = np.zeros(n, dtype=bool)
        changes = None
        if self.augment is not None:
            boxes = _moved(boxes, self.augment, rng)
            flip = rng.random(n) < self.augment.flip
            turn = _turns(np.radians(self.augment.rotation_deg) * rng.normal(size=n), flip)
            changes = draw(n, self.augment, rng)
        windows = self.codec.windows(boxes)
        keypoints, state = self._keypoints(labels, windows, turn, flip)
        # a mirror image shows a vehicle from the other side
        alpha = np.where(flip, np.pi - labels["alpha"], labels["alpha"])
        return Batch(
            self._crops(images, labels, windows, turn, changes),
            self._on(keypoints.astype(np.float32)),
            self._on(state),
            self._on(np.where(labels["kind"] == NOTHING, 0, labels["kind"]).astype(np.int64)),
            self._on(labels["kind"] != NOTHING),
            self._on(alpha.astype(np.float32)),
            self._on(labels["size"].astype(np.float32)),
            self._on(labels["style"].astype(np.int64)),
            windows,
            labels,
        )

    def _on(self, values: NDArray[np.generic]) -> Tensor:
        return torch.from_numpy(values).to(self.device, non_blocking=True)

    def _keypoints(
        self, labels: Records, windows: FloatArray, turn: FloatArray, flip: NDArray[np.bool_]
    ) -> tuple[FloatArray, NDArray[np.uint8]]:
        """Keypoints in crop pixels and their states; left and right are exchanged in mirrored crops."""
        straight = self.codec.crop_from_image(labels["keypoints"].astype(np.float64), windows)
        middle = 0.5 * (self.codec.size - 1.0)
        # `turn` maps an offset in the crop to the offset before rotation; it is orthogonal
        keypoints = np.einsum("nji,npj->npi", turn, straight - middle) + middle
        state = labels["state"].copy()
        keypoints[flip] = keypoints[flip][:, self._flip]
        state[flip] = state[flip][:, self._flip]
        return keypoints, state

    def _crops(
        self,
        images: Tensor | ByteArray,
        labels: Records,
        windows: FloatArray,
        turn: FloatArray,
        changes: Changes | None,
    ) -> Tensor:
        """Crops (N, 3, height, width), cut and changed."""
        n, codec = len(labels), self.codec
        crops = torch.empty(n, 3, codec.height, codec.width, device=self.device)
        chunk = _CHUNK.get(self.device.type, max(n, 1))
        for start in range(0, n, chunk):
            part = slice(start, start + chunk)
            stored = torch.as_tensor(images[part]).to(self.device, non_blocking=True).float()
            own = None if changes is None else changes[part]
            crops[part] = self._pictures(stored, labels[part], windows[part], turn[part], own)
        return crops

    def _pictures(
        self,
        stored: Tensor,
        labels: Records,
        windows: FloatArray,
        turn: FloatArray,
        changes: Changes | None,
    ) -> Tensor:
        """Crops (N, 3, height, width), cut and changed; `FILL` where they lie outside the image."""
        grid, reach = self._grid(labels, windows, turn)
        crops = functional.grid_sample(stored, grid, "bilinear", "border", align_corners=False)
        crops = crops.round_() if self._looks is None or changes is None else self._looks(crops, changes)
        low, high = self._borders(labels)
        rows = np.flatnonzero(((low > -reach) | (high < reach)).any(axis=1))
        if len(rows):
            index = self._on(rows)
            first, last = (self._on(corner[rows].astype(np.float32))[:, None, None] for corner in (low, high))
            outside = ((grid[index] < first) | (grid[index] > last)).any(dim=3)
            crops[index] = torch.where(outside[:, None], self._fill, crops[index])
        return crops

    def _grid(self, labels: Records, windows: FloatArray, turn: FloatArray) -> tuple[Tensor, FloatArray]:
        """Places of the crops' pixels in the stored pictures, (N, height, width, 2) in torch's coordinates,
        and the largest coordinates (N, 2)."""
        codec, stored = self.codec, self.stored
        size, middle = codec.size - 1.0, 0.5 * (codec.size - 1.0)
        corners = size * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
        straight = np.einsum("nij,pj->npi", turn, corners - middle) + middle
        pixels = stored.crop_from_image(codec.image_from_crop(straight, windows), labels["window"])
        places = _torch_places(pixels, stored)
        on_device = self._on(places.astype(np.float32))
        first, right, down = (on_device[:, i, None, None] for i in range(3))
        grid = torch.addcmul(first + (down - first) * self._y, right - first, self._x)
        return grid, np.abs(places).max(axis=1)

    def _borders(self, labels: Records) -> tuple[FloatArray, FloatArray]:
        """The image's first and last corner (N, 2) in the stored pictures, in torch's coordinates."""
        size = labels["image_size"].astype(np.float64)
        corners = np.stack([np.full_like(size, -0.5), size - 0.5], axis=1)
        places = _torch_places(self.stored.crop_from_image(corners, labels["window"]), self.stored)
        return places[:, 0], places[:, 1]


def _torch_places(pixels: FloatArray, stored: Codec) -> FloatArray:
    """Pixels of a stored crop in the coordinates of `grid_sample`: -1 to 1 between its outer sides."""
    return np.asarray((2.0 * pixels + 1.0) / stored.size - 1.0)


def _moved(boxes: FloatArray, how: AugmentConfig, rng: np.random.Generator) -> FloatArray:
    """Boxes with the errors of a detector: a small one on each side, a large one on some boxes."""
    n = len(boxes)
    sides = boxes[:, 2:] - boxes[:, :2]
    amount = np.where(rng.random(n) < how.heavy_chance, how.box_noise_heavy, how.box_noise)
    noise = np.clip(rng.normal(size=(n, 4)), -2.0, 2.0) * amount[:, None]
    return np.asarray(boxes + noise * np.concatenate([sides, sides], axis=1))


def _turns(angles: FloatArray, flip: NDArray[np.bool_]) -> FloatArray:
    """(N, 2, 2) matrices from offsets in a crop to those before rotation and mirroring."""
    c, s = np.cos(angles), np.sin(angles)
    sign = np.where(flip, -1.0, 1.0)
    return np.stack([np.stack([c * sign, -s], axis=1), np.stack([s * sign, c], axis=1)], axis=1)
