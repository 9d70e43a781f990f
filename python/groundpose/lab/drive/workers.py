"""Makes frames of a drive, drawn or only labelled, in order, in one or several processes."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Generator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from groundpose._checks import count, input_error
from groundpose.formats.kitti.labels import format_calibration, format_labels
from groundpose.lab.drive.drive import scene
from groundpose.lab.drive.ego import FRAMES_PER_DRIVE
from groundpose.lab.drive.labels import labels
from groundpose.lab.drive.record import frame_line, kitti_label
from groundpose.lab.drive.rigs import DEFAULT_RIG, Range, Rigs, Size, rigs
from groundpose.lab.drive.scene import Scene
from groundpose.lab.drive.splits import scene_seed
from groundpose.lab.drive.traffic import DEFAULT_SHARES, check_shares
from groundpose.lab.drive.video.clip import VideoFrame, check_video, make_clip, video_frame
from groundpose.lab.processes import worker_pool

FORMATS = ("png", "jpg", "mp4")
_VERSION = 1
_SAVE: dict[str, tuple[str, dict[str, Any]]] = {
    "png": ("PNG", {"compress_level": 2}),
    "jpg": ("JPEG", {"quality": 93, "subsampling": 0}),
    "mp4": ("JPEG", {"quality": 97, "subsampling": 0}),
}
SUFFIX = {"png": "png", "jpg": "jpg", "mp4": "jpg"}
"""Of the pictures by format; those of a video remain beside it."""
# Frames given to a process at once: one when they are drawn, so that an interruption loses little.
_BLOCK = {True: 1, False: FRAMES_PER_DRIVE}


@dataclass(frozen=True)
class Settings:
    """Contents of a folder: seed within its split, split, number of the first frame, relative frequencies of
    the classes (`shares`), format of the pictures (None: no pictures), name of the camera's rig, and ranges
    that replace those of the rig (None: its own), see `rigs.rigs`. `fps` and `frames` are those of a video;
    None: drives of 20 frames.

    Raises:
        InputError: an invalid value.
    """

    seed: int = 0
    split: str = "train"
    first: int = 0
    shares: Mapping[str, float] = field(default_factory=lambda: dict(DEFAULT_SHARES))
    images: str | None = "png"
    rig: str = DEFAULT_RIG
    height: Range | None = None
    pitch_deg: Range | None = None
    roll_deg: Range | None = None
    fov_deg: Range | None = None
    image_size: Size | None = None
    fps: float | None = None
    frames: int | None = None
    version: int = _VERSION

    def __post_init__(self) -> None:
        """Check the values."""
        scene_seed(self.seed, self.split)
        count("first", self.first)
        check_shares(self.shares)
        if self.images not in (None, *FORMATS):
            raise input_error("format", f"one of {', '.join(FORMATS)}", repr(self.images))
        if (self.fps is None) != (self.frames is None):
            raise input_error("fps", "given together with frames", f"fps {self.fps}, frames {self.frames}")
        if self.fps is None and self.images == "mp4":
            raise input_error("format", "png or jpg without --video", "mp4")
        if self.fps is not None and self.frames is not None:
            check_video(self.frames, self.fps)
        if self.fps is not None and self.first:
            raise input_error("first", "0 with a video", self.first)
        self.rigs  # noqa: B018 - checks the ranges

    @property
    def rigs(self) -> Rigs:
        """The rigs from which the camera of each drive is drawn."""
        return rigs(self.rig, self.height, self.pitch_deg, self.roll_deg, self.fov_deg, self.image_size)


@dataclass(frozen=True)
class Frame:
    """The result of a worker; its picture has a temporary name."""

    number: int
    line: str
    kitti: str
    calibration: str
    objects: int


def image_name(number: int, settings: Settings) -> str:
    """Path of a frame's picture in the folder."""
    assert settings.images is not None
    return f"training/{image_folder(settings)}/{number:06d}.{SUFFIX[settings.images]}"


def image_folder(settings: Settings) -> str:
    """As in KITTI's object and tracking data."""
    return "image_2" if settings.fps is None else "image_02/0000"


def temporary(path: Path) -> Path:
    """Name of an incomplete file."""
    return path.with_name(f".{path.name}.part")


def make_frames(out: Path, numbers: range, settings: Settings, jobs: int) -> Generator[Frame, None, None]:
    """The frames in order, made by `jobs` processes (1: by this one)."""
    size = _BLOCK[settings.images is not None]
    inner = range(-(-numbers.start // size) * size, numbers.stop, size)
    edges = sorted({numbers.start, numbers.start + 1, numbers.stop, *inner})
    blocks = [range(a, b) for a, b in itertools.pairwise(edges)]
    if jobs == 1 or len(blocks) == 1:
        for block in blocks:
            for number in block:
                yield _make_frame(out, number, settings)
        return
    # The first one here, before other processes compete: a run that is killed early has kept it.
    yield from _make_block(out, blocks.pop(0), settings)
    with worker_pool(min(jobs, len(blocks))) as pool:
        waiting: deque[Future[list[Frame]]] = deque()
        for block in blocks:
            waiting.append(pool.submit(_make_block, out, block, settings))
            if len(waiting) > 2 * jobs:
                yield from waiting.popleft().result()
        while waiting:
            yield from waiting.popleft().result()


def _make_block(out: Path, block: range, settings: Settings) -> list[Frame]:
    return [_make_frame(out, number, settings) for number in block]


def _make_frame(out: Path, number: int, settings: Settings) -> Frame:
    video = _video_frame(number, settings)
    made = _scene(number, settings) if video is None else video.scene
    found = labels(made)
    image = None
    if settings.images is not None:
        image = image_name(number, settings)
        _draw(made, temporary(out / image), settings.images)
    drive = number // FRAMES_PER_DRIVE if video is None else 0
    line = frame_line(made, found, drive, image, video)
    kitti = format_labels(map(kitti_label, found))
    return Frame(number, line, kitti, format_calibration(made.camera), len(found))


def _scene(number: int, settings: Settings) -> Scene:
    return scene(scene_seed(settings.seed, settings.split), number, settings.shares, settings.rigs)


def _video_frame(number: int, settings: Settings) -> VideoFrame | None:
    if settings.fps is None or settings.frames is None:
        return None
    seed, shares = scene_seed(settings.seed, settings.split), tuple(settings.shares.items())
    return video_frame(make_clip(seed, settings.frames, settings.fps, shares, settings.rigs), number)


def _draw(made: Scene, part: Path, form: str) -> None:
    from PIL import Image

    kind, options = _SAVE[form]
    picture = Image.fromarray(_renderer().frame(made))
    try:
        picture.save(part, format=kind, **options)
    except OSError as error:
        error.filename = error.filename or str(part)
        raise


@cache
def _renderer() -> Any:
    """The renderer of this process. Raises InputError when its packages are not installed."""
    try:
        from groundpose.lab.drive.render import Renderer
    except ImportError as error:
        raise input_error(
            "images", "pip install 'groundpose[simulate]', or no images", f"no {error.name}"
        ) from None
    return Renderer()
