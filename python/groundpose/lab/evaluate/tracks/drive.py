"""Videos of the virtual drive (`groundpose simulate --video`): exact truth, keypoints of the network on the
pictures."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import groundpose as gp
from groundpose._checks import FloatArray, input_error
from groundpose.keypoints.image import as_rgb
from groundpose.lab.evaluate.simulated.box_noise import draw_boxes
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
        tilt: "nominal", or "true": as after a calibration.
        frame: what is known of each frame; None: every vehicle alone.
        seed: of the detector's boxes.
    """

    folder: Path
    pipeline: gp.Pipeline
    tilt: str = "true"
    frame: gp.FramePriors | None = None
    seed: int = 0

    def sequence(self, limit: int | None = None, advance: Callable[[int], None] | None = None) -> Sequence:
        """Its frames. Raises OSError, InputError for a folder that is none."""
        lines = (self.folder / "labels.jsonl").read_text(encoding="utf-8").splitlines()[:limit]
        records = [json.loads(line) for line in lines]
        if not records or "_time" not in records[0]:
            raise input_error(str(self.folder), "a video of groundpose simulate --video", "another folder")
        standing = records[0]["_odometry"]["standing"]
        view = self._view(records[0])
        found = Sequence(self.folder.name, view, [], "static" if standing else "odometry")
        for k, record in enumerate(records):
            found.frames.append(self._frame(record))
            if advance is not None:
                advance(k + 1)
        return found

    def _view(self, record: dict[str, Any]) -> gp.View:
        told = record["_tilt"] if self.tilt == "true" else record
        c = record["camera"]
        camera = gp.Camera(c["fx"], c["fy"], c["cx"], c["cy"], image_size=tuple(c["image_size"]))
        height = None if self.frame is None else record["_tilt"]["camera_height"]
        return gp.View(camera, math.radians(told["pitch_deg"]), math.radians(told["roll_deg"]), height)

    def _frame(self, record: dict[str, Any]) -> SequenceFrame:
        view = self._view(record)
        items = [item for item in record["objects"] if _is_found(item)]
        exact = np.array([item["bbox"] for item in items]).reshape(-1, 4)
        levels = np.array([item["_occlusion"] for item in items], dtype=np.int64)
        size = (record["camera"]["image_size"][0], record["camera"]["image_size"][1])
        boxes = draw_boxes(exact, levels, size, self.seed + record["id"]) if items else exact
        image = as_rgb(self.folder / record["image"])
        poses = self.pipeline(image, boxes, view, frame=self.frame)
        return SequenceFrame(
            time=record["_time"],
            poses=poses,
            scores=np.ones(len(items)),
            vehicle=np.array([item["id"] for item in items], dtype=np.int64),
            truth=truth_of(record, poses.view),
            ego=place_of(record),
        )


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
    middle: FloatArray = boxes.mean(axis=1)
    middle[:, 1] = boxes[:, 1, 1]
    t = (R @ middle[..., None])[..., 0] + np.array([item["truth"]["t"] for item in items]).reshape(-1, 3)
    ahead = R[:, :, 2] @ ground
    sides = (boxes[:, 1] - boxes[:, 0])[:, [2, 1, 0]]
    return Truth(
        id=np.array([item["id"] for item in items], dtype=np.int64),
        place=(t @ ground)[:, [0, 2]],
        heading=np.arctan2(ahead[:, 0], ahead[:, 2]),
        size=sides,
        bbox=np.array([item["bbox"] for item in items]).reshape(-1, 4),
        speed=np.array([item["_speed"] for item in items], dtype=float),
    )
