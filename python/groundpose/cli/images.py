"""`groundpose estimate` of images: boxes and cameras from files, keypoints from the network."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import input_error
from groundpose._core import InputError
from groundpose.cli.cameras import CameraChoice, remark_on
from groundpose.cli.inputs import PICTURES, companion, is_video, pictures, video
from groundpose.cli.output import Style
from groundpose.cli.run import Mounting, Result
from groundpose.formats.boxes import ANY, Box, Boxes, read_boxes
from groundpose.formats.frames import Frame, FrameObject
from groundpose.formats.kitti.labels import TYPE_OF
from groundpose.formats.records import pose_record, tilt_members
from groundpose.keypoints.image import as_rgb
from groundpose.keypoints.pipeline import NOT_A_VEHICLE, Pipeline, VehiclePoses
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
        pipeline: that finds the poses.

    Attributes:
        left_out: how many boxes were left out, by reason.
        seen: what looks wrong in the cameras, and in how many images.
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
    left_out: Counter[str] = field(default_factory=Counter)
    seen: Counter[str] = field(default_factory=Counter)
    no_vehicle: int = 0
    noun = "images"

    def __post_init__(self) -> None:
        """Find the images, read what is for all of them."""
        self.name = str(self.path)
        self._pictures = None if is_video(self.path) else pictures(self.path)
        #: None: only reading the video tells.
        self.total = None if self._pictures is None else len(self._pictures)
        self.several = self._pictures is None or self.path.is_dir()
        self._boxes = None if self.boxes.is_dir() else read_boxes(self.boxes)
        if self.several and self._boxes and ANY in self._boxes.images:
            raise input_error(str(self.boxes), "boxes that name their images", "those of one image")
        self._view = self.camera.of_all()
        if not self.camera.is_given and self._boxes and not any(b.view for b in self._boxes.images.values()):
            raise _no_camera(self.name)

    def __iter__(self) -> Iterator[Result | InputError]:
        """Images in order; a bad one gives its error and the next one goes on."""
        if self._pictures is None:
            for number, image in enumerate(video(self.path)):
                yield self._done(number, f"{number:06d}", self.path, image)
        else:
            for label, path in self._pictures:
                yield self._done(label, path.name, path)

    def remarks(self) -> list[str]:
        """What was left out, and what held no vehicle."""
        said = [f"{remark} ({count} x)" for remark, count in self.seen.most_common()]
        said += [f"left out: {count} x {reason}" for reason, count in self.left_out.most_common()]
        if self.no_vehicle:
            said.append(f"{self.no_vehicle} box{'es hold' if self.no_vehicle > 1 else ' holds'} no vehicle")
        return said + self.mounting.remarks()

    def _done(
        self, label: str | int, name: str, path: Path, image: NDArray[np.uint8] | None = None
    ) -> Result | InputError:
        """The poses of one image, or what is wrong with it; `name` is what boxes may call it."""
        try:
            pixels = as_rgb(path if image is None else image)
            found = self._boxes_of(name)
            view = self._view_of(name, found, (pixels.shape[1], pixels.shape[0]))
            boxes = [box for box in found.boxes if self._keeps(box)]
            poses = self._poses(path, pixels, boxes, view)
        except InputError as error:
            return error
        except OSError as error:
            return InputError(f"{error.filename or path}: {error.strerror or error}")
        self.no_vehicle += int((poses.status == NOT_A_VEHICLE).sum())
        return Result(_frame(label, path, boxes, poses), poses, pixels)

    def _keeps(self, box: Box) -> bool:
        """Whether a box is taken; else the reason is counted."""
        if not box.is_vehicle:
            self.left_out[f"{box.name}, no vehicle"] += 1
        elif box.score < self.min_score:
            self.left_out[f"score below {self.min_score:g}"] += 1
        else:
            return True
        return False

    def _boxes_of(self, name: str) -> Boxes:
        file = self._boxes or read_boxes(companion(self.boxes, name))
        return file.of(name)

    def _view_of(self, name: str, boxes: Boxes, size: tuple[int, int]) -> View:
        view = self._view or self.camera.of_one(name, size) or boxes.view
        if view is None:
            raise _no_camera(name)
        if remark := remark_on(view.camera, size):
            self.seen[remark] += 1
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
    """The JSON line of `formats.records.pose_record` with what the network found: image and tilt; of each
    object its box, the probabilities of a vehicle and of its class, and its keypoints with their scores."""
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
    return pose_record(frame, poses, {"image": str(frame.image), **tilt_members(poses.view)}, each)


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
