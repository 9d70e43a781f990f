"""`groundpose convert`: poses in the formats of other tools."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path
from typing import Annotated

import typer

from groundpose._checks import input_error
from groundpose._core import InputError
from groundpose.cli.destination import Inputs, Names
from groundpose.cli.output import complain, mistakes, refuse, say, show
from groundpose.estimate import estimate_poses
from groundpose.formats.fields import parse
from groundpose.formats.frames import FrameSource
from groundpose.formats.neighbours import NEIGHBOURS, Context, Neighbour, neighbour, write_scenes
from groundpose.formats.scenes import Scene, read_scenes


def convert(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="INPUT",
            help="What [bold]groundpose estimate[/bold] wrote (.jsonl), or frames with keypoints, which are "
            "estimated first.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUTPUT",
            help="File, or folder of a bag or a data set: .mcap, .ros2, .nuscenes.json, .coco.json, "
            ".label-studio.json, .xml (CVAT), .fiftyone, .glb, .gltf; of several frames a .glb needs {id} in "
            "its name.",
        ),
    ],
    to: Annotated[
        str | None,
        typer.Option(help=f"{', '.join(NEIGHBOURS)}.", metavar="FORMAT", show_default="by the ending"),
    ] = None,
    tables: Annotated[
        Path | None,
        typer.Option(
            help="Folder of nuScenes' tables (v1.0-mini), for its results.",
            metavar="FOLDER",
            show_default=False,
        ),
    ] = None,
    frame_id: Annotated[str, typer.Option(help="The camera's frame in ROS and Foxglove.")] = "camera",
    pictures: Annotated[
        bool, typer.Option(help="Whether recordings take the pictures along.", show_default=False)
    ] = True,
) -> None:
    """Write poses for the next tool: Foxglove, ROS 2 and Autoware, nuScenes, CVAT, Label Studio, FiftyOne ...

    Exit status: 0 when all went well; 1 when some lines were bad (the
    others are written); 2 when nothing was written.

    [bold]Examples[/bold]

      groundpose convert poses.jsonl drive.mcap

      groundpose convert poses.jsonl drive_bag --to ros2 --frame-id camera_optical_link

      groundpose convert poses.jsonl results.nuscenes.json --tables nuscenes/v1.0-mini

      groundpose convert poses.jsonl cuboids.xml

      groundpose convert poses.jsonl 'frames/{id}.glb'
    """
    with mistakes():
        form = neighbour(out, to)
        Inputs(source).refuse(out)
        frames = _Frames(source)
        context = Context(tables, frame_id, pictures, failed=frames.not_written)
        if form.one_frame:
            _each(frames, out, form, context)
        else:
            write_scenes(out, frames, form.name, context)
        for reason, count in context.left_out.most_common():
            if count:
                say(f"left out: {count} x {reason}")
        show(f"{frames.count} frame{'s' * (frames.count != 1)}, {frames.vehicles} poses: {out}")
    raise typer.Exit(1 if frames.bad else 0)


def _each(frames: _Frames, out: Path, form: Neighbour, context: Context) -> None:
    """A file for each frame, named by its id."""
    scenes = iter(frames)
    first = list(islice(scenes, 2))
    if len(first) > 1 and "{id}" not in out.name:
        refuse(
            f"{out}: {form.name} holds one frame; several need {{id}} in the name, as in 'frame_{{id}}.glb'"
        )
    names = Names()
    out.parent.mkdir(parents=True, exist_ok=True)
    for scene in chain(first, scenes):
        path = out.with_name(out.name.replace("{id}", names.of(scene.id)))
        with context.frame(scene):
            write_scenes(path, [scene], form.name, context)
    frames.refuse_none()


class _Frames:
    """The good frames of a file; bad lines are complained about and counted.

    Attributes:
        count, vehicles, bad: frames, poses, bad lines so far.
    """

    def __init__(self, source: Path) -> None:
        self.source = source
        self.count = self.vehicles = self.bad = 0

    def __iter__(self) -> Iterator[Scene]:
        """Frames in order. Raises InputError when there is none."""
        for scene in _scenes(self.source):
            if isinstance(scene, InputError):
                self.fail(scene)
                continue
            self.count += 1
            self.vehicles += len(scene.rows)
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


def _scenes(source: Path) -> Iterator[Scene | InputError]:
    if _has_poses(source):
        yield from read_scenes(source)
        return
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
