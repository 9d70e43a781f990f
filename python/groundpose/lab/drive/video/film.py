"""Pictures in one file of video."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

from groundpose._checks import input_error

_OPTIONS = {"crf": "18", "preset": "medium"}


def check_film() -> None:
    """Raises InputError when PyAV is not installed."""
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise input_error("format", "pip install 'groundpose[video]' for mp4", f"no {error.name}") from None


def write_film(path: Path, pictures: Sequence[Path], fps: float) -> None:
    """An mp4 (H.264) of pictures of one size; sides of odd length lose a row or column.

    Raises:
        InputError: PyAV is not installed. OSError: a picture that cannot be read, a disk that is full.
    """
    check_film()
    import av
    from PIL import Image

    with av.open(str(path), "w", format="mp4") as film:
        stream = film.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
        stream.pix_fmt, stream.options = "yuv420p", _OPTIONS
        for number, picture in enumerate(pictures):
            with Image.open(picture) as image:
                width, height = (side - side % 2 for side in image.size)
                pixels = np.asarray(image.convert("RGB").crop((0, 0, width, height)))
            frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
            if number == 0:
                stream.width, stream.height = width, height
            film.mux(stream.encode(frame))
        film.mux(stream.encode())
