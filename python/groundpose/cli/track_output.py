"""What `groundpose track` writes, row by row as vehicles leave."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import IO, Any, Protocol

from groundpose.cli.track_input import Followed
from groundpose.formats.tracks import FORMATS, csv_head
from groundpose.tracking import Tracks
from groundpose.types import View
from groundpose.world import World


class Sink(Protocol):
    """Takes rows; every row comes once, those of a vehicle in order."""

    def add(self, tracks: Tracks, complete: int) -> None:
        """More rows; none of a frame before number `complete` is to come."""

    def close(self) -> None:
        """No more rows come."""


@dataclass
class OpenFrames:
    """What is remembered of frames until all their rows are written."""

    names: dict[int, str | int] = field(default_factory=dict)
    times: dict[int, float] = field(default_factory=dict)
    bboxes: dict[int, Any] = field(default_factory=dict)

    def note(self, number: int, frame: Followed, time: float) -> None:
        """One more."""
        self.names[number], self.times[number] = frame.id, time
        self.bboxes[number] = frame.seen.bboxes

    def forget(self, before: int) -> None:
        """All rows of frames before this one are written."""
        for known in (self.names, self.times, self.bboxes):
            for number in [number for number in known if number < before]:
                del known[number]


class TrackRows:
    """Rows as text, to a file or standard output."""

    def __init__(
        self, stream: IO[str], form: str, frames: OpenFrames, view: View, world: World | None
    ) -> None:
        """`form`: a name of `FORMATS`."""
        self.stream, self.frames, self._text = stream, frames, FORMATS[form]
        self._begun = False
        self._more: dict[str, Any] = {"world": world}
        if form == "kitti":
            self._more = {"bboxes": frames.bboxes, "view": view}

    def add(self, tracks: Tracks, complete: int) -> None:
        """Write them at once."""
        if len(tracks):
            self.stream.write(self._text(tracks, self.frames.names, not self._begun, **self._more))
            self._begun = True
        self.stream.flush()

    def close(self) -> None:
        """A table without rows has its header."""
        if not self._begun and self._text is FORMATS["csv"]:
            self.stream.write(csv_head(self._more["world"]))
