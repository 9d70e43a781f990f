"""`groundpose estimate`: images or frames with keypoints in, poses out."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from groundpose._core import InputError
from groundpose.camera_profile import CameraProfile
from groundpose.cli.cameras import CameraChoice
from groundpose.cli.inputs import NetworkFile, is_image
from groundpose.cli.learned import LearnedCamera
from groundpose.cli.options import takes_options
from groundpose.cli.output import FORMATS, Output, Pictures, Style, mistakes, refuse
from groundpose.cli.run import Mounting, Result, run
from groundpose.estimate import estimate_poses
from groundpose.formats.frames import Frame, FrameSource
from groundpose.formats.records import pose_record, tilt_members
from groundpose.frame import FramePriors
from groundpose.options import Options
from groundpose.poses import PoseBatch
from groundpose.sizes import REGIONS, SizePrior
from groundpose.vehicles.words import class_names


@takes_options
def estimate(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="INPUT",
            help="An image, a folder of images or a video, with [bold]--boxes[/bold]; or frames with "
            "keypoints: one (.json), JSON lines (.jsonl), or - for standard input.",
        ),
    ],
    boxes: Annotated[
        Path | None,
        typer.Option(
            help="2D boxes: KITTI, COCO, YOLO, VOC, CVAT, MOT, CSV, JSON ...; of a folder one file or "
            "a folder."
        ),
    ] = None,
    classes: Annotated[
        list[str] | None,
        typer.Option(
            help="What a name (or number) of the boxes' classes means: car, van_bus, pickup, box_truck, "
            "vehicle or none; beside the usual words. May be given several times.",
            metavar="NAME=CLASS",
            show_default=False,
        ),
    ] = None,
    exif: Annotated[
        bool,
        typer.Option(help="Whether pictures are turned as their EXIF data asks.", show_default=False),
    ] = True,
    calib: Annotated[
        Path | None,
        typer.Option(
            help="The camera: KITTI, OpenCV, ROS, nuScenes, JSON ...; of a folder one file or a folder."
        ),
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Which camera of [bold]--calib[/bold], when it has several."),
    ] = None,
    fov_deg: Annotated[
        float | None,
        typer.Option(
            metavar="DEG", help="Horizontal field of view of an ideal lens, instead of [bold]--calib[/bold]."
        ),
    ] = None,
    network: NetworkFile = None,
    min_score: Annotated[
        float | None, typer.Option(help="Leave out boxes whose score is lower.", show_default="none")
    ] = None,
    vehicle_threshold: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1.0,
            help="No pose for boxes whose probability to hold a vehicle is lower; 0: for all.",
            show_default="the network's",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            help="File to write, or a folder. Of images it takes the pictures too, beside the file.",
        ),
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help=f"{', '.join(FORMATS)}; default: table on a terminal, else jsonl.")
    ] = "",
    draw: Annotated[
        Path | None, typer.Option(help="Write a picture; with several frames put {id} into its name.")
    ] = None,
    pictures: Annotated[
        bool, typer.Option(help="Whether -o takes pictures of images.", show_default=False)
    ] = True,
    pitch_deg: Annotated[
        float | None, typer.Option(help="Pitch of the camera, instead of the frames'.")
    ] = None,
    roll_deg: Annotated[
        float | None, typer.Option(help="Roll of the camera, instead of the frames'.")
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(
            help="Height of the camera above the road, instead of the frames'; all vehicles of a frame then "
            "stand on one road.",
            metavar="METRES",
        ),
    ] = None,
    region: Annotated[
        str | None,
        typer.Option(
            help=f"Where vehicles are as large as there: {', '.join(REGIONS)}; they then stand on one road.",
            metavar="NAME",
            show_default="every vehicle alone",
        ),
    ] = None,
    profile: Annotated[
        Path | None,
        typer.Option(
            help="Camera profile of [bold]groundpose calibrate[/bold]: camera, tilt and height of all "
            "frames, with standard deviations; instead of [bold]--calib[/bold].",
            metavar="FILE",
            show_default="none",
        ),
    ] = None,
    learn_camera: Annotated[
        Path | None,
        typer.Option(
            help="Learn the camera's height, mean tilt and the sizes of vehicles from frame to frame; a file "
            "(.json) to go on with and to write.",
            metavar="FILE",
            show_default="every frame alone",
        ),
    ] = None,
    frame_tilt_sigma_deg: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of a frame's tilt about the nominal one, to estimate it.",
            metavar="DEG",
            show_default="the nominal tilt is the frame's",
        ),
    ] = None,
    threads: Annotated[int | None, typer.Option(min=1, show_default="all cores", help="Threads.")] = None,
    *,
    options: Options,
) -> None:
    """Estimate the poses of the vehicles of images, or of objects whose keypoints are known.

    Of an image the bundled network finds the keypoints in the boxes; each
    vehicle gets class, pose and shape. Frames are JSON: camera, tilt,
    models, and of each object its keypoints, box and model. Results are
    written as they come and stay when the run is interrupted.

    Exit status: 1 when some images or lines were bad (the others are
    done), 2 when nothing could be done.

    [bold]Examples[/bold]

      groundpose estimate street.png --boxes boxes.json --calib camera.json --pitch-deg -1.5 -o poses.jsonl

      groundpose estimate training/image_2 --boxes training/label_2 --calib training/calib -o results/

      groundpose estimate drive.mp4 --boxes coco.json --calib camera.json -o results/ --no-pictures

      groundpose estimate drive/ --boxes coco.json --calib camera.json --height 1.65 --region europe -o out/

      groundpose estimate frame.json --draw poses.png

      zcat drive.jsonl.gz | groundpose estimate - --format kitti -o results/
    """
    form = form or ("table" if out is None and sys.stdout.isatty() else "jsonl")
    if form not in FORMATS:
        refuse(f"--format: expected {', '.join(FORMATS)}, got {form!r}")
    with mistakes():
        angles = (pitch_deg, roll_deg, frame_tilt_sigma_deg)
        pitch, roll, sigma = (None if angle is None else math.radians(angle) for angle in angles)
        told = (calib, fov_deg, pitch_deg, roll_deg, height)
        known = None if profile is None else _profile(profile, *told)
        frame = _frame(height, region, learn_camera) if known is None else _known_frame(known, region)
        learned = None if learn_camera is None or frame is None else LearnedCamera(learn_camera, frame)
        mounting = Mounting(pitch, roll, height, sigma, frame, learned, None if known is None else known.view)
        job = _Job(options, threads, mounting, out, form, draw)
        meant = _meant(classes or [])
        if boxes is not None or is_image(source):
            seen_by = CameraChoice(calib if profile is None else profile, camera, fov_deg)
            status = job.images(
                source, boxes, seen_by, network, vehicle_threshold, min_score, pictures, meant, exif
            )
        else:
            for_images = {
                "calib": calib,
                "camera": camera,
                "fov-deg": fov_deg,
                "network": network,
                "min-score": min_score,
                "vehicle-threshold": vehicle_threshold,
                "no-pictures": None if pictures else True,
                "classes": classes or None,
                "no-exif": None if exif else True,
            }
            status = job.frames(source, for_images)
    raise typer.Exit(status)


def _profile(path: Path, *instead: object) -> CameraProfile:
    """The profile of a file, which says all of the camera."""
    if any(value is not None for value in instead):
        options = "--calib, --fov-deg, --pitch-deg, --roll-deg and --height"
        refuse(f"--profile: says camera, tilt and height; leave out {options}")
    return CameraProfile.load(path)


def _known_frame(profile: CameraProfile, region: str | None) -> FramePriors:
    """What a profile says of each frame; the sizes of a region instead of those that it learned."""
    priors = profile.priors()
    return priors if region is None else replace(priors, size=SizePrior.region(region))


def _frame(height: float | None, region: str | None, learn_camera: Path | None) -> FramePriors | None:
    """All vehicles on one road where a height or a region is given, or the camera is learned."""
    if height is None and region is None and learn_camera is None:
        return None
    return FramePriors(size=SizePrior.region(region or "world"))


def _meant(classes: list[str]) -> dict[str, str]:
    """`NAME=CLASS` as names and classes."""
    for text in classes:
        if "=" not in text:
            refuse(f"--classes: expected NAME=CLASS, got {text!r}")
    pairs = (text.rpartition("=") for text in classes)
    return class_names({name: meant for name, _, meant in pairs}, "--classes")


@dataclass(frozen=True)
class _Job:
    """What is said of the method and of the results."""

    options: Options
    threads: int | None
    mounting: Mounting
    out: Path | None
    form: str
    draw: Path | None

    def images(
        self,
        source: Path,
        boxes: Path | None,
        camera: CameraChoice,
        network: Path | None,
        vehicle_threshold: float | None,
        min_score: float | None,
        pictures: bool,
        classes: Mapping[str, str],
        exif: bool,
    ) -> int:
        """Estimate images; returns the exit status."""
        from groundpose.cli.images import STYLE, ImageWork, destinations
        from groundpose.keypoints.pipeline import Pipeline  # with the network and the vehicles' models

        if boxes is None:
            refuse(f"{source}: is an image or a folder; give the 2D boxes too, --boxes FILE")
        pipeline = Pipeline(
            network,
            options=self.options,
            threads=self.threads,
            vehicle_threshold=vehicle_threshold,
            classes=classes,
        )
        least = -math.inf if min_score is None else min_score
        work = ImageWork(source, boxes, camera, self.mounting, least, pipeline, exif)
        lines, picture = destinations(self.out, self.form, work.several)
        for given in (source, boxes, camera.calibration):
            if lines is not None and given is not None and lines.exists() and lines.samefile(given):
                refuse(f"-o {self.out}: {lines} is an input; give another name")
        drawn = self._pictures(work.several, picture if pictures else None)
        return run(work, Output(lines, self.form, work.several, STYLE), drawn)

    def frames(self, source: Path, for_images: Mapping[str, object]) -> int:
        """Estimate frames that have keypoints; returns the exit status."""
        for name, value in for_images.items():
            if value is not None:
                refuse(f"--{name}: is for images, which are given with --boxes")
        with _open(source, self.out) as frames:
            work = _FrameWork(frames, self.options, self.threads, self.mounting)
            drawn = self._pictures(frames.several)
            style = Style(pose_record if self.mounting.frame_sigma is None else _tilted_record)
            return run(work, Output(self.out, self.form, frames.several, style), drawn)

    def _pictures(self, several: bool, instead: Path | None = None) -> Pictures | None:
        path = self.draw or instead
        return None if path is None else Pictures(path, several)


@dataclass(frozen=True)
class _FrameWork:
    """Frames with keypoints, estimated one after the other."""

    source: FrameSource
    options: Options
    threads: int | None
    mounting: Mounting
    noun = "frames"
    total = None

    @property
    def name(self) -> str:
        return self.source.name

    @property
    def several(self) -> bool:
        return self.source.several

    def __iter__(self) -> Iterator[Result | InputError]:
        for frame in self.source:
            try:
                if isinstance(frame, InputError):
                    raise frame
                tilted = replace(frame, view=self.mounting.of(frame.view))
                poses = estimate_poses(
                    **tilted.arguments,
                    options=self.options,
                    threads=self.threads,
                    **self.mounting.arguments(tilted.view),
                )
            except InputError as error:
                yield error
            else:
                yield Result(tilted, poses)

    def remarks(self) -> list[str]:
        return self.mounting.remarks()


def _tilted_record(frame: Frame, poses: PoseBatch) -> str:
    """With the tilt of the frame, which was estimated."""
    return pose_record(frame, poses, tilt_members(poses.view))


@contextmanager
def _open(frames: Path, out: Path | None) -> Iterator[FrameSource]:
    if str(frames) == "-":
        yield FrameSource(sys.stdin.buffer, "standard input", Path())
        return
    if out is not None and out.exists() and frames.exists() and out.samefile(frames):
        refuse(f"-o {out}: is the input; give another name")
    with frames.open("rb") as stream:
        yield FrameSource(stream, str(frames), frames.parent)
