"""Pictures as callers have them: arrays, Pillow images, files."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from groundpose._checks import describe, input_error, type_error
from groundpose.keypoints.codec import ByteArray

Picture = NDArray[Any] | Image.Image | str | PathLike[str]
"""What is taken for an image; `as_rgb` says more."""

_WANTED = "an (H, W, 3) uint8 array (RGB), an (H, W) one (grey), a Pillow image or a path"


def as_rgb(image: Picture) -> ByteArray:
    """The picture as (H, W, 3) uint8, red, green, blue.

    Args:
        image: an array (H, W, 3) RGB or (H, W) grey, uint8 (OpenCV's BGR: pass `image[..., ::-1]`); a Pillow
            image of 8 bits a channel, whose transparency is ignored; or the path of a file. A rotation that a
            file's EXIF data asks for is not applied: the camera's numbers are those of the sensor.

    Raises:
        OSError: no such file. InputError: a file that is no picture, another shape, 16 bits, no pixels.
        TypeError: another type.
    """
    if isinstance(image, (str, PathLike)):
        return _opened(image)
    if isinstance(image, Image.Image):
        return _converted(image, "image")
    if not isinstance(image, np.ndarray):
        raise type_error("image", _WANTED, image)
    return _checked(image)


def _opened(path: str | PathLike[str]) -> ByteArray:
    try:
        with Image.open(path) as picture:
            return _converted(picture, str(path))
    except UnidentifiedImageError:
        raise input_error(str(path), "a picture", "another kind of file") from None
    except (SyntaxError, EOFError, ValueError, Image.DecompressionBombError) as error:
        raise input_error(str(path), "a whole picture", error) from None
    except OSError as error:
        if error.errno is None:  # Pillow's own, for damaged files
            raise input_error(str(path), "a whole picture", error) from None
        raise


def _converted(picture: Image.Image, name: str) -> ByteArray:
    if picture.mode.startswith(("I", "F")):
        raise input_error(name, "8 bits a channel", f"mode {picture.mode}; scale it to 0..255 first")
    if 0 in picture.size:
        raise input_error(name, "at least one pixel", f"{picture.size[0]} x {picture.size[1]}")
    # an RGBA picture is cut, not blended with black
    return np.asarray(picture.convert("RGB"))


def _checked(image: np.ndarray[Any, Any]) -> ByteArray:
    grey = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 1)
    if not grey and (image.ndim != 3 or image.shape[2] != 3):
        raise input_error("image", "shape (H, W, 3) or (H, W)", f"shape {image.shape}")
    if image.dtype != np.uint8:
        hint = "; scale it to 0..255 first" if image.dtype.kind in "uf" else ""
        raise input_error("image", "uint8", f"{describe(image)}{hint}")
    if image.size == 0:
        raise input_error("image", "at least one pixel", f"shape {image.shape}")
    return np.repeat(image.reshape(*image.shape[:2], 1), 3, axis=2) if grey else image
