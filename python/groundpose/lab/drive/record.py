"""One simulated frame as text: a JSON line for `groundpose estimate`, KITTI labels, rows of tables."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.frames import BUNDLED
from groundpose.formats.kitti.labels import TYPE_OF, KittiLabel
from groundpose.lab.drive.labels import OUTSIDE, VISIBLE, Label
from groundpose.lab.drive.rigs import Mount
from groundpose.lab.drive.scene import Scene

if TYPE_CHECKING:
    from groundpose.lab.drive.video.clip import VideoFrame

TILT_COLUMNS = (
    *("frame", "drive", "pitch_deg", "roll_deg", "camera_height", "speed", "road"),
    *("R_world_00", "R_world_01", "R_world_02", "R_world_10", "R_world_11", "R_world_12"),
    *("R_world_20", "R_world_21", "R_world_22", "x", "y", "z"),
)
"""Columns of tilt.csv: tilt against the road under the camera, and the camera's pose, camera_from_world."""


def frame_line(
    scene: Scene, labels: Sequence[Label], drive: int, image: str | None, video: VideoFrame | None = None
) -> str:
    """The JSON line of a frame, see `formats.frames`; that of a video has tracks and motion too.

    The nominal tilt is that of the mount, zero for the rig "car"; the true tilt is in `_tilt`. The reader of
    frames skips members that begin with `_`; docs/simulation.md lists them.
    """
    camera = scene.camera
    record: dict[str, Any] = {
        "id": scene.number,
        "camera": {name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy", "image_size")},
        **_nominal_tilt(scene.mount),
        **({} if image is None else {"image": image}),
        "models": {
            class_name: BUNDLED + class_name
            for class_name in dict.fromkeys(label.class_name for label in labels)
        },
        "objects": [_object(label) | _motion(label, video) for label in labels],
        **_odometry(video),
        "_drive": drive,
        "_seed": scene.seed,
        "_split": scene.split,
        "_road": scene.road.layout.kind,
        "_light": scene.light.kind,
        "_speed": round(scene.speed, 3),
        "_tilt": {
            "pitch_deg": _degrees(scene.pitch),
            "roll_deg": _degrees(scene.roll),
            "camera_height": round(scene.height, 4),
        },
        "_camera_from_world": {
            "R": _rounded(scene.R_camera_from_world, 9),
            "t": _rounded(scene.t_camera_from_world, 6),
        },
    }
    return json.dumps(record, allow_nan=False) + "\n"


def _nominal_tilt(mount: Mount) -> dict[str, float]:
    if not mount.tilted:
        return {}
    return {"pitch_deg": _degrees(mount.pitch), "roll_deg": _degrees(mount.roll)}


def _degrees(angle: float) -> float:
    return round(math.degrees(angle), 6)


def _object(label: Label) -> dict[str, Any]:
    states = label.keypoint_states.tolist()
    pixels = _rounded(label.keypoints_2d, 3)
    return {
        "id": label.index,
        "model": label.class_name,
        "keypoints_2d": [None if state == OUTSIDE else p for p, state in zip(pixels, states, strict=True)],
        "keypoint_scores": [float(state == VISIBLE) for state in states],
        "bbox": _rounded(label.bbox, 3),
        "truth": {"R": _rounded(label.R, 9), "t": _rounded(label.t, 6)},
        "_keypoint_states": states,
        "_keypoints_3d": _rounded(label.keypoints_3d, 5),
        "_bbox_3d": _rounded(label.bbox_3d, 5),
        "_bbox_full": _rounded(label.bbox_full, 3),
        "_truncation": round(label.truncation, 4),
        "_occlusion": label.occlusion,
        "_occluded_share": round(label.occluded_share, 4),
        "_body": {"kind": label.class_name, "style": label.style, "seed": label.seed},
        "_state": label.state,
        "_plane_pitch_deg": _degrees(label.plane_pitch),
        "_plane_roll_deg": _degrees(label.plane_roll),
    }


def _motion(label: Label, video: VideoFrame | None) -> dict[str, Any]:
    """Track and motion of a vehicle of a video."""
    if video is None:
        return {}
    row, vehicle = label.index, video.scene.vehicles[label.index]
    return {
        "id": int(video.track[row]),
        "_size": [round(side, 4) for side in label.size],
        "_place": _rounded(vehicle.t_world, 4),
        "_heading": round(math.remainder(float(video.heading[row]), 2.0 * math.pi), 6),
        "_speed": round(float(video.speed[row]), 4),
        "_acceleration": round(float(video.acceleration[row]), 4),
        "_yaw_rate": round(float(video.yaw_rate[row]), 6),
    }


def _odometry(video: VideoFrame | None) -> dict[str, Any]:
    """Time and motion of the camera of a video."""
    if video is None:
        return {}
    return {
        "_time": round(video.time, 6),
        "_odometry": {
            "speed": round(video.scene.speed, 4),
            "acceleration": round(video.ego_acceleration, 4),
            "yaw_rate": round(video.ego_yaw_rate, 6),
            "standing": video.scene.mount.standing,
        },
    }


ODOMETRY_COLUMNS = ("frame", "time", "speed", "acceleration", "yaw_rate", "x", "z", "heading")
"""Columns of odometry.csv: motion of the camera, its place and direction in the world seen from above."""


def odometry_row(frame: dict[str, Any]) -> str:
    """A line of odometry.csv from a frame's record."""
    motion, pose = frame["_odometry"], frame["_camera_from_world"]
    R = np.array(pose["R"])
    x, _, z = (-R.T @ pose["t"]).round(4).tolist()
    heading = round(math.atan2(R[2, 0], R[2, 2]), 6)
    numbers = (motion["speed"], motion["acceleration"], motion["yaw_rate"], x, z, heading)
    return ",".join(str(value) for value in (frame["id"], frame["_time"], *numbers)) + "\n"


def tracking_lines(frame: dict[str, Any], labels: str) -> str:
    """Lines of a KITTI tracking file from a frame's record and its KITTI labels."""
    rows = zip(frame["objects"], labels.splitlines(), strict=True)
    return "".join(f"{frame['id']} {item['id']} {line}\n" for item, line in rows)


def _rounded(array: FloatArray, digits: int) -> Any:
    return array.round(digits).tolist()


def kitti_label(label: Label) -> KittiLabel:
    """The label in KITTI's format."""
    length, height, width = label.size
    left, top, right, bottom = label.bbox.tolist()
    x, y, z = label.location.tolist()
    return KittiLabel(
        type=TYPE_OF[label.class_name],
        truncated=label.truncation,
        occluded=label.occlusion,
        alpha=label.alpha,
        bbox=(left, top, right, bottom),
        height=height,
        width=width,
        length=length,
        location=(x, y, z),
        rotation_y=label.rotation_y,
    )


def tilt_row(frame: dict[str, Any]) -> str:
    """A line of tilt.csv from a frame's record."""
    tilt, pose = frame["_tilt"], frame["_camera_from_world"]
    angles = (tilt["pitch_deg"], tilt["roll_deg"], tilt["camera_height"])
    rotation = [x for row in pose["R"] for x in row]
    values = (frame["id"], frame["_drive"], *angles, frame["_speed"], frame["_road"], *rotation, *pose["t"])
    return ",".join(str(value) for value in values) + "\n"
