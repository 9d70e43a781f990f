"""What `groundpose convert` reads: poses, frames with keypoints, tracks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from groundpose._checks import input_error
from groundpose._core import InputError
from groundpose.cli.known_camera import KnownCamera
from groundpose.cli.output import complain, refuse
from groundpose.estimate import estimate_poses
from groundpose.formats.fields import parse
from groundpose.formats.frames import FrameSource
from groundpose.formats.neighbours import Neighbour
from groundpose.formats.scenes import Scene, read_scenes
from groundpose.formats.track_files import is_tracks, read_tracks
from groundpose.formats.track_scenes import NO_SIZE, track_scenes
from groundpose.types import View

Scenes = Callable[[], Iterator[Scene | InputError]]


@dataclass(frozen=True)
class TrackContext:
    """What rows of tracks do not say: the file of their camera, its height, the names of their pictures."""

    camera: Path | None
    height: float | None
    images: Path | None

    def refuse_any(self, source: Path) -> None:
        """For lines, which say all that."""
        for name, value in vars(self).items():
            if value is not None:
                refuse(f"--{name}: {source} has no tracks, its lines say it; leave it out")

    def view(self, source: Path, form: Neighbour) -> View:
        """The camera with all that `form` needs of it. Raises OSError, InputError naming what is missing."""
        if self.camera is None:
            wanted = f"the camera of the tracks in {source}, a profile or any camera file"
            raise input_error("--camera", wanted, "none")
        view = KnownCamera.read(self.camera, self.height).view
        if view.height is None:
            wanted = "camera_height, metres above the ground that the vehicles stand on; or give --height"
            raise input_error(str(self.camera), wanted, "none")
        if "size" in form.needs and view.camera.image_size is None:
            wanted = f"image_size, [width, height] of the pictures, for {form.name}"
            raise input_error(str(self.camera), wanted, "none")
        if "picture" in form.needs and self.images is None:
            wanted = f"the pictures of the tracks for {form.name}, as 'pictures/{{id}}.png'"
            raise input_error("--images", wanted, "none")
        return view


def scenes_of(source: Path, beside: TrackContext, form: Neighbour) -> Scenes:
    """What reads the frames of `source`. Raises OSError, InputError; exits for options that do not belong."""
    if is_tracks(source):
        view = beside.view(source, form)
        return lambda: _of_tracks(source, view, beside.images)
    beside.refuse_any(source)
    return lambda: read_scenes(source) if _has_poses(source) else _of_frames(source)


class GoodFrames:
    """The good frames of a file; bad lines are complained about and counted.

    Attributes:
        count, vehicles, bad: frames, poses, bad lines so far. left_out: what else is missing, by why.
    """

    def __init__(self, source: Path, scenes: Scenes) -> None:
        """`scenes` reads those of `source`."""
        self.source, self._scenes = source, scenes
        self.count = self.vehicles = self.bad = 0
        self.left_out: Counter[str] = Counter()

    def __iter__(self) -> Iterator[Scene]:
        """Frames in order. Raises InputError when there is none."""
        for scene in self._scenes():
            if isinstance(scene, InputError):
                self.fail(scene)
                continue
            self.count += 1
            self.vehicles += len(scene.rows)
            self.left_out["vehicle whose size is not known"] += scene.status.count(NO_SIZE)
            yield scene
        self.refuse_none()

    def refuse_none(self) -> None:
        """Raises InputError when no frame was written."""
        if not self.count:
            raise input_error(str(self.source), "frames", "none that can be written")

    def not_written(self, scene: Scene, error: InputError) -> None:
        """One that could not be written."""
        self.count -= 1
        self.vehicles -= len(scene.rows)
        self.fail(error)

    def fail(self, error: InputError) -> None:
        """One that is bad."""
        self.bad += 1
        complain(error)


def _of_tracks(source: Path, view: View, images: Path | None) -> Iterator[Scene | InputError]:
    table = read_tracks(source)
    yield from table.bad
    yield from track_scenes(table.tracks, view, table.frames, images)


def _of_frames(source: Path) -> Iterator[Scene | InputError]:
    with source.open("rb") as stream:
        for frame in FrameSource(stream, str(source), source.parent):
            if isinstance(frame, InputError):
                yield frame
                continue
            try:
                yield Scene.of_frame(frame, estimate_poses(**frame.arguments))
            except InputError as error:
                yield InputError(f"{frame.place}: {error}")


def _has_poses(source: Path) -> bool:
    """Whether a line with an object says the status of its pose."""
    with source.open("rb") as stream:
        for raw in stream:
            try:
                objects = parse(raw.decode("utf-8", "surrogateescape"), "").value["objects"]
                first = objects[0]
            except (InputError, KeyError, TypeError, IndexError):
                continue
            return isinstance(first, dict) and "status" in first
    return False
