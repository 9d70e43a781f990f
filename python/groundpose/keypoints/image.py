"""Pictures as callers have them: arrays, Pillow images, files, bytes."""

from __future__ import annotations

import io
import struct
import threading
import warnings
from functools import cache
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFile, ImageOps, UnidentifiedImageError

from groundpose._checks import describe, input_error, regular_file, type_error
from groundpose.keypoints.codec import ByteArray

Picture = NDArray[Any] | Image.Image | str | PathLike[str] | bytes | bytearray | memoryview | IO[bytes]
"""What is taken for an image; `as_rgb` says more."""

_WANTED = (
    "an (H, W, 3) uint8 array (RGB), an (H, W) one (grey), a Pillow image, a path, bytes or a file object"
)
_ORIENTATION, _UPRIGHT = 0x0112, 1
"""EXIF's tag and its value for a picture that is stored as it is shown."""
_DRAWINGS = ("EPS", "PDF", "WMF")
"""Formats that other programs would have to draw."""
_FOREIGN = ("BUFR", "GRIB", "HDF5", "MPEG")
"""Formats that Pillow knows by name and cannot read."""
_FILTERS = threading.Lock()
"""The filters of warnings are those of all threads."""
_DEPTHS = (8, 10, 12, 14, 16)
"""Bits that cameras use; a file of 16 bits may hold less."""


def endings() -> frozenset[str]:
    """Endings of names of pictures, ".png": of all formats of pixels that Pillow reads."""
    known = Image.registered_extensions().items()
    return frozenset(end for end, form in known if form in Image.OPEN and form not in (*_DRAWINGS, *_FOREIGN))


def as_rgb(image: Picture, exif: bool = True) -> ByteArray:
    """The picture as (H, W, 3) uint8, red, green, blue.

    Args:
        image: an array (H, W, 3) RGB or (H, W) grey, uint8 (OpenCV's BGR: pass `image[..., ::-1]`); a Pillow
            image; the path of a file, its bytes, or a file object opened for bytes. Palettes and CMYK become
            RGB, grey of 10 to 16 bits is scaled to 8, transparency is ignored.
        exif: whether the rotation that EXIF data asks for is applied, as viewers and OpenCV do: boxes are in
            what they show. False: the pixels as they are stored, which is what a calibration of the sensor
            belongs to.

    Raises:
        OSError: no such file. InputError: a file that is no picture, another shape, floats, no pixels or more
            than `PIL.Image.MAX_IMAGE_PIXELS`. TypeError: another type.
    """
    if isinstance(image, (str, PathLike)):
        return _opened(regular_file(image), str(image), exif)
    if isinstance(image, (bytes, bytearray, memoryview)):
        return _opened(io.BytesIO(image), "image", exif)
    if isinstance(image, Image.Image):
        return _converted(image, "image", exif)
    if isinstance(image, np.ma.MaskedArray):
        raise type_error("image", f"{_WANTED}, not a masked one", image)
    if isinstance(image, np.ndarray):
        return _checked(image)
    if callable(getattr(image, "read", None)):
        return _opened(image, str(getattr(image, "name", "image")), exif)
    raise type_error("image", _WANTED, image)


def _opened(source: Path | IO[bytes], name: str, exif: bool) -> ByteArray:
    try:
        with _FILTERS, warnings.catch_warnings():  # Pillow warns of what is refused here
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            picture = Image.open(source)
        with picture:
            return _converted(picture, name, exif, is_file=True)
    except UnidentifiedImageError:
        raise input_error(name, "a picture", "another kind of file") from None
    except Image.DecompressionBombError:
        raise _too_large(name, "more") from None
    except (SyntaxError, EOFError, ValueError, TypeError, struct.error) as error:
        raise input_error(name, "a whole picture", error) from None
    except OSError as error:
        if error.errno is None:  # Pillow's own, for damaged files
            raise input_error(name, "a whole picture", error) from None
        raise


def _too_large(name: str, got: str) -> Exception:
    most = (Image.MAX_IMAGE_PIXELS or 0) / 1e6
    return input_error(name, f"at most {most:.0f} million pixels (PIL.Image.MAX_IMAGE_PIXELS)", got)


def _converted(picture: Image.Image, name: str, exif: bool, is_file: bool = False) -> ByteArray:
    width, height = picture.size
    if 0 in picture.size:
        raise input_error(name, "at least one pixel", f"{width} x {height}")
    if picture.format in _DRAWINGS:
        raise input_error(name, "a picture of pixels", picture.format)
    if Image.MAX_IMAGE_PIXELS is not None and width * height > Image.MAX_IMAGE_PIXELS:
        raise _too_large(name, f"{width} x {height}")
    shown = _upright(picture) if exif else picture
    if shown.mode.startswith("I"):
        return _checked(_eight_bits(np.asarray(shown)))
    if shown.mode.startswith("F"):
        raise input_error(name, "whole numbers", f"mode {shown.mode}; scale it to 0..255 first")
    try:
        if is_file and shown is picture and (pixels := _fast_jpeg(picture)) is not None:
            return pixels
        # an RGBA picture is cut, not blended with black
        return np.asarray(shown if shown.mode == "RGB" else shown.convert("RGB"))
    except ValueError:
        raise input_error(name, "colours, grey or a palette", f"mode {shown.mode}") from None


def _fast_jpeg(picture: Image.Image) -> ByteArray | None:
    """The pixels of a JPEG file that Pillow has opened, by simplejpeg (extra `jpeg`): the same decoder into
    one array, without Pillow's copies. None: Pillow reads it, and says what is wrong with it."""
    if not isinstance(picture, ImageFile.ImageFile) or (picture.format, picture.mode) != ("JPEG", "RGB"):
        return None
    if picture.fp is None or not _has_simplejpeg():
        return None
    from simplejpeg import decode_jpeg

    file = picture.fp
    file.seek(0)
    try:
        pixels: ByteArray = decode_jpeg(file.read(), "RGB", fastdct=False, fastupsample=False, strict=True)
    except ValueError:
        return None
    return pixels if pixels.shape == (picture.height, picture.width, 3) else None


@cache
def _has_simplejpeg() -> bool:
    return find_spec("simplejpeg") is not None


def _upright(picture: Image.Image) -> Image.Image:
    """Turned as its EXIF data asks; data that cannot be read ask for nothing."""
    try:
        if picture.getexif().get(_ORIENTATION, _UPRIGHT) == _UPRIGHT:
            return picture
        turned: Image.Image = ImageOps.exif_transpose(picture)
        return turned
    except (SyntaxError, ValueError, KeyError, TypeError, struct.error):
        return picture


def _eight_bits(grey: NDArray[Any]) -> ByteArray:
    """Grey of more bits, by the smallest usual number of bits that holds its brightest pixel."""
    most = int(grey.max(initial=0))
    bits = next((b for b in _DEPTHS if most < 2**b), most.bit_length())
    scaled = np.clip(grey, 0, None) * (255.0 / (2**bits - 1))
    made: ByteArray = (scaled + 0.5).astype(np.uint8)
    return made


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
