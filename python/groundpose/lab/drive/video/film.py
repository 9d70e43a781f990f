"""Pictures of a drive in one file of video."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from groundpose.draw.film import Film


def write_film(path: Path, pictures: Sequence[Path], fps: float) -> None:
    """An mp4 (H.264) of pictures of one size; sides of odd length lose a row or column.

    Raises:
        InputError: PyAV is not installed. OSError: a picture that cannot be read, a disk that is full.
    """
    from PIL import Image

    with closing(Film(path, fps)) as film:
        for number, picture in enumerate(pictures):
            with Image.open(picture) as image:
                film.add(np.asarray(image.convert("RGB")), number / fps)
