"""Sequences of KITTI's tracking set as the table of vehicles has them: boxes of a detector, keypoints drawn
as a network finds them, truth of the labels. The camera's motion is not known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import groundpose as gp
from groundpose.formats.kitti.labels import CLASS_OF
from groundpose.formats.kitti.table import KittiTable
from groundpose.formats.skips import Skips
from groundpose.lab.contenders.own import DEFAULT
from groundpose.lab.evaluate.kitti.frame import CAMERA_HEIGHT, Prepared, Task, given
from groundpose.lab.evaluate.tracks.keypoints import FollowedKeypoints
from groundpose.lab.evaluate.tracks.sequence import Sequence, SequenceFrame, Truth

FRAME_INTERVAL = 0.1
LONGEST_PAUSE = 15
"""Frames; after a longer one the sequence is another one: a tracker would begin again."""


@dataclass(frozen=True)
class KittiSequences:
    """The sequences of a table.

    Args:
        path: of the table.
        error_time: within which the network forgets its errors, s.
        height: whether the camera's height is known; all vehicles of a frame then stand on one road.
        seed: of the keypoints.
    """

    path: Path
    error_time: float = 1.0
    height: bool = False
    seed: int = 0

    def __iter__(self) -> Iterator[Sequence]:
        """The sequences, cut at long pauses."""
        table = KittiTable(self.path, with_detections=True)
        for name, ids in parts(table.ids()):
            found = Sequence(name, gp.View(table.read(ids[0], Skips()).camera), [], "unknown")  # type: ignore[union-attr]
            source = FollowedKeypoints(name, self.error_time, self.seed)
            for frame_id in ids:
                made = self._frame(table, frame_id, source)
                if made is not None:
                    found.frames.append(made)
            yield found

    def _frame(self, table: KittiTable, frame_id: str, source: FollowedKeypoints) -> SequenceFrame | None:
        frame = table.read(frame_id, Skips())
        if frame is None:
            return None
        time = FRAME_INTERVAL * int(frame_id.partition("/")[2])
        usable = [k for k, label in enumerate(frame.labels) if label.type in CLASS_OF]
        numbers = table.vehicles(frame_id)
        detections = table.detections(frame_id)
        seen = [k for k in usable if detections[k] is not None]
        boxes = [box for k in seen if (box := detections[k]) is not None]
        labels = [frame.labels[k] for k in seen]
        bboxes = np.array([box.bbox for box in boxes]).reshape(-1, 4)
        vehicle = np.array([numbers[k] for k in seen], dtype=np.int64)
        task = Task(keypoints="simulated", height=CAMERA_HEIGHT if self.height else None)
        if seen:
            found = source(frame, time, bboxes, labels, vehicle.tolist())
            objects = given(frame, Prepared(boxes, [*labels], 0, found), task)
            poses = DEFAULT.poses(replace(objects, frame=gp.FramePriors() if self.height else None))
        else:
            poses = gp.estimate_poses(gp.View(frame.camera), [], None, [])
        told = [frame.labels[k] for k in usable]
        t = np.array([x.location for x in told]).reshape(-1, 3) + frame.camera_from_labels
        truth = Truth(
            id=np.array([numbers[k] for k in usable], dtype=np.int64),
            place=(t @ poses.view.R_camera_from_ground)[:, [0, 2]],
            heading=np.array([x.rotation_y for x in told]) + 0.5 * np.pi,
            size=np.array([(x.length, x.height, x.width) for x in told]).reshape(-1, 3),
            bbox=np.array([x.bbox for x in told]).reshape(-1, 4),
            speed=np.full(len(told), np.nan),
        )
        scores = np.array([box.score or 0.0 for box in boxes])
        return SequenceFrame(time, poses, scores, vehicle, truth)


def parts(ids: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Frames of one sequence without a long pause, with a name."""
    group: list[str] = []
    for frame_id in ids:
        sequence, _, number = frame_id.partition("/")
        if group:
            before, _, last = group[-1].partition("/")
            if before != sequence or int(number) - int(last) > LONGEST_PAUSE:
                yield group[0], group
                group = []
        group.append(frame_id)
    if group:
        yield group[0], group
