"""`groundpose simulate`: frames of a virtual drive with exact labels, with or without pictures."""

from __future__ import annotations

import os
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from groundpose._core import InputError
from groundpose.cli.output import complain, mistakes, refuse, show
from groundpose.cli.progress import bar

RANGE = "LOW..HIGH|VALUE"


class Split(str, Enum):
    """Disjoint ranges of seeds, bodies and skies."""

    TRAIN = "train"
    VALIDATION = "validation"
    TEST = "test"


class Form(str, Enum):
    """File format of the pictures."""

    PNG = "png"
    JPG = "jpg"
    MP4 = "mp4"


def simulate(
    frames: Annotated[int, typer.Option(min=1, help="Number of frames in the finished folder.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to create or to resume.")],
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of the drives.")] = 0,
    split: Annotated[
        Split, typer.Option(help="Split whose seeds, bodies and skies are used; splits have none in common.")
    ] = Split.TRAIN,
    first: Annotated[int, typer.Option(min=0, help="Number of the first frame.")] = 0,
    images: Annotated[
        bool,
        typer.Option("--images/--no-images", " /--labels-only", help="Draw the frames or only label them."),
    ] = True,
    form: Annotated[
        Form,
        typer.Option(
            "--format", help="Format of the pictures; mp4 with --video: jpg, and video.mp4 of them."
        ),
    ] = Form.PNG,
    video: Annotated[
        bool, typer.Option(help="One video instead of drives of 20 frames: vehicles persist and have ids.")
    ] = False,
    fps: Annotated[float, typer.Option(help="Frames a second of --video.")] = 10.0,
    static: Annotated[
        bool, typer.Option(help="With --video: the camera stands on a mast; else it drives.")
    ] = False,
    class_fractions: Annotated[
        str | None,
        typer.Option(metavar="CLASS=FRACTION,...", help="Relative frequency of each class of vehicle."),
    ] = None,
    class_shares: Annotated[str | None, typer.Option(hidden=True)] = None,
    rig: Annotated[
        str, typer.Option(help="Mount of the camera: car, assistance, truck, mast, or mixed (all of them).")
    ] = "car",
    camera_height: Annotated[
        str | None,
        typer.Option(metavar=RANGE, help="Metres above the road; a car's camera stands still from 3 m on."),
    ] = None,
    pitch_deg: Annotated[
        str | None, typer.Option(metavar=RANGE, help="Nominal pitch; negative looks down at the road.")
    ] = None,
    roll_deg: Annotated[str | None, typer.Option(metavar=RANGE, help="Nominal roll.")] = None,
    fov_deg: Annotated[str | None, typer.Option(metavar=RANGE, help="Horizontal field of view.")] = None,
    image_size: Annotated[
        str | None, typer.Option(metavar="WIDTHxHEIGHT", help="Size of the pictures in pixels.")
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; default: one per core.")] = None,
) -> None:
    """Simulate drives: pictures, boxes, poses, keypoints and tilt of every frame.

    Writes labels.jsonl (which [bold]groundpose estimate[/bold] reads), KITTI labels and calibration, COCO
    keypoints and tilt.csv. The same command resumes an interrupted run. The labels depend on the seed, not on
    the number of jobs.

    With --video all frames are one drive: vehicles follow their lanes, stop, turn, change lanes and park.
    training/label_02 (KITTI's tracking format), odometry.csv and notes in labels.jsonl have their tracks,
    times, speeds and yaw rates. The same seed with another number of frames is another video.

    The camera is drawn for each drive of 20 frames or for the video. RANGE is LOW..HIGH or one VALUE and
    replaces that of the rig; the true tilt differs from the nominal one by about a degree.

    [bold]Examples[/bold]

      groundpose simulate --frames 100 --out drive

      groundpose simulate --frames 20000 --out labels --no-images --split test --seed 3

      groundpose simulate --frames 500 --out trucks --class-fractions car=0.2,box_truck=0.8 --format jpg

      groundpose simulate --frames 200 --out mast --camera-height 6..10 --pitch-deg -35..-20 --fov-deg 60

      groundpose simulate --frames 2000 --out all --rig mixed --image-size 1280x720

      groundpose simulate --video --frames 300 --fps 10 --out film --format mp4

      groundpose simulate --video --static --camera-height 7 --pitch-deg -20 --frames 600 --out mast
    """
    fractions = class_fractions if class_shares is None else class_shares  # the option's former name
    with mistakes():
        if form is Form.MP4 and not video:
            raise InputError("--format: expected png or jpg without --video, got mp4")
        _run(
            frames,
            out,
            {
                "seed": seed,
                "split": split.value,
                "first": first,
                "images": form.value if images else None,
                **({} if fractions is None else {"shares": read_fractions(fractions)}),
                "rig": rig_of(rig, static, video),
                "height": read_range("--camera-height", camera_height),
                "pitch_deg": read_range("--pitch-deg", pitch_deg),
                "roll_deg": read_range("--roll-deg", roll_deg),
                "fov_deg": read_range("--fov-deg", fov_deg),
                "image_size": read_size(image_size),
                **({"fps": fps, "frames": frames} if video else {}),
            },
            jobs or os.cpu_count() or 1,
        )


def rig_of(rig: str, static: bool, video: bool) -> str:
    """The rig with `--static`. Raises InputError where that contradicts other options."""
    if not static:
        return rig
    if not video:
        raise InputError("--static: expected --video with it, got none")
    if rig not in ("car", "mast"):
        raise InputError(f"--static: expected --rig mast or none, got {rig}")
    return "mast"


def read_fractions(text: str) -> dict[str, float]:
    """`car=0.6,van_bus=0.4` as numbers by class. Raises InputError."""
    fractions = {}
    for part in text.split(","):
        class_name, _, fraction = part.partition("=")
        try:
            fractions[class_name.strip()] = float(fraction)
        except ValueError:
            raise InputError(f"--class-fractions: expected CLASS=FRACTION,..., got {part!r}") from None
    return fractions


def read_range(option: str, text: str | None) -> tuple[float, float] | None:
    """`3..8` or `5` as low and high. Raises InputError."""
    if text is None:
        return None
    low, dots, high = text.partition("..")
    try:
        return float(low), float(high if dots else low)
    except ValueError:
        raise InputError(f"{option}: expected LOW..HIGH or one VALUE, got {text!r}") from None


def read_size(text: str | None) -> tuple[int, int] | None:
    """`1280x720` as width and height. Raises InputError."""
    if text is None:
        return None
    width, _, height = text.partition("x")
    try:
        return int(width), int(height)
    except ValueError:
        raise InputError(f"--image-size: expected WIDTHxHEIGHT, got {text!r}") from None


def _run(frames: int, out: Path, settings: dict[str, object], jobs: int) -> None:
    """Write the drive with a progress bar on a terminal, then report in one line."""
    from groundpose.draw.film import check_film
    from groundpose.lab.drive.workers import Settings
    from groundpose.lab.drive.write import write_drive

    made = Settings(**settings)  # type: ignore[arg-type]
    if made.images == "mp4":
        check_film("--format")
    if out.exists() and not out.is_dir():
        refuse(f"--out {out}: is a file; give a folder")
    done = 0
    with bar() as progress:
        task = progress.add_task("frames", total=frames)

        def advance(now: int, total: int, objects: int) -> None:
            nonlocal done
            done = now
            progress.update(task, completed=now, total=total, description=f"frames ({objects} objects)")

        try:
            objects = write_drive(out, frames, made, jobs, advance)
        except KeyboardInterrupt:
            complain(f"interrupted; frames finished and written: {done}; the same command goes on")
            raise typer.Exit(130) from None
    show(f"{done} frames, {objects} objects labelled in this run: {out.resolve()}")
