"""The results of `groundpose estimate` on their way to files: whole or not at all, kept when interrupted."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from groundpose._core import InputError
from groundpose._writing import naming, only_writer, replaceable, write_text
from groundpose.cli.destination import Destination, Inputs, Names
from groundpose.cli.journal import Journal, Settings
from groundpose.cli.output import console, harmless, refuse, standard_output
from groundpose.cli.table import frame_table
from groundpose.draw import check_path
from groundpose.formats import columns, parquet
from groundpose.formats.frames import Frame, FrameObject
from groundpose.formats.records import pose_record
from groundpose.poses import PoseBatch

_OWN_FILES = "results"  # what the journal of a folder with a text for each frame is called


@dataclass(frozen=True)
class Style:
    """How results are written: `record` makes the JSON line of a frame and its poses, `kitti_type` names an
    object in KITTI's text."""

    record: Callable[[Frame, Any], str] = pose_record
    kitti_type: Callable[[FrameObject], str] = lambda item: item.model


_PLAIN = Style()


class Output:
    """Where estimates go, frame by frame.

    Args:
        where: the files.
        form: a name of `FORMATS`.
        inputs: which are never written onto.
        style: of lines and names.
        settings: what decides the results: an interrupted run with the same is gone on with. None: never.

    Attributes:
        journal: of what is finished; None: the results go to a pipe or the terminal, where nothing is undone.

    Raises:
        InputError: another run writes there. OSError: naming the file.
    """

    def __init__(
        self,
        where: Destination,
        form: str,
        inputs: Inputs,
        style: Style = _PLAIN,
        settings: Settings | None = None,
    ) -> None:
        """Take the folder or the file for this run alone."""
        self.where, self.form, self.style, self.inputs = where, form, style, inputs
        self.journal: Journal | None = None
        self.names = Names()
        self._file: IO[str] = sys.stdout if where.place else standard_output()
        lines = where.lines
        if form == "parquet":
            parquet.package()
            if lines is None or not replaceable(lines):
                refuse("--format parquet: expected a file for it, -o FILE.parquet, got a pipe or a terminal")
        with ExitStack() as stack:
            if where.folder is not None:
                where.folder.mkdir(parents=True, exist_ok=True)
                stack.enter_context(only_writer(where.folder))
            if lines is not None and not replaceable(lines):
                self._file = stack.enter_context(lines.open("w", encoding="utf-8"))
            elif lines is not None:
                inputs.refuse(lines, f"-o {lines}: ")
                stack.enter_context(only_writer(lines))
            self._begin(settings)
            self._held = stack.pop_all()

    def _begin(self, settings: Settings | None) -> None:
        head = columns.csv_text([list(columns.COLUMNS)]) if self.form == "csv" else ""
        lines, folder = self.where.lines, self.where.folder
        if lines is not None and self._file is sys.stdout:
            self.journal = Journal(lines, settings, head, parquet.convert if self.form == "parquet" else None)
        elif lines is None and folder is not None:
            self.journal = Journal(
                folder / _OWN_FILES,
                settings,
                convert=lambda part, target: None,
                there=lambda name: (folder / f"{name}.txt").exists(),
            )
        elif head:
            self._file.write(head)
        if self.journal is not None:
            self.names.taken |= self.journal.names

    @property
    def done(self) -> set[int]:
        """Numbers of the items that an interrupted run has finished."""
        return set() if self.journal is None else self.journal.done

    @property
    def place(self) -> Path | None:
        """The file or folder of the results; None: standard output."""
        return self.where.place

    @property
    def named(self) -> bool:
        """Whether each frame has a file of its own."""
        return self.where.lines is None and self.where.folder is not None

    @property
    def on_terminal(self) -> bool:
        """Whether the results are shown on a terminal."""
        return self.journal is None and self._file.isatty()

    def write(self, frame: Frame, poses: PoseBatch, name: str) -> None:
        """One frame, whose own file is called `name`; in the pipe or the file when this returns."""
        if self.journal is None:
            with naming(self.place or "standard output"):
                self._put(self._text(frame, poses))
        elif self.named and self.where.folder is not None:
            path = self.where.folder / f"{name}.txt"
            self.inputs.refuse(path)
            write_text(path, self._text(frame, poses), sync=False)
        else:
            self.journal.add(self._text(frame, poses))

    def _put(self, text: str) -> None:
        safe = self.form == "table" or not self.on_terminal
        self._file.write(text if safe else harmless(text, keep="\n\t"))
        self._file.flush()

    def finished(self, item: int, vehicles: int, poses: int, name: str) -> None:
        """All of a frame is written, with so many vehicles and poses."""
        if self.journal is not None:
            self.journal.finished(item, vehicles, poses, name)

    def _text(self, frame: Frame, poses: PoseBatch) -> str:
        rows = columns.rows(frame, poses) if self.form in ("csv", "parquet") else ()
        if self.form == "csv":
            return columns.csv_text(list(rows))
        if self.form == "parquet":
            return "".join(json.dumps(row) + "\n" for row in rows)
        if self.form == "kitti":
            return self._kitti(frame, poses)
        if self.form == "table":
            return self._table(frame, poses)
        return self.style.record(frame, poses) + "\n"

    def _table(self, frame: Frame, poses: PoseBatch) -> str:
        """With the colours and the width of the terminal, if it is one."""
        screen = console(file=self._file)
        with screen.capture() as shown:
            screen.print(frame_table(frame, poses))
        return shown.get()

    def _kitti(self, frame: Frame, poses: PoseBatch) -> str:
        """With the detector's scores where all objects have one."""
        scores = [o.score for o in frame.objects if o.score is not None]
        types = [self.style.kitti_type(o) for o in frame.objects]
        return poses.to_kitti(types, scores if len(scores) == len(types) else None)

    def complete(self) -> None:
        """All that could be done is done: the results are put in their place, if there are any."""
        if self.journal is None:
            return
        if self.journal.items:
            self.journal.complete()
        else:
            self.journal.forget()

    def interrupted(self) -> str:
        """Put what is finished in its place, or leave it to the next run; what to say of it."""
        if self.journal is None:
            return ""
        if not self.journal.items:
            self.journal.forget()
            return ""
        shown = self.journal.show() or self.where.lines is None
        until = "" if shown else f", until then they are in {self.journal.part}"
        return f"; the same command goes on{until}"

    def close(self) -> None:
        """Close the files, give up the folder."""
        if self.journal is not None:
            self.journal.close()
        self._held.close()


class Pictures:
    """`--draw`: one picture per frame."""

    def __init__(self, path: Path, several: bool, inputs: Inputs) -> None:
        """A usage error if it is no picture's name, or several frames would overwrite one picture."""
        try:
            check_path(path)
        except InputError as error:
            refuse(f"--draw: {error}")
        if several and "{id}" not in path.name:
            refuse("--draw: several frames need {id} in the name, as in --draw 'frame_{id}.png'")
        self.path, self.inputs = path, inputs
        self._read: set[Path] = set()
        self._drawn: set[Path] = set()

    def write(
        self, frame: Frame, poses: PoseBatch, image: NDArray[np.uint8] | None = None, name: str = ""
    ) -> None:
        """Draw one frame over `image`, or over the one it names, if it names one; `name` is its `{id}`."""
        if image is None and frame.image is not None:
            from groundpose.keypoints.image import as_rgb  # with Pillow, which few runs need

            image = as_rgb(frame.image)
        path = self.path.with_name(self.path.name.replace("{id}", name))
        if frame.image is not None:
            self._read.add(frame.image.resolve())
        if path.resolve() in self._read:
            raise InputError(f"{path}: is the image; give the picture another name")
        if self._may_be_read_later(path):
            raise InputError(f"{path}: is there, and may be an image; give another folder")
        self.inputs.refuse(path)
        path.parent.mkdir(exist_ok=True)
        poses.draw(image, path, truth=frame.truth)
        self._drawn.add(path)

    def _may_be_read_later(self, path: Path) -> bool:
        """Whether a later frame of a pipe may name it: nobody can look at those before."""
        if str(self.inputs.source) != "-" or path in self._drawn or not path.exists():
            return False
        return path.resolve().parent in {image.parent for image in self._read}
