"""Pictures in one file of video, by PyAV (extra `video`)."""

from __future__ import annotations

from fractions import Fraction
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import input_error

_OPTIONS = {"crf": "18", "preset": "medium"}
_CLOCK = Fraction(1000)
_USUAL = 30
"""Frames a second that the encoder plans for."""


def check_film(argument: str) -> None:
    """Raises InputError, naming the argument, when PyAV is not installed."""
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise input_error(argument, "pip install 'groundpose[video]' for mp4", f"no {error.name}") from None


class Film:
    """An mp4 (H.264) of pictures of one size; sides of odd length lose a row or column."""

    def __init__(self, path: str | PathLike[str], fps: float | None = None) -> None:
        """Begin the file. `fps`: pictures a second; None: each has the time that it is given with. Raises
        InputError when PyAV is not installed, OSError."""
        check_film("film")
        import av

        self.path = Path(path)
        self._container = av.open(str(path), "w", format="mp4")
        self._clock = _CLOCK if fps is None else Fraction(fps).limit_denominator(1001)
        self._stream: Any = self._container.add_stream("libx264", rate=self._clock if fps else _USUAL)
        self._stream.pix_fmt, self._stream.options = "yuv420p", dict(_OPTIONS)
        self._stream.codec_context.time_base = 1 / self._clock
        self._size: tuple[int, int] | None = None
        self._first, self._last = 0.0, -1

    def add(self, pixels: NDArray[np.uint8], time: float) -> None:
        """One more picture (H, W, 3), shown from `time` (seconds) on. Raises InputError for one of another
        size."""
        import av

        height, width = (side - side % 2 for side in pixels.shape[:2])
        if self._size is None:
            self._size, self._first = (width, height), time
            self._stream.width, self._stream.height = width, height
        if self._size != (width, height):
            raise input_error("film", f"pictures of {self._size}, as the first", (width, height))
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels[:height, :width]), format="rgb24")
        frame.pts = self._last = max(self._last + 1, round((time - self._first) * self._clock))
        frame.time_base = 1 / self._clock
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Complete the file."""
        if self._size is not None:
            self._container.mux(self._stream.encode())
        self._container.close()
