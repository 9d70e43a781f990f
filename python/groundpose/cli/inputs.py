"""Where images come from: a picture, a folder of pictures, a video; and the network that looks at them."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache, lru_cache
from glob import escape, glob, has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from groundpose._checks import input_error, regular_file
from groundpose._core import InputError
from groundpose.types import Camera

if TYPE_CHECKING:
    from groundpose.keypoints.video import VideoFrame

_FRAMES = frozenset(("", ".json", ".jsonl", ".ndjson"))
"""Endings of names of frames with keypoints."""
_NUMBER = re.compile(r"%0?\d*d")
"""In the name of numbered pictures, as FFmpeg has it: `frame_%06d.png`."""

Image = NDArray[np.uint8]
NetworkFile = Annotated[
    Path | None,
    typer.Option(
        help="Keypoint network: a file (.onnx), or one that comes with the package: default, int8 (half the "
        "time), float32.",
        show_default="default",
    ),
]


@dataclass(frozen=True, eq=False)
class Shot:
    """An image of a run.

    Attributes:
        label: its id. name: what boxes and calibrations may call it. path: its file.
        number, time, image: of a frame of a video or a recording, from 0, in seconds, (H, W, 3).
        camera: that of a recording.
    """

    label: str | int
    name: str
    path: Path
    number: int | None = None
    time: float | None = None
    image: Image | None = None
    camera: Camera | None = None


@cache
def _endings() -> tuple[frozenset[str], frozenset[str]]:
    """Of pictures and of videos."""
    from groundpose.keypoints import image, video  # with Pillow, which frames with keypoints do not need

    return image.endings() - video.ENDINGS, video.ENDINGS


def is_picture(path: Path) -> bool:
    """Whether the name is one of a picture."""
    ending = path.suffix.lower()
    return ending not in _FRAMES and ending in _endings()[0]


def is_video(path: Path) -> bool:
    """Whether the name is one of a video."""
    return not path.is_dir() and path.suffix.lower() in _endings()[1]


def has_frames(path: Path) -> bool:
    """Whether the name is one of a video or of a recording."""
    from groundpose.formats.recordings import is_recording  # with Pillow

    return is_video(path) or is_recording(path)


def is_pattern(path: Path) -> bool:
    """Whether it names several pictures, `frame_%06d.png` or `frame_*.png`, and no file."""
    return not path.exists() and bool(_NUMBER.search(path.name) or has_magic(path.name))


def is_image(path: Path) -> bool:
    """Whether the name is one of a picture, of a video, of a folder, or of several pictures."""
    ending = path.suffix.lower()
    if path.is_dir() or (is_pattern(path) and ending not in _FRAMES - {""}):
        return True
    return ending not in _FRAMES and (is_picture(path) or has_frames(path))


def is_several(path: Path) -> bool:
    """Whether there may be more than one image."""
    return path.is_dir() or is_pattern(path) or has_frames(path)


def shots(
    path: Path, found: list[tuple[str, Path]] | None, exif: bool = True, topic: str | None = None
) -> Iterator[Shot | InputError]:
    """The images of a run in order: those `found` by `pictures`; None: the frames of the video `path`, turned
    as it asks if `exif` says so, or of a recording's `topic`.

    Raises:
        OSError: no such file. InputError: no video, no recording.
    """
    if found is not None:
        yield from (Shot(label, picture.name, picture) for label, picture in found)
        return
    from groundpose.formats.recordings import is_recording, read_recording
    from groundpose.keypoints.video import video_frames

    if is_recording(path):
        for taken in read_recording(path, topic):
            if isinstance(taken, InputError):
                yield taken
            else:
                place = (taken.number, taken.time, taken.image, taken.camera)
                yield Shot(taken.number, f"{taken.number:06d}", path, *place)
        return
    yield from frame_shots(path, video_frames(path, exif))


def frame_shots(path: Path, frames: Iterable[VideoFrame | InputError]) -> Iterator[Shot | InputError]:
    """The frames of a video or a camera as images."""
    for frame in frames:
        if isinstance(frame, InputError):
            yield frame
        else:
            yield Shot(frame.number, f"{frame.number:06d}", path, frame.number, frame.time, frame.image)


def pictures(path: Path) -> list[tuple[str, Path]]:
    """The pictures of a folder or a pattern in order, or a picture alone, each with a name of its own:
    without its ending unless two would be called the same.

    Raises:
        OSError: no such file. InputError: a folder without pictures, a pattern that none has.
    """
    if not path.is_dir() and not is_pattern(path):
        regular_file(path).open("rb").close()  # OSError in Python's own words
        return [(path.stem, path)]
    found = _matching(path) if is_pattern(path) else _pictures_of(path)
    if not found:
        expected = "names of pictures" if is_pattern(path) else "a folder with pictures"
        raise input_error(str(path), expected, "none that match" if is_pattern(path) else "none in it")
    stems = Counter(p.stem for p in found)
    return [(p.stem if stems[p.stem] == 1 else p.name, p) for p in found]


def _pictures_of(folder: Path) -> list[Path]:
    return sorted(p for p in folder.iterdir() if is_picture(p) and not p.name.startswith("."))


def _matching(pattern: Path) -> list[Path]:
    """Pictures of a folder whose names a pattern has: by their number, or in the order of their names."""
    if not _NUMBER.search(pattern.name):
        names = glob(escape(str(pattern.parent)) + "/" + pattern.name)
        return sorted(path for path in map(Path, names) if is_picture(path))
    if not pattern.parent.is_dir():
        return []
    digits = _NUMBER.sub(lambda _: r"(\d+)", re.escape(pattern.name))
    hits = [(re.fullmatch(digits, path.name), path) for path in _pictures_of(pattern.parent)]
    numbered = [([int(text) for text in hit.groups()], path) for hit, path in hits if hit]
    return [path for _, path in sorted(numbered)]


def companion(folder: Path, name: str) -> Path:
    """The file of an image in a folder of boxes or calibrations: the same name with another ending.

    Raises InputError when there is none.
    """
    stem = Path(name).stem
    found = _files_before(folder, _changed(folder)).get(os.path.normcase(stem))
    if not found:
        raise input_error(str(folder), f"a file {stem}.*", "none")
    return found[0]


def frame_companion(folder: Path, video_name: str, number: int) -> Path | None:
    """The file of a video's frame (from 0) in a folder of boxes: `000000.*`, or `VIDEO_1.txt` as ultralytics
    writes.

    None: a frame without objects, for which ultralytics writes no file. Raises InputError when there is none
        of any.
    """
    theirs = f"{Path(video_name).stem}_"
    if _has_numbered(folder, _changed(folder), theirs):
        path = folder / f"{theirs}{number + 1}.txt"
        return path if path.is_file() else None
    return companion(folder, f"{number:06d}")


def _changed(folder: Path) -> int | None:
    """When files of a folder last came or went; none where it is not there."""
    return folder.stat().st_mtime_ns if folder.is_dir() else None


# A folder of a hundred thousand files is read once, and again when it has changed, not for each image.
@lru_cache(maxsize=8)
def _files_before(folder: Path, changed: int | None) -> dict[str, list[Path]]:
    """Those that are no pictures, in order, by what stands before a point of their names."""
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()) if changed is not None else ():
        if not is_picture(path):
            name = os.path.normcase(path.name)
            for point in (at for at, letter in enumerate(name) if letter == "."):
                found.setdefault(name[:point], []).append(path)
    return found


@lru_cache(maxsize=8)
def _has_numbered(folder: Path, changed: int | None, theirs: str) -> bool:
    return changed is not None and any(folder.glob(f"{escape(theirs)}*.txt"))


def is_table(path: Path) -> bool:
    """Whether it is a Parquet file, or a folder of them or of partitions; one with pictures is theirs."""
    if not path.is_dir():
        return path.suffix.lower() == ".parquet"
    if any(map(is_picture, path.iterdir())):
        return False
    return next(path.rglob("*.parquet"), None) is not None


def stamps(path: Path) -> list[str]:
    """Changes with the name, the size or the time of a file of a folder of tables."""
    if not path.is_dir():
        return []
    found = [(file, file.stat()) for file in sorted(path.rglob("*.parquet"))]
    return [f"{file} {stat.st_size} {stat.st_mtime_ns}" for file, stat in found]
