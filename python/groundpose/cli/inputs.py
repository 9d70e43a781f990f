"""Where images come from: a picture, a folder of pictures, a video; and the network that looks at them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from glob import escape
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from groundpose._checks import input_error, regular_file

_ENDINGS = (
    "png apng jpg jpeg jpe jfif jp2 j2k bmp dib gif tif tiff webp avif ppm pgm pbm pnm tga pcx sgi",
    "mp4 avi mov mkv webm m4v mpg mpeg",
)
PICTURES, VIDEOS = (frozenset(f".{ending}" for ending in endings.split()) for endings in _ENDINGS)
"""Endings of names; other files of a folder are passed over."""

Image = NDArray[np.uint8]
NetworkFile = Annotated[
    Path | None,
    typer.Option(
        help="Keypoint network: a file (.onnx), or one that comes with the package: default, int8 (half the "
        "time), float32.",
        show_default="default",
    ),
]


def is_image(path: Path) -> bool:
    """Whether the name is one of a picture, of a video or of a folder."""
    return path.is_dir() or path.suffix.lower() in PICTURES | VIDEOS


def is_video(path: Path) -> bool:
    """Whether the name is one of a video."""
    return not path.is_dir() and path.suffix.lower() in VIDEOS


def pictures(path: Path) -> list[tuple[str, Path]]:
    """The pictures of a folder in order, or a picture alone, each with a name of its own: without its ending
    unless two would be called the same.

    Raises:
        OSError: no such file. InputError: a folder without pictures.
    """
    if not path.is_dir():
        regular_file(path).open("rb").close()  # OSError in Python's own words
        return [(path.stem, path)]
    found = sorted(p for p in path.iterdir() if p.suffix.lower() in PICTURES and not p.name.startswith("."))
    if not found:
        raise input_error(str(path), "a folder with pictures", "none in it")
    stems = Counter(p.stem for p in found)
    return [(p.stem if stems[p.stem] == 1 else p.name, p) for p in found]


def companion(folder: Path, name: str) -> Path:
    """The file of an image in a folder of boxes or calibrations: the same name with another ending.

    Raises InputError when there is none.
    """
    stem = Path(name).stem
    found = sorted(p for p in folder.glob(f"{escape(stem)}.*") if p.suffix.lower() not in PICTURES)
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
    if any(folder.glob(f"{escape(theirs)}*.txt")):
        path = folder / f"{theirs}{number + 1}.txt"
        return path if path.is_file() else None
    return companion(folder, f"{number:06d}")


def video(path: Path) -> Iterator[Image]:
    """The frames of a video (H, W, 3), RGB, read by the first package that is installed.

    Raises:
        OSError: no such file. InputError: no video, or no package that reads videos.
    """
    regular_file(path).open("rb").close()
    for package, read in _VIDEO_READERS.items():
        if find_spec(package) is not None:
            frames = read(path)
            first = next(frames, None)
            if first is None:
                raise input_error(str(path), "a video", "a file without frames")
            yield first
            yield from frames
            return
    hint = "pip install opencv-python-headless, or give a folder of its frames"
    raise input_error(str(path), f"OpenCV or imageio to read videos ({hint})", "neither")


def _opencv(path: Path) -> Iterator[Image]:
    reader = import_module("cv2").VideoCapture(str(path))
    try:
        while True:
            there, image = reader.read()
            if not there:
                return
            yield image[..., ::-1]
    finally:
        reader.release()


def _imageio(path: Path) -> Iterator[Image]:
    try:
        yield from import_module("imageio.v3").imiter(path)
    except (OSError, ValueError) as error:
        raise input_error(str(path), "a video", error) from None


_VIDEO_READERS: dict[str, Callable[[Path], Iterator[Image]]] = {"cv2": _opencv, "imageio": _imageio}
