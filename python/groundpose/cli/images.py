"""`groundpose estimate` of images: boxes and cameras from files, keypoints from the network."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import input_error
from groundpose._core import InputError
from groundpose.cli.cameras import CameraChoice
from groundpose.cli.inputs import PICTURES, companion, frame_companion, is_video, pictures, video
from groundpose.cli.output import Style
from groundpose.cli.run import Mounting, Result
from groundpose.formats.boxes import ANY, Box, Boxes, BoxFile, read_boxes
from groundpose.formats.frames import Frame, FrameObject
from groundpose.formats.kitti.labels import TYPE_OF
from groundpose.formats.records import pose_record, tilt_members
from groundpose.formats.skips import Skips
from groundpose.frame import EstimatedView
from groundpose.keypoints.image import as_rgb
from groundpose.keypoints.pipeline import NOT_A_VEHICLE, Pipeline, VehiclePoses
from groundpose.plausibility import other_reading
from groundpose.types import View


@dataclass
class ImageWork:
    """Images, their boxes and cameras, estimated one after the other; see `cli_run.Work`.

    Args:
        path: a picture, a folder of pictures or a video.
        boxes: a file with the boxes of the image or of all images, or a folder with a file per image.
        camera: what is said of the camera; nothing: the boxes have it.
        mounting: instead of what the files say.
        min_score: boxes that a detector gives a lower score are left out.
        pipeline: that finds the poses; its `classes` say which boxes are vehicles'.
        exif: whether pictures are turned as their EXIF data asks.

    Attributes:
        left_out: how many boxes were left out, by reason.
        skipped: entries of the files of boxes that are no boxes.
        kept: how many boxes were looked at.
        no_vehicle: how many boxes hold no vehicle.

    Raises:
        OSError: no such file. InputError: a folder without pictures, a file that no format suits.
    """

    path: Path
    boxes: Path
    camera: CameraChoice
    mounting: Mounting
    min_score: float
    pipeline: Pipeline
    exif: bool = True
    left_out: Counter[str] = field(default_factory=Counter)
    skipped: Skips = field(default_factory=Skips)
    kept: int = 0
    no_vehicle: int = 0
    noun = "images"

    def __post_init__(self) -> None:
        """Find the images, read what is for all of them."""
        self.name = str(self.path)
        self._remarks: dict[str, list[str]] = {}
        self._pictures = None if is_video(self.path) else pictures(self.path)
        #: None: only reading the video tells.
        self.total = None if self._pictures is None else len(self._pictures)
        self.several = self._pictures is None or self.path.is_dir()
        self._boxes = None if self.boxes.is_dir() else read_boxes(self.boxes)
        if self._boxes:
            self.skipped.merge(self._boxes.skipped)
        if self.several and self._boxes and ANY in self._boxes.images:
            raise input_error(str(self.boxes), "boxes that name their images", "those of one image")
        self._view = self.camera.of_all()
        if not self.camera.is_given and self._boxes and not any(b.view for b in self._boxes.images.values()):
            raise _no_camera(self.name)

    def __iter__(self) -> Iterator[Result | InputError]:
        """Images in order; a bad one gives its error and the next one goes on."""
        if self._pictures is None:
            for number, image in enumerate(video(self.path)):
                yield self._done(number, f"{number:06d}", self.path, image, number)
        else:
            for label, path in self._pictures:
                yield self._done(label, path.name, path)

    def remarks(self) -> list[str]:
        """What was left out, what held no vehicle, and what looks wrong: once for each kind."""
        said = [f"left out: {count} x {reason}" for reason, count in self.left_out.most_common()]
        if self.left_out and not self.kept:
            said.append("no box is left; --classes NAME=CLASS says which names are vehicles")
        said += [f"left out: {line}" for line in self.skipped.lines()]
        if self.no_vehicle:
            said.append(f"{self.no_vehicle} box{'es hold' if self.no_vehicle > 1 else ' holds'} no vehicle")
        for first, *more in self._remarks.values():
            said.append(first + (f" (and {len(more)} more {self.noun})" if more else ""))
        return said + self.mounting.remarks()

    def _done(
        self,
        label: str | int,
        name: str,
        path: Path,
        image: NDArray[np.uint8] | None = None,
        number: int | None = None,
    ) -> Result | InputError:
        """The poses of one image, or what is wrong with it; `name` is what boxes may call it, `number` that
        of a video's frame."""
        try:
            pixels = as_rgb(path, self.exif) if image is None else as_rgb(image)
            size = (pixels.shape[1], pixels.shape[0])
            found = self._boxes_of(name, number, size)
            view = self._view_of(name, found, size)
            boxes = [box for box in found.boxes if self._keeps(box)]
            poses = self._poses(path, pixels, boxes, view)
        except InputError as error:
            return error
        except OSError as error:
            return InputError(f"{error.filename or path}: {error.strerror or error}")
        self.kept += len(boxes)
        self.no_vehicle += int((poses.status == NOT_A_VEHICLE).sum())
        poses = replace(poses, input_remarks=(*found.remarks, *poses.input_remarks))
        of_frame = poses.view.remarks if isinstance(poses.view, EstimatedView) else ()
        for remark in (*poses.input_remarks, *of_frame):
            self._remarks.setdefault(remark.partition(":")[0], []).append(f"{path}: {remark}")
        return Result(_frame(label, path, boxes, poses), poses, pixels)

    def _keeps(self, box: Box) -> bool:
        """Whether a box is taken; else the reason is counted."""
        if not box.means_vehicle(self.pipeline.classes):
            number = "" if box.class_id is None else f" (number {box.class_id})"
            self.left_out[f"{box.name}{number}, no vehicle"] += 1
        elif box.score < self.min_score:
            self.left_out[f"score below {self.min_score:g}"] += 1
        else:
            return True
        return False

    def _boxes_of(self, name: str, number: int | None, size: tuple[int, int]) -> Boxes:
        """In pixels of the image. Raises InputError also where most of them must mean something else."""
        file = self._boxes or self._file_of(name, number)
        if file is None:
            return Boxes(())
        found = file.of(name) if number is None or file is not self._boxes else file.frame(number)
        found = found.in_pixels(*size, file.place)
        bboxes = np.array([box.bbox for box in found.boxes], dtype=float).reshape(-1, 4)
        meant = other_reading(bboxes, size)
        if meant:
            expected = f"left, top, right, bottom pixels of {size[0]} x {size[1]}"
            raise input_error(file.place, expected, f"boxes that look like {meant}")
        return found

    def _file_of(self, name: str, number: int | None) -> BoxFile | None:
        """The file of an image in the folder of boxes; None: a frame that has none."""
        path = (
            companion(self.boxes, name) if number is None else frame_companion(self.boxes, self.name, number)
        )
        if path is None:
            return None
        file = read_boxes(path)
        self.skipped.merge(file.skipped)
        if len(file.images) == 1:  # the file's name has said whose boxes it holds
            return replace(file, images={ANY: next(iter(file.images.values()))})
        return file

    def _view_of(self, name: str, boxes: Boxes, size: tuple[int, int]) -> View:
        view = self._view or self.camera.of_one(name, size) or boxes.view
        if view is None:
            raise _no_camera(name)
        return self.mounting.of(view)

    def _poses(self, path: Path, pixels: NDArray[np.uint8], boxes: list[Box], view: View) -> VehiclePoses:
        try:
            bboxes = np.array([box.bbox for box in boxes]).reshape(-1, 4)
            return self.pipeline(pixels, bboxes, view, **self.mounting.arguments(view))
        except InputError as error:
            raise InputError(f"{path}: {error}") from None


def _no_camera(name: str) -> InputError:
    return input_error(
        "--calib", "a file with the camera, which the file of boxes does not have", f"none for {name}"
    )


def _frame(label: str | int, path: Path, boxes: list[Box], poses: VehiclePoses) -> Frame:
    """What was found, as a frame has it."""
    objects = tuple(
        FrameObject(
            box.id,
            class_name,
            pose.keypoints_2d,
            scores[: len(pose.keypoints_2d)].tolist(),
            list(box.bbox),
            box.truth,
            None if math.isnan(box.score) else box.score,
        )
        for box, class_name, pose, scores in zip(
            boxes, poses.classes.tolist(), poses, poses.keypoint_scores, strict=True
        )
    )
    return Frame(label, str(path), poses.view, path, objects, poses.models)


def vehicle_record(frame: Frame, poses: VehiclePoses) -> str:
    """The JSON line of `formats.records.pose_record` with what the network found: image and tilt, and
    remarks if there are any; of each object its box, the probabilities of a vehicle and of its class, and
    its keypoints with their scores."""
    each = [
        {
            "bbox": o.bbox,
            **({} if o.score is None else {"score": o.score}),
            "vehicle_probability": float(vehicle),
            "model_probability": float(probability),
            "keypoints_2d": o.keypoints_2d,
            "keypoint_scores": o.keypoint_scores,
        }
        for o, vehicle, probability in zip(
            frame.objects, poses.vehicle_probability, poses.class_probability, strict=True
        )
    ]
    said = {"remarks": list(poses.input_remarks)} if poses.input_remarks else {}
    return pose_record(frame, poses, {"image": str(frame.image), **tilt_members(poses.view), **said}, each)


STYLE = Style(vehicle_record, lambda item: TYPE_OF.get(item.model, "Car"))
"""Of images: KITTI's text has KITTI's classes."""

_LINES = {"jsonl": ".jsonl", "kitti": ".txt", "table": ".txt"}


def destinations(out: Path | None, form: str, several: bool) -> tuple[Path | None, Path | None]:
    """Where lines and pictures of images go for `-o out`.

    A folder (made if it is new) takes both. A file of lines has its picture (several: a folder of them)
    beside it under the same name, and a picture its lines.
    """
    if out is None:
        return None, None
    suffix = out.suffix.lower()
    if out.is_dir() or not suffix:
        out.mkdir(parents=True, exist_ok=True)
        folder_of_texts = form == "kitti" and several
        return out if folder_of_texts else out / f"poses{_LINES[form]}", out / "{id}_poses.png"
    if suffix in PICTURES | {".svg", ".pdf"}:
        return out.with_suffix(_LINES[form]), out
    return out, out.with_suffix("") / "{id}_poses.png" if several else out.with_suffix(".png")
