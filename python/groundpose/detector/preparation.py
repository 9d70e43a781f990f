"""Pictures as detectors of each family were trained to see them, and boxes on the way back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from groundpose._checks import FloatArray
from groundpose.keypoints.codec import ByteArray

Size = tuple[int, int]
"""Width and height."""
_GREY = 114
"""Around a picture that keeps its aspect."""
_IMAGENET = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
"""Mean and standard deviation of red, green, blue, of 1."""


@dataclass(frozen=True)
class Placed:
    """Where the picture is in the network's input: its corner and its size there, and its own size."""

    corner: tuple[int, int]
    inside: Size
    image: Size

    def in_image(self, boxes: FloatArray) -> FloatArray:
        """Boxes (N, 4) of the input as pixels of the image, cut at its border."""
        scale = np.array(self.image, dtype=float) / self.inside
        moved = (boxes - (*self.corner, *self.corner)) * (*scale, *scale)
        width, height = self.image
        return np.asarray(moved.clip(0.0, [width, height, width, height]))


@dataclass(frozen=True)
class Preparation:
    """How a picture becomes the input of a network.

    Attributes:
        fit: "centre" and "corner" keep the aspect and put grey around the picture or right of and below it;
            "stretch" fills the input.
        bgr: whether blue comes first.
        scale: of levels 0 to 255.
        normalised: whether ImageNet's mean and standard deviation are applied after `scale`.
    """

    fit: Literal["centre", "corner", "stretch"]
    bgr: bool = False
    scale: float = 1.0 / 255.0
    normalised: bool = False

    def place(self, image: Size, size: Size) -> Placed:
        """Where an image of this size goes in an input of that size."""
        if self.fit == "stretch":
            return Placed((0, 0), size, image)
        ratio = min(size[0] / image[0], size[1] / image[1])
        inside = (_side(image[0] * ratio, size[0]), _side(image[1] * ratio, size[1]))
        free = (size[0] - inside[0], size[1] - inside[1])
        corner = (free[0] // 2, free[1] // 2) if self.fit == "centre" else (0, 0)
        return Placed(corner, inside, image)

    def prepared(self, image: ByteArray, size: Size) -> tuple[NDArray[np.float32], Placed]:
        """(1, 3, height, width) of an RGB image (H, W, 3), and where the image is in it."""
        placed = self.place((image.shape[1], image.shape[0]), size)
        left, top = placed.corner
        canvas = np.full((size[1], size[0], 3), _GREY, dtype=np.uint8)
        shrunk = Image.fromarray(image).resize(placed.inside, Image.Resampling.BILINEAR)
        canvas[top : top + placed.inside[1], left : left + placed.inside[0]] = np.asarray(shrunk)
        levels = (canvas[..., ::-1] if self.bgr else canvas) * np.float32(self.scale)
        if self.normalised:
            mean, deviation = np.array(_IMAGENET, dtype=np.float32)
            levels = (levels - mean) / deviation
        return np.ascontiguousarray(levels.transpose(2, 0, 1)[None]), placed


def _side(pixels: float, most: int) -> int:
    return min(max(round(pixels), 1), most)


LETTERBOX = Preparation("centre")
CORNER_BGR = Preparation("corner", bgr=True, scale=1.0)
STRETCHED = Preparation("stretch")
STRETCHED_IMAGENET = Preparation("stretch", normalised=True)
