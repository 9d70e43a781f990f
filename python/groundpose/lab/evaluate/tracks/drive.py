"""Videos of the virtual drive (`groundpose simulate --video`): exact truth, keypoints of the network on the
pictures."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import groundpose as gp
from groundpose._checks import FloatArray, input_error
from groundpose.keypoints.image import as_rgb
from groundpose.keypoints.pipeline import Look
from groundpose.lab.evaluate.simulated.box_noise import draw_boxes
from groundpose.lab.evaluate.tracks.calibrated import bottoms, mean_view, road_view, view_of
from groundpose.lab.evaluate.tracks.sequence import Sequence, SequenceFrame, Truth

LEAST_PX = 16.0
"""A detector finds no smaller boxes."""
MOST_HIDDEN = 0.7
"""A detector finds nothing that is hidden by more."""


@dataclass(frozen=True)
class DriveVideo:
    """A folder that `groundpose simulate --video` wrote.

    Args:
        folder: the folder.
        pipeline: finds keypoints and poses.
        tilt: "nominal"; "true": of each frame; "calibrated": one for all frames, of a camera that stands
            against the road that its vehicles stand on, else the mean of the true ones.
        frame: what is known of each frame; None: every vehicle alone.
        seed: of the detector's boxes.
    """

    folder: Path
    pipeline: gp.Pipeline
    tilt: str = "true"
    frame: gp.FramePriors | None = None
    seed: int = 0
    looks: dict[int, Look] = field(default_factory=dict, compare=False)
    """What the network saw, by the frame's number: of the same pictures and boxes, whatever else is known."""

    def sequence(self, limit: int | None = None, advance: Callable[[int], None] | None = None) -> Sequence:
        """Its frames. Raises OSError, InputError for a folder that is none."""
        lines = (self.folder / "labels.jsonl").read_text(encoding="utf-8").splitlines()[:limit]
        records = [json.loads(line) for line in lines]
        standing = _of_video(records[0] if records else {}, self.folder)["_odometry"]["standing"]
        views = [self._view(record) for record in records]
        if self.tilt == "calibrated":
            views = [road_view(records) if standing else mean_view(views)] * len(records)
        found = Sequence(self.folder.name, views[0], [], "static" if standing else "odometry")
        for k, (record, view) in enumerate(zip(records, views, strict=True)):
            found.frames.append(self._frame(record, view))
            if advance is not None:
                advance(k + 1)
        return found

    @property
    def moves(self) -> bool:
        """Whether its camera does. Raises OSError, InputError for a folder that is none."""
        with (self.folder / "labels.jsonl").open(encoding="utf-8") as file:
            return not _of_video(json.loads(next(file, "{}")), self.folder)["_odometry"]["standing"]

    def _view(self, record: dict[str, Any]) -> gp.View:
        told = record if self.tilt == "nominal" else record["_tilt"]
        return view_of(record, told, None if self.frame is None else record["_tilt"]["camera_height"])

    def _frame(self, record: dict[str, Any], view: gp.View) -> SequenceFrame:
        items = [item for item in record["objects"] if _is_found(item)]
        exact = np.array([item["bbox"] for item in items]).reshape(-1, 4)
        levels = np.array([item["_occlusion"] for item in items], dtype=np.int64)
        size = (record["camera"]["image_size"][0], record["camera"]["image_size"][1])
        boxes = draw_boxes(exact, levels, size, self.seed + record["id"]) if items else exact
        poses = self.pipeline.solve(self._look(record, boxes, view), frame=self.frame)
        return SequenceFrame(
            time=record["_time"],
            poses=poses,
            scores=np.ones(len(items)),
            vehicle=np.array([item["id"] for item in items], dtype=np.int64),
            truth=truth_of(record, poses.view),
            ego=place_of(record),
        )

    def _look(self, record: dict[str, Any], boxes: FloatArray, view: gp.View) -> Look:
        if record["id"] not in self.looks:
            image = as_rgb(self.folder / record["image"])
            self.looks[record["id"]] = self.pipeline.look(image, boxes, view)
        return replace(self.looks[record["id"]], view=view)


def _of_video(record: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The record, if it is one of a video's frames."""
    if "_time" not in record:
        raise input_error(str(folder), "a video of groundpose simulate --video", "another folder")
    return record


def without_motion(sequence: Sequence) -> Sequence:
    """The same when nobody says how the camera moves: true speeds are then relative to it, as those that a
    tracker says are."""
    frames = sequence.frames
    told = []
    for k, frame in enumerate(frames):
        near = [frames[i] for i in (max(k - 1, 0), min(k + 1, len(frames) - 1))]
        told.append(replace(frame, truth=replace(frame.truth, speed=_relative_speeds(frame, near))))
    return replace(sequence, frames=told, camera_motion="unknown")


def _relative_speeds(frame: SequenceFrame, near: list[SequenceFrame]) -> FloatArray:
    """(M,) m/s along the heading, from places before and after; NaN of one that is in one frame alone."""
    truth, speeds = frame.truth, np.full(len(frame.truth.id), np.nan)
    three = (near[0], frame, near[1])
    places = [(f.time, dict(zip(f.truth.id.tolist(), f.truth.place, strict=True))) for f in three]
    for row, vehicle in enumerate(truth.id.tolist()):
        known = [(time, place[vehicle]) for time, place in places if vehicle in place]
        (start, first), (end, last) = known[0], known[-1]
        if end > start:
            along = np.array([np.sin(truth.heading[row]), np.cos(truth.heading[row])])
            speeds[row] = (last - first) @ along / (end - start)
    return speeds


def _is_found(item: dict[str, Any]) -> bool:
    left, top, right, bottom = item["bbox"]
    return bool(min(right - left, bottom - top) >= LEAST_PX) and bool(item["_occluded_share"] <= MOST_HIDDEN)


def place_of(record: dict[str, Any]) -> tuple[float, float, float]:
    """Where the camera is in the world, and its direction."""
    pose = record["_camera_from_world"]
    R = np.array(pose["R"])
    x, _, z = (-R.T @ np.array(pose["t"])).tolist()
    return x, z, math.atan2(R[2, 0], R[2, 2])


def moved(before: tuple[float, float, float], now: tuple[float, float, float]) -> tuple[float, float, float]:
    """Ego-motion between two places, as `Tracker.update` takes it."""
    dx, dz = now[0] - before[0], now[1] - before[1]
    s, c = math.sin(before[2]), math.cos(before[2])
    return dx * c - dz * s, dx * s + dz * c, math.remainder(now[2] - before[2], 2.0 * math.pi)


def truth_of(record: dict[str, Any], view: gp.View) -> Truth:
    """Of all vehicles in the picture."""
    items, ground = record["objects"], view.R_camera_from_ground
    R = np.array([item["truth"]["R"] for item in items]).reshape(-1, 3, 3)
    boxes = np.array([item["_bbox_3d"] for item in items]).reshape(-1, 2, 3)
    ahead = R[:, :, 2] @ ground
    sides = (boxes[:, 1] - boxes[:, 0])[:, [2, 1, 0]]
    return Truth(
        id=np.array([item["id"] for item in items], dtype=np.int64),
        place=(bottoms(record) @ ground)[:, [0, 2]],
        heading=np.arctan2(ahead[:, 0], ahead[:, 2]),
        size=sides,
        bbox=np.array([item["bbox"] for item in items]).reshape(-1, 4),
        speed=np.array([item["_speed"] for item in items], dtype=float),
    )
