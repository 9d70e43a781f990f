"""The results of a run that is not finished, from which the same command goes on.

Beside the results lie, until they are complete, `.NAME.part` with the text so far, and `.NAME.run`: a line of
what the run was asked, then a line for each finished item. A line that a kill cut off, and text that belongs
to no finished item, are taken away when the run goes on.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from groundpose._writing import whole_path

Settings = dict[str, Any]


class Journal:
    """Results on their way to `target`, in its folder.

    Args:
        target: the file of the results, or a name in the folder of results that are files of their own.
        settings: what decides the results; None: nobody can tell, so nothing is ever gone on with.
        head: text before that of the first item.
        convert: makes the target of the text, `convert(part, target)`; None: the text is the target.
        there: whether the file of a finished frame, by its name, is still there.

    Attributes:
        done: numbers of the items that an interrupted run has finished.
        dropped: whether an interrupted run of other settings is not gone on with.
        items, vehicles, poses: how many are finished, those of `done` included.
        names: of the files of frames that are finished.

    Raises:
        OSError: naming the file.
    """

    def __init__(
        self,
        target: Path,
        settings: Settings | None,
        head: str = "",
        convert: Callable[[Path, Path], None] | None = None,
        there: Callable[[str], bool] = lambda name: True,
    ) -> None:
        """Go on with what is there, or begin."""
        self.target = target = Path(os.path.realpath(target))  # a link stays a link
        self._convert, self._there = convert, there
        self.part = target.with_name(f".{target.name}.part")
        self.record = target.with_name(f".{target.name}.run")
        self.done: set[int] = set()
        self.names: set[str] = set()
        self.items = self.vehicles = self.poses = 0
        self.dropped = self._shown = False
        first: dict[str, Any] = {"settings": settings, "head": len(head.encode())}
        self._end = len(head.encode())
        if not self._goes_on(json.loads(json.dumps(first))):
            self._begin(first, head)

    def _goes_on(self, first: dict[str, Any]) -> bool:
        """Whether there is something to go on with; then the files end with the last finished item."""
        lines = self._lines_there()
        if len(lines) < 2:
            return False
        if first["settings"] is None or lines[0][0] != first:
            self.dropped = True
            return False
        shown = not self.part.exists()
        there = self.target if shown else self.part
        size = there.stat().st_size if there.exists() else -1
        kept = 0
        for line, length in lines:
            if line.get("end", 0) > size:
                break
            kept += length
            self._take(line)
        if not self.done:
            return False
        if shown:
            with whole_path(self.part) as copy:
                shutil.copyfile(self.target, copy)
        self._text, self._lines = (
            _cut(path, end) for path, end in ((self.part, self._end), (self.record, kept))
        )
        if shown:
            self._show_said()
        return True

    def _lines_there(self) -> list[tuple[dict[str, Any], int]]:
        """The whole lines of the record, each with its length."""
        found = []
        with suppress(FileNotFoundError, ValueError), self.record.open("rb") as file:
            for raw in file:
                if raw.endswith(b"\n"):
                    found.append((json.loads(raw), len(raw)))
        return found

    def _take(self, line: dict[str, Any]) -> None:
        self._shown = self._shown or "shown" in line
        if "end" in line and self._there(line["name"]):
            self.done.add(line["item"])
            self.names.add(line["name"].casefold())
            self._count(line)

    def _count(self, line: dict[str, Any]) -> None:
        self._end = line["end"]
        self.items += 1
        self.vehicles += line["vehicles"]
        self.poses += line["poses"]

    def _begin(self, first: dict[str, Any], head: str) -> None:
        if self.dropped and self._convert is None and not self.target.exists() and self.part.exists():
            # What another run has finished is not lost before there is more.
            os.replace(self.part, self.target)
        self._text, self._lines = (path.open("wb", buffering=0) for path in (self.part, self.record))
        self._write(self._text, head.encode())
        self._note(first)

    def add(self, text: str) -> None:
        """More text; it counts when its item is finished."""
        self._write(self._text, text.encode("utf-8", "backslashreplace"))

    def finished(self, item: int, vehicles: int, poses: int, name: str = "") -> None:
        """All of an item is written, under `name` if it has files of its own."""
        end = self._text.tell()
        line = {"item": item, "end": end, "vehicles": vehicles, "poses": poses, "name": name}
        self._note(line)
        self._count(line)

    def show(self) -> bool:
        """Put what is finished in its place, unless other results are there; whether it is."""
        if not self.items or (self.target.exists() and not self._shown):
            return False
        self.close()
        os.truncate(self.part, self._end)
        if self._convert is None:
            os.replace(self.part, self.target)
            return True
        self._convert(self.part, self.target)
        self._lines = self.record.open("ab", buffering=0)
        self._show_said()
        return True

    def _show_said(self) -> None:
        """The target holds results of this run, which later ones may replace."""
        self._shown = True
        self._note({"shown": True})

    def complete(self) -> None:
        """Put the results in their place."""
        os.fsync(self._text.fileno())
        self.close()
        if self._convert is None:
            with suppress(FileNotFoundError):
                shutil.copymode(self.target, self.part)
            os.replace(self.part, self.target)
        else:
            self._convert(self.part, self.target)
        self.forget()

    def _note(self, line: dict[str, Any]) -> None:
        self._write(self._lines, json.dumps(line).encode() + b"\n")

    def _write(self, file: IO[bytes], data: bytes) -> None:
        """All of it, at once: nothing waits in memory for an exit that may not come."""
        view = memoryview(data)
        try:
            while view:
                view = view[file.write(view) :]
        except OSError as error:
            error.filename = str(self.target)
            raise

    def close(self) -> None:
        """Leave everything as it is for the next run."""
        self._text.close()
        self._lines.close()

    def forget(self) -> None:
        """Nothing is to be gone on with."""
        self.close()
        self.part.unlink(missing_ok=True)
        self.record.unlink(missing_ok=True)


def _cut(path: Path, size: int) -> IO[bytes]:
    os.truncate(path, size)
    return path.open("ab", buffering=0)
