"""Recordings for Foxglove and whatever reads MCAP, with the package foxglove-sdk (extra `mcap`).

Topics: `/vehicles` (foxglove.SceneUpdate: cubes with class, probability and, of tracks, speed as metadata),
`/camera/annotations` (foxglove.ImageAnnotations: 2D boxes and the edges of the 3D boxes),
`/camera/calibration` (foxglove.CameraCalibration), `/camera/image` (foxglove.CompressedImage), `/tf`
(foxglove.FrameTransform: the camera's tilt and height in the frame `ground`, z up).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray
from groundpose._writing import whole_path
from groundpose.draw.colours import BOX, POSE
from groundpose.formats.camera_files import ros_distortion
from groundpose.formats.columns import CORNERS
from groundpose.formats.conversions import BODY_FROM_OBJECT, to_body_axes, to_quaternions, turns_to_the_right
from groundpose.formats.extras import extra_package
from groundpose.formats.neighbours.context import Context
from groundpose.formats.scenes import Motion, Scene
from groundpose.formats.tracks import KMH

EDGES = tuple(
    (a, b)
    for a, b in itertools.combinations(range(len(CORNERS)), 2)
    if sum(x != y for x, y in zip(CORNERS[a].split("_"), CORNERS[b].split("_"), strict=True)) == 1
)
"""Pairs of corners that an edge of a box joins."""
_CHANNELS = {
    "/vehicles": "SceneUpdate",
    "/camera/annotations": "ImageAnnotations",
    "/camera/calibration": "CameraCalibration",
    "/camera/image": "CompressedImage",
    "/tf": "FrameTransform",
}
GROUND = "ground"
_ALPHA = 0.4
_LIFETIME = 0.5  # seconds; a vehicle that is no longer seen does not stay for ever


def write_mcap(scenes: Iterable[Scene], path: Path, context: Context) -> None:
    """Write the recording; see `groundpose.formats.neighbours.write_scenes`."""
    foxglove = extra_package("foxglove", "foxglove-sdk", "mcap")
    channels = extra_package("foxglove.channels", "foxglove-sdk", "mcap")
    messages = extra_package("foxglove.messages", "foxglove-sdk", "mcap")
    own = foxglove.Context()
    with whole_path(path) as part:
        part.open("wb").close()  # a path that cannot be is an OSError, not a message of the library
        with foxglove.open_mcap(part, context=own, allow_overwrite=True):
            topics = {
                topic: getattr(channels, f"{name}Channel")(topic, context=own)
                for topic, name in _CHANNELS.items()
            }
            for number, scene in enumerate(scenes):
                with context.frame(scene):
                    stamp = context.stamp(scene, number)
                    for topic, message in _Frame(messages, scene, stamp, context).messages().items():
                        topics[topic].log(message, log_time=stamp)


class _Frame:
    """The messages of one frame."""

    def __init__(self, messages: Any, scene: Scene, stamp: int, context: Context) -> None:
        self._m, self._scene, self._context = messages, scene, context
        self._time = messages.Timestamp(*divmod(stamp, 1_000_000_000))

    def messages(self) -> dict[str, Any]:
        found = {
            "/tf": self._tilt(),
            "/camera/calibration": self._calibration(),
            "/vehicles": self._m.SceneUpdate(entities=[self._entity(k) for k in self._scene.rows]),
            "/camera/annotations": self._annotations(),
        }
        picture = self._context.picture(self._scene)
        if picture is not None:
            data, form = picture
            found["/camera/image"] = self._m.CompressedImage(data=data, format=form, **self._head())
        return found

    def _head(self) -> dict[str, Any]:
        return {"timestamp": self._time, "frame_id": self._context.frame_id}

    def _tilt(self) -> Any:
        R, place = camera_in_ground(self._scene)
        return self._m.FrameTransform(
            timestamp=self._time,
            parent_frame_id=GROUND,
            child_frame_id=self._context.frame_id,
            translation=self._m.Vector3(**_xyz(place)),
            rotation=self._quaternion(R),
        )

    def _calibration(self) -> Any:
        camera = self._scene.view.camera
        width, height = camera.image_size or (0, 0)
        model, distortion = ros_distortion(camera)
        P = np.hstack([camera.K, np.zeros((3, 1))])
        arrays = {"D": distortion, "K": camera.K, "R": np.eye(3), "P": P}
        return self._m.CameraCalibration(
            width=width,
            height=height,
            distortion_model=FOXGLOVE_LENSES.get(model, model),
            **{name: a.ravel().tolist() for name, a in arrays.items()},
            **self._head(),
        )

    def _entity(self, k: int) -> Any:
        m, scene = self._m, self._scene
        length, height, width = scene.size[k].tolist()
        pose = m.Pose(
            position=m.Vector3(**_xyz(scene.centre[k])),
            orientation=self._quaternion(to_body_axes(scene.R[k][None])[0]),
        )
        cube = m.CubePrimitive(
            pose=pose, size=m.Vector3(x=length, y=width, z=height), color=self._colour(POSE)
        )
        said = {
            "class": scene.classes[k],
            "probability": f"{scene.probability[k]:.4f}",
            "ambiguity": f"{scene.ambiguity[k]:.4f}",
            "score": f"{scene.scores[k]:.4f}",
            "frame": str(scene.id),
            **_motion(scene.motion, k),
        }
        return m.SceneEntity(
            id=str(scene.ids[k]),
            lifetime=m.Duration(0, int(1e9 * _LIFETIME)),
            metadata=[m.KeyValuePair(key=key, value=value) for key, value in said.items() if value != "nan"],
            cubes=[cube],
            **self._head(),
        )

    def _annotations(self) -> Any:
        scene, m = self._scene, self._m
        shapes, texts = [], []
        pixels = scene.corner_pixels
        for k, box in enumerate(scene.bboxes):
            if np.isfinite(box).all():
                left, top, right, bottom = box.tolist()
                ring = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
                shapes.append(self._points(ring, "LineLoop", BOX))
                texts.append(self._text(left, top, scene.classes[k] or scene.status[k]))
            if np.isfinite(pixels[k]).all():
                shapes.append(self._points(pixels[k][list(itertools.chain(*EDGES))], "LineList", POSE))
        return m.ImageAnnotations(points=shapes, texts=texts)

    def _points(self, pixels: FloatArray, kind: str, colour: str) -> Any:
        m = self._m
        return m.PointsAnnotation(
            timestamp=self._time,
            type=getattr(m.PointsAnnotationType, kind),
            points=[m.Point2(x=x, y=y) for x, y in (pixels + 0.5).tolist()],  # its origin is a pixel's corner
            outline_color=self._colour(colour, 1.0),
            thickness=2.0,
        )

    def _text(self, x: float, y: float, text: str) -> Any:
        m = self._m
        place = m.Point2(x=x + 0.5, y=y + 0.5)
        return m.TextAnnotation(
            timestamp=self._time, position=place, text=text, font_size=12.0, text_color=self._colour(BOX, 1.0)
        )

    def _quaternion(self, R: FloatArray) -> Any:
        w, x, y, z = to_quaternions(R[None])[0].tolist()
        return self._m.Quaternion(x=x, y=y, z=z, w=w)

    def _colour(self, colour: str, alpha: float = _ALPHA) -> Any:
        r, g, b = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
        return self._m.Color(r=r, g=g, b=b, a=alpha)


FOXGLOVE_LENSES = {"equidistant": "kannala_brandt"}
"""Foxglove's names of lens models that ROS names otherwise."""


def camera_in_ground(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Rotation (3, 3) and place (3,) of the camera in a frame on the ground below it (of tracks, below where
    it was in their first frame): x forward, y left, z up; 0 metres high where the height is not known."""
    view = scene.view
    height = view.height if view.height is not None and math.isfinite(view.height) else 0.0
    right, forward, turned = np.zeros(3) if scene.motion is None else scene.motion.camera
    turn = turns_to_the_right(np.array([turned]))[0]
    return BODY_FROM_OBJECT @ turn @ view.R_camera_from_ground.T, np.array([forward, -right, height])


def _motion(motion: Motion | None, k: int) -> dict[str, str]:
    """What metadata say of the motion of object `k`."""
    if motion is None:
        return {}
    return {
        "speed_kmh": f"{KMH * motion.speed[k]:.2f}",
        "speed_sigma_kmh": f"{KMH * motion.speed_sigma[k]:.2f}",
        "yaw_rate_deg": f"{math.degrees(motion.yaw_rate[k]):.2f}",
        "standing": str(bool(motion.standing[k])).lower(),
        "seen": str(bool(motion.seen[k])).lower(),
    }


def _xyz(point: FloatArray) -> dict[str, float]:
    return dict(zip("xyz", point.tolist(), strict=True))
