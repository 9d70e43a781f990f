"""`groundpose estimate`: images or frames with keypoints in, poses out."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from groundpose._checks import input_error, radians
from groundpose.cli.asked import asked
from groundpose.cli.box_choice import BoxChoice
from groundpose.cli.cameras import CameraChoice
from groundpose.cli.destination import FORMATS, Inputs
from groundpose.cli.estimate_job import Job
from groundpose.cli.frames import images_of
from groundpose.cli.inputs import NetworkFile, is_image, is_table, stamps
from groundpose.cli.known_camera import profiled_frame, read_profile
from groundpose.cli.learned import LearnedCamera
from groundpose.cli.options import takes_options
from groundpose.cli.output import mistakes, refuse, standard_output
from groundpose.cli.run import Mounting
from groundpose.frame import FramePriors
from groundpose.options import Options
from groundpose.sizes import REGIONS, SizePrior
from groundpose.vehicles.words import class_names


@takes_options
def estimate(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="INPUT",
            help="An image, a folder of images, a pattern ('frame_%06d.png', 'frame_*.png'), a video or a "
            "recording (.mcap, a bag of ROS), with [bold]--boxes[/bold] or [bold]--detector[/bold]; or "
            "frames with keypoints: one (.json), JSON lines (.jsonl), or - for standard input; or frames in "
            "Parquet files: one, or a folder.",
        ),
    ],
    boxes: Annotated[
        Path | None,
        typer.Option(
            help="2D boxes: KITTI, COCO, YOLO, VOC, CVAT, MOT, CSV, JSON ...; of a folder one file or "
            "a folder."
        ),
    ] = None,
    detector: Annotated[
        Path | None,
        typer.Option(
            help="Instead of boxes, a detector that was exported to ONNX: YOLOX, YOLOv5 to YOLO26, RT-DETR, "
            "RF-DETR, DETR.",
            metavar="FILE",
        ),
    ] = None,
    detector_score: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1.0,
            help="Leave out what the detector is less sure of.",
            show_default="0.3 for YOLO, 0.5 for DETR",
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
    topic: Annotated[
        str | None, typer.Option(help="Of a recording's images, when it has several.", metavar="NAME")
    ] = None,
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
            help="File to write (.jsonl, .csv, .parquet, .txt), or a folder. Of images it takes the pictures "
            "too, beside the file.",
        ),
    ] = None,
    form: Annotated[
        str,
        typer.Option(
            "--format",
            help=f"{', '.join(FORMATS)}; default: by the ending of -o, a table on a terminal, else jsonl.",
        ),
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
    providers: Annotated[
        list[str] | None,
        typer.Option(
            "--provider",
            help="What runs the networks: cuda, tensorrt, coreml, openvino, cpu ..., as far as onnxruntime "
            "has it. May be given several times, in order.",
            metavar="NAME",
            show_default="cpu",
        ),
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit status 1 also when one vehicle has no pose or is left out.")
    ] = False,
    *,
    options: Options,
) -> None:
    """Estimate the poses of the vehicles of images, or of objects whose keypoints are known.

    Of an image the bundled network finds the keypoints in the boxes; each
    vehicle gets class, pose and shape. Frames are JSON: camera, tilt,
    models, and of each object its keypoints, box and model. What an
    interrupted run has finished is kept; the same command goes on.

    Exit status: 0 when all went well; 1 when some images or lines were
    bad (the others are done), when there are vehicles but not one pose,
    with [bold]--strict[/bold] when anything was left out; 2 when the
    call was wrong and nothing was done.

    [bold]Examples[/bold]

      groundpose estimate street.png --boxes boxes.json --calib camera.json --pitch-deg -1.5 -o poses.jsonl

      groundpose estimate training/image_2 --boxes training/label_2 --calib training/calib -o results/

      groundpose estimate drive.mp4 --boxes coco.json --calib camera.json -o results/ --no-pictures

      groundpose estimate frames/ --detector yolox_s.onnx --calib camera.yaml -o results/

      groundpose estimate drive/ --boxes coco.json --calib camera.json --height 1.65 --region europe -o out/

      groundpose estimate drive/ --boxes boxes/ --calib camera.json -o poses.csv --no-pictures --strict

      groundpose estimate frame.json --draw poses.png

      zcat drive.jsonl.gz | groundpose estimate - --format kitti -o results/
    """
    tables = stamps(source) if is_table(source) else None
    said = asked(locals())
    with mistakes():
        form = form or ("table" if out is None and standard_output().isatty() else "")
        pitch, roll = _radians("--pitch-deg", pitch_deg, 90.0), _radians("--roll-deg", roll_deg, 180.0)
        sigma = _radians("--frame-tilt-sigma-deg", frame_tilt_sigma_deg, 360.0)
        if sigma is not None and sigma <= 0.0:
            raise input_error("frame_tilt_sigma", "a positive number of degrees", f"{frame_tilt_sigma_deg:g}")
        told = {"calib": calib, "fov_deg": fov_deg, "pitch_deg": pitch_deg, "roll_deg": roll_deg}
        known = None if profile is None else read_profile("--profile", profile, **told, height=height)
        frame = _frame(height, region, learn_camera) if known is None else profiled_frame(known, region)
        learned = None if learn_camera is None or frame is None else LearnedCamera(learn_camera, frame)
        mounting = Mounting(pitch, roll, height, sigma, frame, learned, None if known is None else known.view)
        files = (boxes, detector, calib, profile, network, learn_camera)
        of_pictures = boxes is not None or detector is not None or is_image(source)
        named = None if of_pictures and tables is None else partial(images_of, source, tables is not None)
        read = Inputs(source, tuple(path for path in files if path), named)
        job = Job(options, threads, mounting, out, form, draw, strict, read, said)
        meant = named_classes(classes or [])
        for_files = {
            "boxes": boxes,
            "calib": calib,
            "camera": camera,
            "fov-deg": fov_deg,
            "min-score": min_score,
            "no-pictures": None if pictures else True,
            "no-exif": None if exif else True,
            "provider": providers or None,
            "topic": topic,
        }
        if tables is not None:
            frames = (network, detector, detector_score, vehicle_threshold, meant)
            status = job.tables(source, for_files, *frames)
        elif of_pictures:
            seen_by = CameraChoice(calib if profile is None else profile, camera, fov_deg)
            found_by = BoxChoice(boxes, detector, detector_score)
            status = job.images(
                *(source, found_by, seen_by, network, vehicle_threshold, min_score, pictures, meant, exif),
                providers=providers or None,
                topic=topic,
            )
        else:
            for_images = {
                "detector-score": detector_score,
                **for_files,
                "network": network,
                "vehicle-threshold": vehicle_threshold,
                "classes": classes or None,
            }
            status = job.frames(source, for_images)
    raise typer.Exit(status)


def _frame(height: float | None, region: str | None, learn_camera: Path | None) -> FramePriors | None:
    """All vehicles on one road where a height or a region is given, or the camera is learned."""
    if height is None and region is None and learn_camera is None:
        return None
    return FramePriors(size=SizePrior.region(region or "world"))


def _radians(option: str, degrees: float | None, limit: float) -> float | None:
    return None if degrees is None else radians(option, degrees, limit)


def named_classes(classes: list[str]) -> dict[str, str]:
    """`NAME=CLASS` as names and classes."""
    for text in classes:
        if "=" not in text:
            refuse(f"--classes: expected NAME=CLASS, got {text!r}")
    pairs = (text.rpartition("=") for text in classes)
    return class_names({name: meant for name, _, meant in pairs}, "--classes")
