"""The frames of a video, by PyAV (extra `video`)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from groundpose._checks import input_error, regular_file
from groundpose._core import InputError
from groundpose.keypoints.codec import ByteArray

_NAMES = ("mp4", "m4v", "mov", "avi", "mkv", "webm", "mpg", "mpeg", "ts", "mts", "m2ts", "wmv")
ENDINGS = frozenset(f".{name}" for name in _NAMES)
"""Of names of videos."""


@dataclass(frozen=True, eq=False)
class VideoFrame:
    """One frame.

    Attributes:
        number: from 0. time: seconds since the first frame; None: the video does not say.
        image: (H, W, 3) uint8, red, green, blue.
    """

    number: int
    time: float | None
    image: ByteArray


def video_frames(path: str | PathLike[str], exif: bool = True) -> Iterator[VideoFrame | InputError]:
    """The frames in the order in which they are shown; for a part that is damaged its error.

    Args:
        path: a file that FFmpeg reads.
        exif: whether frames are turned as the file asks, as players do; see `as_rgb`.

    Raises:
        OSError: no such file. InputError: no video, PyAV is not installed, frames of more than
        `PIL.Image.MAX_IMAGE_PIXELS`.
    """
    file = regular_file(path)
    file.open("rb").close()  # OSError in Python's own words
    if find_spec("av") is None:
        raise input_error(str(path), "PyAV to read videos, pip install groundpose[video]", "none")
    return _frames(file, exif)


def _frames(path: Path, exif: bool) -> Iterator[VideoFrame | InputError]:
    import av

    try:
        container = av.open(str(path))
    except av.error.FFmpegError as error:
        raise input_error(str(path), "a video", error.strerror) from None
    with container:
        if not container.streams.video:
            raise input_error(str(path), "a video", "a file without pictures")
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        size, most = (stream.codec_context.width, stream.codec_context.height), Image.MAX_IMAGE_PIXELS
        if most is not None and size[0] * size[1] > most:
            expected = f"frames of at most {most / 1e6:.0f} million pixels (PIL.Image.MAX_IMAGE_PIXELS)"
            raise input_error(str(path), expected, f"{size[0]} x {size[1]}")
        number, first = 0, None
        for decoded in _decoded(container, stream):
            if isinstance(decoded, av.error.FFmpegError):
                yield input_error(f"{path}: after frame {number - 1}", "a whole video", decoded.strerror)
                continue
            first = decoded.pts if first is None else first
            time = None if decoded.pts is None else float((decoded.pts - first) * decoded.time_base)
            yield VideoFrame(number, time, _pixels(decoded, exif))
            number += 1


def _decoded(container: Any, stream: Any) -> Iterator[Any]:
    """Frames, and errors of packets between them; one of the file itself is the last."""
    import av

    try:
        for packet in container.demux(stream):
            try:
                yield from packet.decode()
            except av.error.FFmpegError as error:
                if not isinstance(error, av.error.EOFError):
                    yield error
    except av.error.FFmpegError as error:
        yield error


def _pixels(frame: Any, exif: bool) -> ByteArray:
    pixels: ByteArray = frame.to_ndarray(format="rgb24")
    turns = round(frame.rotation / 90) % 4 if exif else 0  # counterclockwise
    return np.ascontiguousarray(np.rot90(pixels, turns))
