"""`groundpose track`: poses over time in, vehicles with their speeds out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, cast

import typer

from groundpose._checks import input_error
from groundpose._core import InputError
from groundpose._live import is_address, is_live
from groundpose._writing import only_writer, replaceable, whole_file
from groundpose.cli.asked import asked
from groundpose.cli.box_choice import BoxChoice
from groundpose.cli.cameras import CameraChoice
from groundpose.cli.crew import split
from groundpose.cli.inputs import NetworkFile, is_image, is_several
from groundpose.cli.kept_poses import KeptPoses, kept_poses
from groundpose.cli.known_camera import KnownCamera
from groundpose.cli.output import complain, mistakes, refuse, standard_output
from groundpose.cli.track_input import Followed, Odometry, of_images, of_lines, pose_lines
from groundpose.cli.track_job import INTERRUPTED, TrackJob
from groundpose.cli.track_output import OpenFrames, TrackRows
from groundpose.cli.track_traffic import Tables
from groundpose.draw.road_marks import RoadMarks
from groundpose.draw.track_map import TrackMap
from groundpose.draw.tracks import TrackPictures
from groundpose.formats.rerun_tracks import TrackLog
from groundpose.formats.site import Site, read_site
from groundpose.formats.tracks import ENDINGS, FORMATS
from groundpose.tracking import Tracker, TrackOptions
from groundpose.tracking.options import CameraMotion
from groundpose.types import View


def track(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="INPUT",
            help="Poses that [bold]groundpose estimate[/bold] wrote (.jsonl), or - for standard input; or a "
            "folder of images, a video, a camera (camera:0, /dev/video0) or an address (rtsp://...), with "
            "[bold]--boxes[/bold] or [bold]--detector[/bold].",
        ),
    ],
    camera: Annotated[
        Path,
        typer.Option(help="The camera and its tilt: a profile of groundpose calibrate, or any camera file."),
    ],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="File to write: .csv, .jsonl, or .txt for KITTI's format."),
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help=f"{', '.join(FORMATS)}; default: by the ending of -o, else jsonl.")
    ] = "",
    fps: Annotated[
        float | None,
        typer.Option(help="Frames a second, of input without times.", show_default="the input's times"),
    ] = None,
    camera_motion: Annotated[
        str, typer.Option(help="static, or unknown: places and speeds are then relative to the camera.")
    ] = "static",
    odometry: Annotated[
        Path | None,
        typer.Option(
            help="How the camera moves: CSV with x, z (m) and heading (rad), a row per frame.", metavar="FILE"
        ),
    ] = None,
    boxes: Annotated[Path | None, typer.Option(help="2D boxes of images, as of estimate.")] = None,
    detector: Annotated[
        Path | None, typer.Option(help="Detector of 2D boxes (.onnx), as of estimate.")
    ] = None,
    network: NetworkFile = None,
    height: Annotated[
        float | None,
        typer.Option(help="Height of the camera, of a file that is no profile.", metavar="METRES"),
    ] = None,
    world: Annotated[
        Path | None,
        typer.Option(
            help="Where the camera stands (.yaml, .json): rows also have places and headings on the map.",
            metavar="FILE",
        ),
    ] = None,
    lanes: Annotated[
        Path | None,
        typer.Option(
            help="Lines and lanes on the road (.yaml, .json), if they are not in the file of --world.",
            metavar="FILE",
        ),
    ] = None,
    counts: Annotated[
        Path | None,
        typer.Option(help="Table of who crosses lines and lanes, when and how fast (.csv).", metavar="FILE"),
    ] = None,
    summary: Annotated[
        Path | None,
        typer.Option(help="Table of counts, speeds and headways per line and lane (.csv).", metavar="FILE"),
    ] = None,
    every: Annotated[
        float | None,
        typer.Option(help="Intervals of --summary.", metavar="SECONDS", show_default="all in one"),
    ] = None,
    draw: Annotated[
        Path | None,
        typer.Option(
            help="Trails and speeds as a film (.mp4) or pictures with {id} in the name.", metavar="FILE"
        ),
    ] = None,
    birds_eye: Annotated[
        Path | None, typer.Option(help="Picture of all tracks from above (.png, .svg, .pdf).", metavar="FILE")
    ] = None,
    rerun: Annotated[
        Path | None,
        typer.Option(help="Timeline for the Rerun viewer (.rrd): boxes, trails, speeds.", metavar="FILE"),
    ] = None,
    live: Annotated[
        bool,
        typer.Option(
            "--live", help="Write every frame's vehicles at once, not smoothed by what comes later."
        ),
    ] = False,
) -> None:
    """Follow vehicles over time: one identity, one size and one front each, with speeds.

    Rows are smoothed by later frames and come when a vehicle has left; with
    --live every frame's come at once. Frames that cannot be used are named
    and left out; what was found so far is written when it is interrupted,
    and the same command then goes on with the poses of the images so far.

    Exit status: 0 when all went well; 1 when some frames were bad (the
    others are done); 2 when the call was wrong and nothing was done; 130
    when it was interrupted.

    [bold]Examples[/bold]

      groundpose track poses.jsonl --camera camera.json --fps 10 -o tracks.csv

      groundpose track mast.mp4 --boxes boxes.json --camera camera.json -o tracks.csv --birds-eye tracks.png

      groundpose track mast.mp4 --boxes boxes.json --camera camera.json --lanes lanes.yaml --counts counts.csv

      groundpose track rtsp://10.0.0.7/road --detector yolo.onnx --camera camera.json -o tracks.csv --live

      groundpose estimate frames.jsonl | groundpose track - --camera camera.json --fps 10 --live
    """
    deciding = {"source": source, "camera": camera, "boxes": boxes, "detector": detector, "network": network}
    settings = asked({**deciding, "height": height, "out": out})
    with mistakes():
        known = KnownCamera.read(camera, height)
        view = known.view
        if fps is not None and not (fps > 0.0 and math.isfinite(fps)):
            raise input_error("--fps", "a number above 0", fps)
        motion = "odometry" if odometry is not None else camera_motion
        tracker = _tracker(view, motion)
        moves = None if odometry is None else Odometry(odometry)
        form = _format(form, out)
        site = _site(world, lanes, view, motion)
        if world is not None and form == "kitti":
            raise input_error("--world", "csv or jsonl, which have places on a map", form)
        tables = Tables(counts, summary, every)
        tables.check(site)
        _spare(
            (source, camera, boxes, odometry, world, lanes), (out, birds_eye, counts, summary, draw, rerun)
        )
        frames = OpenFrames()
        job = TrackJob(tracker, [], frames, fps, moves, live)
        job.pictures = None if draw is None else TrackPictures(draw, _marks(site, motion != "odometry"))
        log = None if rerun is None else TrackLog(rerun, view, site.lines, site.lanes)
        if birds_eye is not None:
            job.sinks.append(TrackMap(birds_eye, _marks(site)))
        file = out if out is not None and replaceable(out) else None
        with ExitStack() as stack:
            if file is not None:
                stack.enter_context(only_writer(file))
            choice, kept = BoxChoice(boxes, detector, None), None
            endless = is_followed_images(source, choice) and _is_endless(source, fps, odometry)
            if is_followed_images(source, choice) and not endless:
                kept = stack.enter_context(kept_poses(file, settings, view))
            job.goes_on = kept is not None
            given = stack.enter_context(track_frames(source, known, camera, choice, network, kept))
            stream = standard_output() if out is None else stack.enter_context(whole_file(out))
            if log is not None:
                job.sinks.append(stack.enter_context(log))
            if job.pictures is not None:
                stack.enter_context(job.pictures)
            job.sinks.append(TrackRows(stream, form, frames, view, site.world))
            job.sinks += tables.open(stack, site, frames)
            status = job.run(given, stream)
            if kept is not None:
                kept.whole = status != INTERRUPTED
    raise typer.Exit(status)


def _tracker(view: View, motion: str) -> Tracker:
    """One of this camera. The poses of images have a camera of their size, which its file may not say: then
    of the first frame's."""
    options = TrackOptions(camera_motion=cast(CameraMotion, motion))
    return Tracker(None if view.camera.image_size is None else view, options)


def _site(world: Path | None, lanes: Path | None, view: View, motion: str) -> Site:
    """Where the camera stands and what is drawn on the road. Raises OSError, InputError."""
    if motion == "unknown" and (world or lanes) is not None:
        option = "--lanes" if world is None else "--world"
        raise input_error(option, "a camera that stands or has --odometry", "--camera-motion unknown")
    shown = view if motion == "static" else None
    site = Site() if world is None else read_site(world, shown)
    if world is not None and site.world is None:
        raise input_error(str(world), "map or geographic", "none of them")
    if lanes is None:
        return site
    drawn = read_site(lanes, shown, site.world)
    if not drawn.lines and not drawn.lanes:
        raise input_error(str(lanes), "lines or lanes", "none of them")
    return replace(site, lines=drawn.lines, lanes=drawn.lanes)


def _is_endless(source: Path, fps: float | None, odometry: Path | None) -> bool:
    """Whether it is a camera or a stream, whose frames have times of their own, and some are dropped. Raises
    InputError for what is said by the number of a frame."""
    if not is_live(source):
        return False
    for option, value in (("--fps", fps), ("--odometry", odometry)):
        if value is not None:
            raise input_error(option, "none for a camera or a stream, whose frames have times", value)
    return True


def _marks(site: Site, shown: bool = True) -> RoadMarks | None:
    """What is drawn of them; over pictures of a camera that moves they are not shown."""
    return RoadMarks(site.lines, site.lanes) if shown and (site.lines or site.lanes) else None


def _format(form: str, out: Path | None) -> str:
    meant = "" if out is None else ENDINGS.get(out.suffix.lower(), "")
    if form and form not in FORMATS:
        raise input_error("--format", f"one of {', '.join(FORMATS)}", form)
    if out is not None and not form and not meant:
        raise input_error("-o", f"a file that ends in {', '.join(ENDINGS)}, or --format", out)
    return form or meant or "jsonl"


def _spare(inputs: tuple[Path | None, ...], outputs: tuple[Path | None, ...]) -> None:
    """Refuse to write onto an input, or two outputs into one file."""
    written: set[Path] = set()
    for path in (path for path in outputs if path is not None):
        if path.exists() and any(given and given.exists() and path.samefile(given) for given in inputs):
            refuse(f"{path}: is an input; give another name")
        if path.resolve() in written and replaceable(path):
            refuse(f"{path}: is given for two outputs; give another name")
        written.add(path.resolve())


@contextmanager
def track_frames(
    source: Path,
    known: KnownCamera,
    camera: Path,
    found_by: BoxChoice,
    network: Path | None,
    kept: KeptPoses | None = None,
) -> Iterator[Iterator[Followed | InputError]]:
    """What is followed: lines of poses, or images whose poses are found as `estimate` finds them."""
    if not is_followed_images(source, found_by):
        with pose_lines(source, known.view) as lines:
            yield of_lines(lines, source.parent)
        return
    from groundpose.cli.images import ImageWork
    from groundpose.keypoints.live import LiveFrames
    from groundpose.keypoints.network import Network
    from groundpose.keypoints.pipeline import Pipeline

    found_by.check(source)
    choice = CameraChoice(camera)
    live = LiveFrames(source) if is_live(source) else None
    crew, each = split(None, live is None and is_several(source))  # nothing read ahead: it would be old
    pipeline = Pipeline(Network(network, each))
    work = ImageWork(source, found_by, choice, known.mounting, -math.inf, pipeline, crew=crew, live=live)
    try:
        yield of_images(work, kept)
    finally:
        if live is not None and live.dropped:
            counted = f"{live.dropped} of {live.read} frames"
            complain(f"{live.name}: {counted} came faster than they were followed, and were dropped")


def is_followed_images(source: Path, found_by: BoxChoice) -> bool:
    """Whether the input is images, else lines of poses."""
    given = found_by.boxes is not None or found_by.detector is not None
    return given or is_image(source) or is_address(source)
