"""`groundpose convert`: poses and tracks in the formats of other tools."""

from __future__ import annotations

from itertools import chain, islice
from pathlib import Path
from typing import Annotated

import typer

from groundpose.cli.convert_input import GoodFrames, TrackContext, scenes_of
from groundpose.cli.destination import Inputs, Names
from groundpose.cli.output import mistakes, refuse, say, show
from groundpose.formats.neighbours import NEIGHBOURS, Context, Neighbour, neighbour, write_scenes


def convert(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="INPUT",
            help="What [bold]groundpose estimate[/bold] wrote (.jsonl), or [bold]groundpose track[/bold] "
            "(.csv, .jsonl; with [bold]--camera[/bold]), or frames with keypoints, to be estimated first.",
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
    camera: Annotated[
        Path | None,
        typer.Option(
            help="Of tracks: the camera and its tilt, a profile of groundpose calibrate or any camera file.",
            metavar="FILE",
            show_default=False,
        ),
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(
            help="Of tracks: height of the camera, of a file that is no profile.",
            metavar="METRES",
            show_default=False,
        ),
    ] = None,
    images: Annotated[
        Path | None,
        typer.Option(
            help="Of tracks: the pictures of their frames, with {id} in the name.",
            metavar="FILES",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Write poses for the next tool: Foxglove, ROS 2 and Autoware, nuScenes, CVAT, Label Studio, FiftyOne ...

    Tracks stand on the ground below the camera; boxes keep their vehicle's
    number and, where the format has one, its speed.

    Exit status: 0 when all went well; 1 when some lines were bad (the
    others are written); 2 when nothing was written.

    [bold]Examples[/bold]

      groundpose convert poses.jsonl drive.mcap

      groundpose convert tracks.csv drive.mcap --camera camera.json --images 'frames/{id}.png'

      groundpose convert poses.jsonl drive_bag --to ros2 --frame-id camera_optical_link

      groundpose convert poses.jsonl results.nuscenes.json --tables nuscenes/v1.0-mini

      groundpose convert poses.jsonl cuboids.xml

      groundpose convert poses.jsonl 'frames/{id}.glb'
    """
    with mistakes():
        form = neighbour(out, to)
        Inputs(source, () if camera is None else (camera,)).refuse(out)
        frames = GoodFrames(source, scenes_of(source, TrackContext(camera, height, images), form))
        context = Context(tables, frame_id, pictures, frames.left_out, failed=frames.not_written)
        if form.one_frame:
            _each(frames, out, form, context)
        else:
            write_scenes(out, frames, form.name, context)
        for reason, count in context.left_out.most_common():
            if count:
                say(f"left out: {count} x {reason}")
        show(f"{frames.count} frame{'s' * (frames.count != 1)}, {frames.vehicles} poses: {out}")
    raise typer.Exit(1 if frames.bad else 0)


def _each(frames: GoodFrames, out: Path, form: Neighbour, context: Context) -> None:
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
