"""What `groundpose calibrate` reads: frames with keypoints, poses, or images with boxes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from groundpose._checks import FloatArray, input_error
from groundpose._core import InputError
from groundpose.formats.frames import Frame, FrameSource
from groundpose.formats.pose_lines import PoseLines
from groundpose.self_calibration.contacts import Contacts
from groundpose.self_calibration.linking import linked
from groundpose.self_calibration.sightings import Sightings
from groundpose.shape import ShapeModel
from groundpose.sizes import SizePrior
from groundpose.types import Camera, View

_OK = "ok"


@dataclass
class Seen:
    """Sightings as they come; `bad` frames are named and left out."""

    numbered: bool | None = None
    camera: Camera | None = None
    view: View | None = None
    frames: list[int] = field(default_factory=list)
    ids: list[str | int] = field(default_factory=list)
    keypoints: list[FloatArray] = field(default_factory=list)
    scores: list[FloatArray] = field(default_factory=list)
    bboxes: list[list[float]] = field(default_factory=list)
    models: list[ShapeModel] = field(default_factory=list)
    bad: list[InputError] = field(default_factory=list)
    count: int = 0

    def take(self, frame: Frame) -> None:
        """The objects of a frame that have a whole box. Raises InputError for another camera."""
        if self.camera is None:
            self.camera, self.view = frame.view.camera, frame.view
        elif frame.view.camera != self.camera:
            raise input_error(frame.place, "the camera of the first frame", "another one")
        for item, model in zip(frame.objects, frame.models, strict=True):
            if item.bbox is None or not np.isfinite(np.array(item.bbox, dtype=float)).all():
                continue
            scores = np.ones(len(item.keypoints_2d))
            if item.keypoint_scores is not None:
                scores = np.nan_to_num(np.array(item.keypoint_scores, dtype=float))
            self.frames.append(self.count)
            self.ids.append(item.id)
            self.keypoints.append(item.keypoints_2d)
            self.scores.append(scores)
            self.bboxes.append(item.bbox)
            self.models.append(model)
        self.count += 1

    def sightings(self, place: str) -> Sightings:
        """All of them. Raises InputError where there are none."""
        if self.camera is None or not self.frames:
            raise input_error(place, "frames with vehicles", "none")
        bboxes = np.array(self.bboxes, dtype=float)
        return Sightings(
            self.camera,
            tuple(self.keypoints),
            tuple(self.scores),
            bboxes,
            tuple(self.models),
            linked(self.frames, self.ids, bboxes, self.numbered),
            np.array(self.frames, dtype=float),
        )


def read_frames(path: Path, numbered: bool | None) -> Seen:
    """Of a file of frames. Raises OSError, InputError."""
    seen = Seen(numbered)
    with path.open("rb") as stream:
        for frame in FrameSource(stream, str(path), path.parent):
            try:
                if isinstance(frame, InputError):
                    raise frame
                seen.take(frame)
            except InputError as error:
                seen.bad.append(error)
    return seen


def holds_poses(path: Path) -> bool:
    """Whether a file is one of poses, as `groundpose estimate` writes. Raises OSError."""
    with path.open(encoding="utf-8", errors="surrogateescape") as file:
        head = file.readline()
    return '"status"' in head and '"covariance"' in head


@dataclass(frozen=True, eq=False)
class PosesRead:
    """Contacts of poses, and the lines that could not be read."""

    contacts: Contacts
    bad: list[InputError]


def read_poses(path: Path, view: View, numbered: bool | None, sizes: SizePrior) -> PosesRead:
    """Of a file of poses whose models are classes of vehicles; `view`: of their camera. Raises OSError,
    InputError."""
    rows: list[tuple[int, str | int, ShapeModel, FloatArray, FloatArray, FloatArray]] = []
    bad: list[InputError] = []
    with path.open(encoding="utf-8-sig", errors="replace") as lines:
        for number, found in enumerate(PoseLines(lines, str(path), view)):
            if isinstance(found, InputError):
                bad.append(found)
            else:
                seen = found.seen
                known = np.isfinite(seen.t).all(axis=1) & np.isfinite(seen.covariance).all(axis=(1, 2))
                rows += [
                    (number, found.labels[k], found.models[k], seen.R[k], seen.t[k], seen.covariance[k])
                    for k in np.flatnonzero(known)
                    if found.statuses[k] == _OK
                ]
    if not rows:
        raise input_error(str(path), "poses with status ok and a covariance", "none")
    frames, ids, models, R, t, covariance = zip(*rows, strict=True)
    # Without numbers that go on every sighting is a vehicle: poses have no boxes to link.
    linked_by = linked(frames, ids, np.zeros((len(rows), 4)), numbered)
    sized = [sizes.sized(model) for model in models]
    contacts = Contacts.of(np.stack(R), np.stack(t), np.stack(covariance), sized, linked_by, sizes)
    return PosesRead(contacts, bad)


def of_results(results: Iterator[object], numbered: bool | None) -> Seen:
    """Of images, as they are estimated."""
    from groundpose.cli.run import Result

    seen = Seen(numbered)
    for result in results:
        try:
            if isinstance(result, InputError):
                raise result
            assert isinstance(result, Result)
            seen.take(result.frame)
        except InputError as error:
            seen.bad.append(error)
    return seen
