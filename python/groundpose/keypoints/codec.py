"""The one owner of the coordinates of crops: image pixel, crop pixel and heat map cell.

Pixel centres are at integer coordinates everywhere, so an image of width W reaches from -0.5 to W - 0.5, and
so does a crop. A *window* is the rectangle `left, top, right, bottom` of the image plane, in pixels, that a
crop shows; its outer sides are the outer sides of the crop's pixels:

    u_image = left + (u_crop + 0.5) * (right - left) / width          (half-pixel convention)
    u_crop  = (cell + 0.5) * stride - 0.5

A window is the box with a margin, widened about its centre to the aspect of the crop. What lies outside the
image has the colour `FILL`, which the network's normalisation turns to nearly zero. Repeating the border
instead would draw streaks that look like edges of a car, and could not be imitated on rendered crops, which
have a picture beyond the border.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from groundpose._checks import FloatArray, input_error, integer, number
from groundpose._core import CROP_FILL, cut_crops

MEAN = (123.7, 116.3, 103.5)
"""Mean of red, green, blue (0 to 255) that the networks subtract (ImageNet's)."""
STD = (58.4, 57.1, 57.4)
"""Standard deviation that the networks divide by."""
FILL = CROP_FILL
"""Colour of what lies outside the image."""
LARGEST_BOX = 1e6
"""Pixels from the image's origin; a side beyond is a mistake, and its window would not fit an int."""
MARGIN = 0.10
"""Fraction of a box's width and height that a window adds on each side."""

ByteArray = NDArray[np.uint8]


@dataclass(frozen=True)
class Codec:
    """Crops of one size.

    Args:
        width, height: pixels of a crop.
        margin: fraction of the box's sides added on each side of it.

    Raises:
        InputError: a size below 1 or a margin below 0. TypeError: not numbers.
    """

    width: int = 128
    height: int = 96
    margin: float = MARGIN

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("width", "height"):
            if integer(name, getattr(self, name)) < 1:
                raise input_error(name, "1 pixel or more", getattr(self, name))
        if not 0.0 <= number("margin", self.margin) < np.inf:
            raise input_error("margin", "0 or more", self.margin)

    @property
    def size(self) -> FloatArray:
        """`width, height` as floats (2,)."""
        return np.array([self.width, self.height], dtype=np.float64)

    def windows(self, bboxes: FloatArray) -> FloatArray:
        """The windows (N, 4) of boxes (N, 4), both `left, top, right, bottom` pixels."""
        centre = 0.5 * (bboxes[:, :2] + bboxes[:, 2:])
        sides = (bboxes[:, 2:] - bboxes[:, :2]) * (1.0 + 2.0 * self.margin)
        half = 0.5 * (sides / self.size).max(axis=1, keepdims=True) * self.size
        return np.concatenate([centre - half, centre + half], axis=1)

    def crop(self, image: ByteArray, bbox: FloatArray) -> ByteArray:
        """The crop (height, width, 3) of a box (4,) of an image (H, W, 3), RGB; see `cut`."""
        return cut(image, self.windows(np.asarray(bbox, dtype=np.float64)[None])[0], self.width, self.height)

    def crops(self, image: ByteArray, bboxes: FloatArray, threads: int = 1) -> ByteArray:
        """The crops (N, height, width, 3) of boxes (N, 4), by so many threads; 0: all cores."""
        return _cut_all(image, self.windows(bboxes), self.width, self.height, threads)

    def image_from_crop(self, points: FloatArray, windows: FloatArray) -> FloatArray:
        """Image pixels (N, P, 2) of crop pixels (N, P, 2) in windows (N, 4)."""
        scale = (windows[:, None, 2:] - windows[:, None, :2]) / self.size
        return np.asarray(windows[:, None, :2] + (points + 0.5) * scale)

    def crop_from_image(self, points: FloatArray, windows: FloatArray) -> FloatArray:
        """Crop pixels (N, P, 2) of image pixels (N, P, 2) in windows (N, 4)."""
        scale = (windows[:, None, 2:] - windows[:, None, :2]) / self.size
        return np.asarray((points - windows[:, None, :2]) / scale - 0.5)


def crop_from_cell(cells: ArrayLike, stride: float) -> FloatArray:
    """Crop pixels of the centres of heat map cells that are `stride` pixels wide."""
    return (np.asarray(cells, dtype=np.float64) + 0.5) * stride - 0.5


def cell_from_crop(pixels: ArrayLike, stride: float) -> FloatArray:
    """Heat map cells (fractional) of crop pixels."""
    return (np.asarray(pixels, dtype=np.float64) + 0.5) / stride - 0.5


def usable(bboxes: FloatArray, width: int, height: int) -> NDArray[np.bool_]:
    """(N,): which boxes (N, 4) are finite, have an area, overlap an image of this size and are no larger than
    `LARGEST_BOX`."""
    left, top, right, bottom = bboxes.T
    with np.errstate(invalid="ignore"):
        inside = (left < width - 0.5) & (top < height - 0.5) & (right > -0.5) & (bottom > -0.5)
        sane = (np.abs(bboxes) <= LARGEST_BOX).all(axis=1)
        return np.asarray(sane & (right > left) & (bottom > top) & inside)


def cut(image: ByteArray, window: FloatArray, width: int, height: int) -> ByteArray:
    """What `window` (4,) of `image` (H, W, 3) shows, as (height, width, 3): the only resampling there is.

    Shrinking averages with a triangle filter over the area that a pixel of the crop covers, enlarging
    interpolates linearly; the bytes are those of Pillow's `BILINEAR`. Of large objects every second (third,
    ...) row and column is read: 1.5 to 3 pixels for one of the crop are enough, and the time no longer grows
    with the object. Outside the image there is `FILL`.
    """
    return np.asarray(_cut_all(image, np.asarray(window)[None], width, height, 1)[0])


def _cut_all(image: ByteArray, windows: FloatArray, width: int, height: int, threads: int) -> ByteArray:
    made = np.empty((len(windows), height, width, 3), dtype=np.uint8)
    cut_crops(image, np.array(windows, dtype=np.float64, order="C"), made, threads)
    return made
