"""`groundpose estimate` of images: boxes and cameras from files, keypoints from the network."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import blamed, input_error
from groundpose._core import InputError
from groundpose.cli.box_choice import BoxChoice
from groundpose.cli.cameras import CameraChoice
from groundpose.cli.crew import Crew, done
from groundpose.cli.inputs import Shot, frame_shots, has_frames, is_several, is_video, pictures, shots
from groundpose.cli.results import Style
from groundpose.cli.run import Mounting, Result
from groundpose.formats.boxes import Box, Boxes
from groundpose.formats.frames import Frame, FrameObject
from groundpose.formats.kitti.labels import TYPE_OF
from groundpose.formats.records import pose_record, tilt_members
from groundpose.keypoints.image import as_rgb
from groundpose.keypoints.live import LiveFrames
from groundpose.keypoints.pipeline import Look, Pipeline
from groundpose.keypoints.vehicle_poses import NOT_A_VEHICLE, VehiclePoses
from groundpose.types import View


@dataclass(frozen=True, eq=False)
class _Seen:
    """An image on its way: its pixels, `found` boxes and those taken, its view, what the network saw."""

    shot: Shot
    pixels: NDArray[np.uint8]
    found: Boxes = field(default_factory=lambda: Boxes(()))
    boxes: tuple[Box, ...] = ()
    view: View | None = None
    look: Look | None = None


@dataclass
class ImageWork:
    """Images, their boxes and cameras, poses in their order; see `cli_run.Work`.

    A crew reads images and looks at them ahead; whatever counts, remembers or learns is asked here, in order.

    Args:
        path: a picture, a folder or a pattern of pictures, or a video.
        found_by: what is said of the boxes.
        camera: what is said of the camera; nothing: the boxes have it.
        mounting: instead of what the files say.
        min_score: boxes that a detector gives a lower score are left out.
        pipeline: that finds the poses; its `classes` say which boxes are vehicles'.
        exif: whether pictures are turned as their EXIF data asks.
        topic: of a recording's images. crew: images that are at work at once.
        live: the frames of a camera or a stream instead of files.

    Attributes:
        left_out: how many boxes were left out, by reason.
        kept: how many boxes were looked at.
        no_vehicle: how many boxes hold no vehicle.
        finished: numbers of the images that an interrupted run has finished.

    Raises:
        OSError: no such file. InputError: a folder without pictures, a file that no format suits.
    """

    path: Path
    found_by: BoxChoice
    camera: CameraChoice
    mounting: Mounting
    min_score: float
    pipeline: Pipeline
    exif: bool = True
    topic: str | None = None
    crew: int = 1
    live: LiveFrames | None = None
    left_out: Counter[str] = field(default_factory=Counter)
    kept: int = 0
    no_vehicle: int = 0
    finished: Container[int] = ()
    noun = "images"

    def __post_init__(self) -> None:
        """Find the images, read what is for all of them."""
        self.name = str(self.path)
        endless = self.live is not None
        self._pictures = None if endless or has_frames(self.path) else pictures(self.path)
        #: None: only reading the video tells.
        self.total = None if self._pictures is None else len(self._pictures)
        self.several = endless or is_several(self.path)
        self.boxes = self.found_by.source(self.path, self.pipeline, self.several)
        self._view = self.camera.of_all()
        recorded = has_frames(self.path) and not is_video(self.path)
        if not self.camera.is_given and not self.boxes.may_have_cameras and not recorded:
            raise _no_camera(self.name)

    def __iter__(self) -> Iterator[Result | InputError | None]:
        """Images in order; a bad one gives its error and the next one goes on."""
        for _, result in self.with_shots():
            yield result

    def with_shots(self) -> Iterator[tuple[Shot | InputError, Result | InputError | None]]:
        """The same, each with the image before anything was found in it."""
        begun: deque[Shot | InputError] = deque()
        with Crew(self.crew) as crew:
            if self.live is None:
                taken = shots(self.path, self._pictures, self.exif, self.topic)
            else:
                taken = frame_shots(self.path, self.live)
            there = taken if self._pictures is not None else crew.beside(taken)
            boxed = (done(self._boxed, seen) for seen in crew.ahead(self._read, self._asked(there, begun)))
            for seen in crew.ahead(self._looked, boxed):
                result = done(self._done, seen)
                if isinstance(result, BaseException) and not isinstance(result, InputError):
                    raise result
                yield begun.popleft(), result

    def _asked(
        self, there: Iterable[Shot | InputError], begun: deque[Shot | InputError]
    ) -> Iterator[Shot | InputError | None]:
        """The images that are still to be done; all are noted as begun."""
        for number, shot in enumerate(there):
            begun.append(shot)
            yield None if number in self.finished else shot

    @property
    def passed_over(self) -> int:
        """How many boxes were left out or hold no vehicle."""
        return self.left_out.total() + self.boxes.skipped.total + self.no_vehicle

    def remarks(self) -> list[str]:
        """What was left out, and what held no vehicle."""
        said = self.boxes.remarks()
        said += [f"left out: {count} x {reason}" for reason, count in self.left_out.most_common()]
        if self.left_out and not self.kept:
            said.append("no box is left; --classes NAME=CLASS says which names are vehicles")
        said += [f"left out: {line}" for line in self.boxes.skipped.lines()]
        if self.no_vehicle:
            said.append(f"{self.no_vehicle} box{'es hold' if self.no_vehicle > 1 else ' holds'} no vehicle")
        return said + self.mounting.remarks()

    def _read(self, shot: Shot) -> _Seen:
        """An image. Raises InputError for a bad one."""
        with blamed(shot.path):
            return _Seen(shot, as_rgb(shot.path, self.exif) if shot.image is None else as_rgb(shot.image))

    def _boxed(self, seen: _Seen) -> _Seen:
        """With its boxes and its view. Raises InputError for bad ones."""
        with blamed(seen.shot.path):
            found = self.boxes.of(seen.shot, seen.pixels)
            view = self._view_of(seen.shot, found, (seen.pixels.shape[1], seen.pixels.shape[0]))
            boxes = tuple(box for box in found.boxes if self._keeps(box))
        return replace(seen, found=found, boxes=boxes, view=view)

    def _looked(self, seen: _Seen) -> _Seen:
        """With what the network sees. Raises InputError where it cannot look."""
        with blamed(seen.shot.path), _named(seen.shot.path):
            bboxes = np.array([box.bbox for box in seen.boxes]).reshape(-1, 4)
            assert seen.view is not None
            return replace(seen, look=self.pipeline.look(seen.pixels, bboxes, seen.view))

    def _done(self, seen: _Seen) -> Result:
        """The poses of an image. Raises InputError where there cannot be any."""
        path = seen.shot.path
        with blamed(path), _named(path):
            assert seen.look is not None
            assert seen.view is not None
            poses = self.pipeline.solve(seen.look, **self.mounting.arguments(seen.view))
        self.kept += len(seen.boxes)
        no_vehicle = int((poses.status == NOT_A_VEHICLE).sum())
        self.no_vehicle += no_vehicle
        poses = replace(poses, box_remarks=seen.found.remarks)
        return Result(_frame(seen.shot, seen.boxes, poses), poses, seen.pixels, no_vehicle)

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

    def _view_of(self, shot: Shot, boxes: Boxes, size: tuple[int, int]) -> View:
        recorded = None if shot.camera is None else View(shot.camera)
        view = self._view or self.camera.of_one(shot.name, size) or boxes.view or recorded
        if view is None:
            raise _no_camera(shot.name)
        return self.mounting.of(view)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """The pipeline's errors with the image that they are of."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _no_camera(name: str) -> InputError:
    return input_error("--calib", "a file with the camera, which the boxes do not have", f"none for {name}")


def _frame(shot: Shot, boxes: Sequence[Box], poses: VehiclePoses) -> Frame:
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
    place = str(shot.path) if shot.number is None else f"{shot.path}#{shot.name}"
    return Frame(shot.label, place, poses.view, shot.path, objects, poses.models, shot.time)


def vehicle_record(frame: Frame, poses: VehiclePoses) -> str:
    """The JSON line of `formats.records.pose_record` with what the network found: image and tilt, of
    each object its box with the detector's score, the probabilities of a
    vehicle and of its class, and its keypoints with their scores."""
    each = [
        {
            **({} if o.score is None else {"detection_score": o.score}),
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
