"""The frames of a camera or of a stream as they come, by PyAV (extra `video`): the newest one, whatever was
missed."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from threading import Condition, Thread
from typing import Any

from groundpose._checks import input_error
from groundpose._core import InputError
from groundpose._live import ADDRESS, CAMERA, name_of
from groundpose.keypoints.video import VideoFrame, _pixels

_PATIENCE = 10.0
"""Seconds without anything from an address after which it is lost."""
_LOOK = 0.05
"""Seconds between two looks for Ctrl-C."""


class LiveFrames:
    """Frames as they come. One that comes while the one before is still looked at waits; when another comes,
    it is dropped. Numbers and times are those of the source: they leave out what was dropped.

    Attributes:
        name: as it was given. read: how many frames came. dropped: how many of them nobody looked at.

    Raises:
        InputError: PyAV is not installed.
    """

    def __init__(self, path: Path) -> None:
        """Nothing is opened before frames are asked for."""
        if find_spec("av") is None:
            raise input_error(str(path), "PyAV to read cameras, pip install groundpose[video]", "none")
        self.path, self.name, self.read, self.dropped = path, name_of(path), 0, 0
        self._news = Condition()
        self._newest: tuple[int, float, Any] | None = None
        self._error: str | None = None
        self._over = False

    def __iter__(self) -> Iterator[VideoFrame | InputError]:
        """The newest frame, again and again until the source ends; its error, if that ends it."""
        Thread(target=self._fetch, daemon=True).start()
        try:
            first = None
            while (taken := self._taken()) is not None:
                number, seconds, frame = taken
                first = seconds if first is None else first
                yield VideoFrame(number, seconds - first, _pixels(frame, True))
            if self._error is not None:
                yield input_error(self.name, "frames of a camera or a stream", self._error)
        finally:
            self._over = True

    def _taken(self) -> tuple[int, float, Any] | None:
        with self._news:
            while self._newest is None and not self._over:
                self._news.wait(_LOOK)
            taken, self._newest = self._newest, None
            return taken

    def _fetch(self) -> None:
        """Read without a pause, so that nothing waits in the source."""
        import av

        try:
            with _opened(self.name) as container:
                for frame in container.decode(video=0):
                    if self._over:
                        return
                    self._keep(frame)
        except (av.error.FFmpegError, IndexError, OSError) as error:
            self._error = str(getattr(error, "strerror", None) or "nothing with pictures")
        finally:
            with self._news:
                self._over = True
                self._news.notify()

    def _keep(self, frame: Any) -> None:
        seconds = time.monotonic() if frame.pts is None else float(frame.pts * frame.time_base)
        with self._news:
            self.dropped += self._newest is not None
            self._newest = (self.read, seconds, frame)
            self.read += 1
            self._news.notify()


def _opened(name: str) -> Any:
    import av

    # FFmpeg looks at five seconds of a stream before the first frame, and then gives all of them at once.
    soon = {"analyzeduration": "500000"}
    camera = CAMERA.fullmatch(name)
    if camera is not None or (sys.platform == "linux" and name.startswith("/dev/video")):
        return av.open(f"/dev/video{camera[1]}" if camera else name, format="v4l2")
    return av.open(name, options=soon, timeout=_PATIENCE if ADDRESS.match(name) else None)
