"""`groundpose calibrate`: traffic in, a camera profile out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from groundpose._core import InputError
from groundpose.cli.box_choice import BoxChoice
from groundpose.cli.cameras import CameraChoice
from groundpose.cli.crew import split
from groundpose.cli.inputs import NetworkFile, is_image, is_several
from groundpose.cli.options import takes_options
from groundpose.cli.output import complain, console, mistakes, refuse
from groundpose.cli.run import Mounting
from groundpose.options import Options
from groundpose.self_calibration.calibrate import Calibration, calibrate_contacts
from groundpose.self_calibration.calibrate import calibrate as calibrate_sightings
from groundpose.self_calibration.plane import Known
from groundpose.sizes import REGIONS, SizePrior


@takes_options
def calibrate(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="INPUT",
            help="Frames with keypoints (.jsonl), poses that [bold]groundpose estimate[/bold] wrote (.jsonl, "
            "with [bold]--calib[/bold]), or a folder of images or a video, with [bold]--boxes[/bold] or "
            "[bold]--detector[/bold].",
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Camera profile to write (.json).")] = Path(
        "camera.json"
    ),
    draw: Annotated[
        Path | None, typer.Option(help="Picture of how it settled (.png, .svg, .pdf).", metavar="FILE")
    ] = None,
    focal: Annotated[
        bool, typer.Option("--focal", help="The focal length is a guess; estimate it too.")
    ] = False,
    height: Annotated[
        float | None,
        typer.Option(metavar="METRES", help="Known height of the camera; sizes of classes are then learned."),
    ] = None,
    height_sigma: Annotated[
        float, typer.Option(min=1e-4, max=1.0, help="Its standard deviation, as a fraction.")
    ] = 0.02,
    pitch_deg: Annotated[
        float | None, typer.Option(help="Pitch of the camera within some degrees.", show_default="unknown")
    ] = None,
    roll_deg: Annotated[
        float | None, typer.Option(help="Roll of the camera within some degrees.", show_default="unknown")
    ] = None,
    tilt_guess_sigma_deg: Annotated[
        float, typer.Option(min=0.01, max=45.0, help="Standard deviation of --pitch-deg and --roll-deg.")
    ] = 5.0,
    region: Annotated[
        str | None, typer.Option(help=f"Where vehicles are as large as there: {', '.join(REGIONS)}.")
    ] = None,
    tracks: Annotated[
        bool | None,
        typer.Option(
            "--tracks/--no-tracks",
            help="Whether a vehicle has the same id in all frames.",
            show_default="by the ids",
        ),
    ] = None,
    boxes: Annotated[Path | None, typer.Option(help="2D boxes of the images, as of estimate.")] = None,
    detector: Annotated[
        Path | None, typer.Option(help="A detector (.onnx) that finds them, instead of --boxes.")
    ] = None,
    detector_score: Annotated[
        float | None, typer.Option(min=0.0, max=1.0, help="Leave out its boxes whose score is lower.")
    ] = None,
    calib: Annotated[Path | None, typer.Option(help="The camera; of frames their own.")] = None,
    camera: Annotated[str | None, typer.Option(metavar="NAME", help="Which camera of --calib.")] = None,
    fov_deg: Annotated[
        float | None, typer.Option(metavar="DEG", help="Horizontal field of view, instead of --calib.")
    ] = None,
    network: NetworkFile = None,
    threads: Annotated[int | None, typer.Option(min=1, show_default="all cores", help="Threads.")] = None,
    *,
    options: Options,
) -> None:
    """Calibrate a camera that stands still by the traffic that it sees.

    Pitch, roll, height and the mean sizes of the classes, each with a
    standard deviation; with --focal the focal length too. Sizes of vehicles
    give the height: its standard deviation holds that of the classes' mean
    sizes. The profile can be given wherever a camera file can, and to
    [bold]groundpose estimate --profile[/bold].

    [bold]Examples[/bold]

      groundpose calibrate labels.jsonl -o camera.json --draw settled.png

      groundpose calibrate mast.mp4 --boxes boxes.json --fov-deg 60 --focal -o camera.json

      groundpose calibrate poses.jsonl --calib camera.yaml --height 7.2 -o camera.json
    """
    known = _known(pitch_deg, roll_deg, tilt_guess_sigma_deg, height, height_sigma)
    if source.exists() and out.exists() and source.samefile(out):
        refuse(f"-o {out}: is the input; give another name")
    with mistakes():
        sizes = SizePrior.region(region or "world")
        choice = CameraChoice(calib, camera, fov_deg)
        if boxes is not None or detector is not None or is_image(source):
            found_by = BoxChoice(boxes, detector, detector_score)
            found = _of_images(
                source, found_by, choice, network, tracks, known, sizes, focal, options, threads
            )
        else:
            found = _of_file(source, choice, tracks, known, sizes, focal, options, threads)
        found.profile.save(out)
        if draw is not None:
            from groundpose.self_calibration.figure import draw_calibration

            draw_calibration(found, draw)
    _tell(found, out)


def _known(
    pitch_deg: float | None, roll_deg: float | None, sigma_deg: float, height: float | None, sigma: float
) -> Known:
    pitch, roll = (
        None if angle is None else (math.radians(angle), math.radians(sigma_deg))
        for angle in (pitch_deg, roll_deg)
    )
    if height is not None and not 0.1 <= height <= 1000.0:
        refuse(f"--height: expected metres from 0.1 to 1000, got {height:g}")
    return Known(pitch, roll, None if height is None else (height, sigma))


def _of_file(
    source: Path,
    choice: CameraChoice,
    tracks: bool | None,
    known: Known,
    sizes: SizePrior,
    focal: bool,
    options: Options,
    threads: int | None,
) -> Calibration:
    from groundpose.cli.seen_traffic import holds_poses, read_frames, read_poses

    if not holds_poses(source):
        seen = read_frames(source, tracks)
        _complain(seen.bad)
        return calibrate_sightings(
            seen.sightings(str(source)), known, sizes, focal, options, threads, source.name
        )
    if focal:
        raise InputError("--focal: expected frames with keypoints, got poses")
    view = choice.of_all()
    if view is None:
        raise InputError(f"{source}: expected --calib with the camera of the poses, got none")
    read = read_poses(source, view, tracks, sizes)
    _complain(read.bad)
    return calibrate_contacts(view.camera, read.contacts, (view.pitch, view.roll), known, source.name)


def _of_images(
    source: Path,
    found_by: BoxChoice,
    choice: CameraChoice,
    network: Path | None,
    tracks: bool | None,
    known: Known,
    sizes: SizePrior,
    focal: bool,
    options: Options,
    threads: int | None,
) -> Calibration:
    from groundpose.cli.images import ImageWork
    from groundpose.cli.seen_traffic import of_results
    from groundpose.keypoints.network import Network
    from groundpose.keypoints.pipeline import Pipeline

    found_by.check(source)
    pitch, roll = (None if told is None else told[0] for told in (known.pitch, known.roll))
    crew, each = split(threads, is_several(source))
    pipeline = Pipeline(Network(network, each), options=options, threads=threads)
    work = ImageWork(source, found_by, choice, Mounting(pitch, roll), -math.inf, pipeline, crew=crew)
    seen = of_results(iter(work), tracks)
    _complain(seen.bad)
    for remark in work.remarks():
        console(stderr=True).print(remark, style="dim")
    return calibrate_sightings(
        seen.sightings(str(source)), known, sizes, focal, options, threads, source.name
    )


def _complain(bad: list[InputError]) -> None:
    """Name the first few of what was left out, and count all."""
    for error in bad[:5]:
        complain(error)
    if len(bad) > 5:
        complain(f"and {len(bad) - 5} more left out")


def _tell(found: Calibration, out: Path) -> None:
    """What was learned, on standard output."""
    profile = found.profile
    view = profile.view
    rows = [
        f"pitch {math.degrees(view.pitch):.2f} +- {math.degrees(profile.pitch_sigma):.2f} degrees",
        f"roll {math.degrees(view.roll):.2f} +- {math.degrees(profile.roll_sigma):.2f} degrees",
        f"height {view.height:.2f} +- {profile.height_sigma:.2f} m",
    ]
    if found.focal is not None:
        rows.append(f"focal length {view.camera.fx:.0f} +- {profile.focal_sigma * view.camera.fx:.0f} px")
    rows += [
        f"{name}: {math.exp(mean):.3f} +- {sigma:.3f} of the model's size"
        for name, (mean, sigma) in profile.class_scales.items()
    ]
    for row in rows:
        typer.echo(row)
    for remark in profile.remarks:
        console(stderr=True).print(remark, style="yellow")
    typer.echo(f"{profile.vehicles} vehicles, {profile.sightings} sightings: {out.resolve()}")
