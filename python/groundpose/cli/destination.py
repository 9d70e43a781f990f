"""Where results go: the format by the file's ending, a name for each frame, and never onto an input."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from functools import cached_property
from glob import escape
from pathlib import Path

from groundpose._core import InputError
from groundpose.cli.inputs import is_picture
from groundpose.cli.output import refuse

FORMATS = {"jsonl": ".jsonl", "kitti": ".txt", "table": ".txt", "csv": ".csv", "parquet": ".parquet"}
"""Names of the formats, and the ending of a file of each."""
_BY_ENDING = {".jsonl": "jsonl", ".ndjson": "jsonl", ".json": "jsonl", ".csv": "csv", ".parquet": "parquet"}
_BY_ENDING |= {".txt": "kitti"}
_LONGEST = 150  # bytes of a name, of the 255 that file systems allow


def chosen_format(form: str, out: Path | None, images: bool) -> str:
    """The format that `--format` names or the ending of `-o` says; refused when it is none, or they disagree.

    Args:
        form: of `--format`, "" for none.
        out: of `-o`.
        images: whether the input is images, whose results may be named by their picture.
    """
    if form and form not in FORMATS:
        refuse(f"--format: expected {', '.join(FORMATS)}, got {form!r}")
    ending = "" if out is None or out.is_dir() else out.suffix.lower()
    if not ending or (images and out is not None and _is_drawn(out)):
        return form or "jsonl"
    if form in ("kitti", "table") and ending not in _BY_ENDING:
        return form  # a folder of KITTI's texts may be called anything, and so may a table
    if ending not in _BY_ENDING:
        refuse(f"-o {out}: expected a file that ends in {', '.join(_BY_ENDING)}, or a folder, got {ending}")
    meant = _BY_ENDING[ending]
    if form and form != meant and not (form == "table" and meant == "kitti"):
        refuse(f"-o {out}: expected a file that ends in {FORMATS[form]} for --format {form}, got {ending}")
    return form or meant


def _is_drawn(path: Path) -> bool:
    return path.suffix.lower() in (".svg", ".pdf") or is_picture(path)


@dataclass(frozen=True)
class Destination:
    """Files of a run.

    Attributes:
        lines: the file of the results; None: standard output, or files of each frame's own in `folder`.
        pictures: with `{id}` in its name where there are several; None: no pictures.
        folder: of `-o`, if it names one.
    """

    lines: Path | None = None
    pictures: Path | None = None
    folder: Path | None = None

    @property
    def place(self) -> Path | None:
        """The file or folder of the results; None: standard output."""
        return self.lines or self.folder

    @classmethod
    def of_frames(cls, out: Path | None, form: str, several: bool) -> Destination:
        """For frames with keypoints."""
        if form == "kitti" and several:
            return cls(folder=_folder_of_texts(out))
        if out is not None and out.is_dir():
            refuse(f"-o {out}: is a folder; give a file in it")
        return cls(lines=out)

    @classmethod
    def of_images(cls, out: Path | None, form: str, several: bool) -> Destination:
        """For images. A folder (made if it is new) takes lines and pictures. A file of lines has its picture
        (several: a folder of them) beside it under the same name, and a picture its lines."""
        texts = form == "kitti" and several
        if out is None:
            return cls(folder=_folder_of_texts(out)) if texts else cls()
        ending = out.suffix.lower()
        if texts or out.is_dir() or not ending:
            lines = None if texts else out / f"poses{FORMATS[form]}"
            return cls(lines, out / "{id}_poses.png", _folder_of_texts(out) if texts else out)
        if _is_drawn(out):
            return cls(out.with_suffix(FORMATS[form]), out)
        return cls(out, out.with_suffix("") / "{id}_poses.png" if several else out.with_suffix(".png"))


def _folder_of_texts(out: Path | None) -> Path:
    is_file = out is not None and not out.is_dir() and (out.suffix.lower() in _BY_ENDING or out.exists())
    if out is None or is_file:
        refuse("--format kitti: one file holds one frame; for several give a folder, -o FOLDER")
    return out


@dataclass(frozen=True)
class Inputs:
    """What a run reads.

    Args:
        source: of the images or frames.
        others: files, and folders with a file for each image.
        named: finds the pictures that frames name; None: the source is pictures, and all in its folder are.
    """

    source: Path
    others: tuple[Path, ...] = ()
    named: Callable[[], Collection[Path]] | None = None

    def refuse(self, path: Path, said: str = "") -> None:
        """Raises InputError when results would be written onto an input; `said` names the option."""
        if not path.exists():
            return
        if any(given.is_file() and _same(path, given) for given in (self.source, *self.others)):
            what = "the" if _same(path, self.source) else "an"
            raise InputError(f"{said}{path} is {what} input; give another name")
        if self._is_companion(path) or self._is_picture(path):
            raise InputError(f"{said}{path} is an input; give another folder")

    def _is_picture(self, path: Path) -> bool:
        if self.named is not None:
            return is_picture(path) and path.resolve() in self._named
        return is_picture(path) and _same(path.parent, _folder(self.source))

    @cached_property
    def _named(self) -> set[Path]:
        """Looked for when a picture would be written onto a file, which is seldom."""
        return set() if self.named is None else {path.resolve() for path in self.named()}

    def _is_companion(self, path: Path) -> bool:
        """Whether it lies in a folder of boxes or calibrations under the name of a picture."""
        if not any(_same(path.parent, given) for given in self.others):
            return False
        beside = _folder(self.source).glob(f"{escape(path.stem)}.*")
        return any(map(is_picture, beside))


def _same(path: Path, other: Path) -> bool:
    """Whether two names are of one file or folder that is there."""
    try:
        return path.samefile(other)
    except OSError:
        return False


def _folder(path: Path) -> Path:
    return path if path.is_dir() else path.parent


@dataclass
class Names:
    """A file name for each frame, unlike for unlike frames, whatever their ids are."""

    taken: set[str] = field(default_factory=set)

    def of(self, label: str | int) -> str:
        """The next one's: as `file_stem` has it, and with a number where another frame has that already."""
        first = stem = file_stem(label)
        number = 1
        while stem.casefold() in self.taken:  # some file systems do not tell A from a
            number += 1
            stem = f"{first}-{number}"
        self.taken.add(stem.casefold())
        return stem


def file_stem(label: str | int) -> str:
    """A frame's id as a file name: numbers with six digits as KITTI has them, no separators; where that
    changes or shortens the id, what it was decides the name's end."""
    text = f"{label:06d}" if isinstance(label, int) else label
    stem = re.sub(r"[^\w.-]", "_", text).lstrip(".") or "_"
    if stem == text and len(stem.encode()) <= _LONGEST:
        return stem
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return f"{stem.encode()[:_LONGEST].decode(errors='ignore')}-{digest}"
