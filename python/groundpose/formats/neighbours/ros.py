"""ROS 2 bags, without ROS, with the package rosbags (extra `ros`).

Topics: `/detections` (vision_msgs/Detection3DArray), `/objects` (autoware_perception_msgs/DetectedObjects),
`/camera/camera_info` (sensor_msgs/CameraInfo), `/camera/image/compressed` (sensor_msgs/CompressedImage),
`/tf` (tf2_msgs/TFMessage: the camera's tilt and height in the frame `ground`) and, of tracks, `/tracks`
(autoware_perception_msgs/TrackedObjects). Poses are of the middles of the 3D boxes, x forward, y left, z up,
in the camera's frame, whose axes are those of ROS's optical frames.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, input_error
from groundpose._writing import naming
from groundpose.formats.camera_files import ros_distortion
from groundpose.formats.conversions import to_body_axes, to_quaternions, to_ros_covariance
from groundpose.formats.extras import extra_package
from groundpose.formats.neighbours.context import Context, score
from groundpose.formats.neighbours.mcap import GROUND, camera_in_ground
from groundpose.formats.neighbours.ros_types import DEFINITIONS
from groundpose.formats.scenes import Scene

_TOPICS = {
    "/detections": "vision_msgs/msg/Detection3DArray",
    "/objects": "autoware_perception_msgs/msg/DetectedObjects",
    "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    "/camera/image/compressed": "sensor_msgs/msg/CompressedImage",
    "/tf": "tf2_msgs/msg/TFMessage",
}
_TRACKS = {"/tracks": "autoware_perception_msgs/msg/TrackedObjects"}
"""Of tracks alone."""
_LABELS = {"car": 1, "van_bus": 1, "bus": 3, "pickup": 2, "box_truck": 2, "vehicle": 0}
"""Autoware's labels: vans are cars there, pickups trucks, as in nuScenes."""
SIGN_UNKNOWN_FROM = 0.2
"""Ambiguity from which an orientation may point to the other end of the vehicle."""
UNAVAILABLE_FROM = np.radians(30.0)
"""Standard deviation of the yaw, radians, from which there is no orientation to speak of."""
UNAVAILABLE, SIGN_UNKNOWN, AVAILABLE = 0, 1, 2
_BAG_VERSION = 9


def write_ros(scenes: Iterable[Scene], path: Path, context: Context) -> None:
    """Write the bag, a folder; see `groundpose.formats.neighbours.write_scenes`."""
    rosbag2 = extra_package("rosbags.rosbag2", "rosbags", "ros")
    store = type_store()
    if path.exists():
        raise input_error(str(path), "a folder that is not there yet, for the bag", "one that is there")
    part = path.with_name(f".{path.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    try:
        with naming(path, part):
            with rosbag2.Writer(part, version=_BAG_VERSION) as bag:
                topics = {t: bag.add_connection(t, kind, typestore=store) for t, kind in _TOPICS.items()}
                for number, scene in enumerate(scenes):
                    if scene.motion is not None and not _TRACKS.keys() <= topics.keys():
                        topics |= {t: bag.add_connection(t, k, typestore=store) for t, k in _TRACKS.items()}
                    with context.frame(scene):
                        stamp = context.stamp(scene, number)
                        for topic, message in _Frame(store, scene, stamp, context).messages().items():
                            kind = topics[topic].msgtype
                            bag.write(topics[topic], stamp, store.serialize_cdr(message, kind))
            _rename_parts(part, path)
            part.rename(path)
    finally:
        with suppress(OSError):
            shutil.rmtree(part)


def _rename_parts(part: Path, path: Path) -> None:
    """The bag's files are called by its folder, and its record names them."""
    for file in part.iterdir():
        if file.name.startswith(part.name):
            file.rename(part / f"{path.name}{file.name.removeprefix(part.name)}")
    record = part / "metadata.yaml"
    record.write_text(record.read_text("utf-8").replace(part.name, path.name), "utf-8")


def type_store() -> Any:
    """ROS 2's messages, and those of `DEFINITIONS`. Raises InputError without the package rosbags."""
    typesys: ModuleType = extra_package("rosbags.typesys", "rosbags", "ros")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        store.register(typesys.get_types_from_msg(text, name))
    return store


def orientation_availability(scene: Scene, k: int) -> int:
    """Autoware's word for how well the orientation of object `k` is known."""
    normal = scene.view.R_camera_from_ground[:, 1]
    variance = float(normal @ scene.covariance[k, :3, :3] @ normal)
    if not variance < UNAVAILABLE_FROM**2:
        return UNAVAILABLE
    return SIGN_UNKNOWN if scene.ambiguity[k] >= SIGN_UNKNOWN_FROM else AVAILABLE


def object_twist(scene: Scene, k: int) -> tuple[FloatArray, FloatArray]:
    """Velocity and rates of turning (6,) of object `k`, m/s and rad/s in its own axes x forward, y left and
    z up, and their covariance (6, 6); NaN where they are not known."""
    motion = scene.motion
    if motion is None:
        return np.full(6, np.nan), np.full((6, 6), np.nan)
    twist, covariance = np.zeros(6), np.zeros((6, 6))
    twist[0], twist[5] = motion.speed[k], -motion.yaw_rate[k]  # z is up: positive to the left
    covariance[0, 0], covariance[5, 5] = motion.speed_sigma[k] ** 2, motion.yaw_rate_sigma[k] ** 2
    return twist, covariance


def uuid_of(number: str | int) -> NDArray[np.uint8]:
    """(16,) bytes, the same for a vehicle in all frames: its number, or a hash of its name."""
    if isinstance(number, int) and number >= 0:
        return np.frombuffer(number.to_bytes(16, "big"), np.uint8)
    return np.frombuffer(hashlib.sha256(str(number).encode()).digest()[:16], np.uint8)


class _Frame:
    """The messages of one frame."""

    def __init__(self, store: Any, scene: Scene, stamp: int, context: Context) -> None:
        self._store, self._scene, self._context = store, scene, context
        self._stamp = self._make("builtin_interfaces/Time", *divmod(stamp, 1_000_000_000))
        self._covariance = to_ros_covariance(scene.centre_covariance)
        self._turns = to_quaternions(to_body_axes(scene.R))

    def _make(self, kind: str, *values: Any) -> Any:
        return self._store.types[kind.replace("/", "/msg/")](*values)

    def messages(self) -> dict[str, Any]:
        rows = self._scene.rows
        self._kinds = {k: self._kind(k) for k in rows}
        detections = [self._detection(k) for k in rows]
        objects = [self._object(k) for k in rows]
        found = {
            "/tf": self._make("tf2_msgs/TFMessage", [self._tilt()]),
            "/camera/camera_info": self._camera_info(),
            "/detections": self._make("vision_msgs/Detection3DArray", self._header(), detections),
            "/objects": self._make("autoware_perception_msgs/DetectedObjects", self._header(), objects),
        }
        if self._scene.motion is not None:
            tracks = [self._track(k) for k in rows]
            found["/tracks"] = self._make("autoware_perception_msgs/TrackedObjects", self._header(), tracks)
        picture = self._context.picture(self._scene)
        if picture is not None:
            data, form = picture
            made = self._make(
                "sensor_msgs/CompressedImage", self._header(), form, np.frombuffer(data, np.uint8)
            )
            found["/camera/image/compressed"] = made
        return found

    def _header(self, frame: str | None = None) -> Any:
        return self._make("std_msgs/Header", self._stamp, frame or self._context.frame_id)

    def _tilt(self) -> Any:
        R, place = camera_in_ground(self._scene)
        turn = self._quaternion(to_quaternions(R[None])[0])
        transform = self._make("geometry_msgs/Transform", self._vector(place), turn)
        head = self._header(GROUND)
        return self._make("geometry_msgs/TransformStamped", head, self._context.frame_id, transform)

    def _camera_info(self) -> Any:
        camera = self._scene.view.camera
        width, height = camera.image_size or (0, 0)
        model, distortion = ros_distortion(camera)
        P = np.hstack([camera.K, np.zeros((3, 1))])
        region = self._make("sensor_msgs/RegionOfInterest", 0, 0, 0, 0, False)
        arrays = (distortion, camera.K.ravel(), np.eye(3).ravel(), P.ravel())
        return self._make(
            "sensor_msgs/CameraInfo", self._header(), height, width, model, *arrays, 0, 0, region
        )

    def _detection(self, k: int) -> Any:
        scene = self._scene
        hypothesis = self._make("vision_msgs/ObjectHypothesis", scene.classes[k], score(scene, k))
        result = self._make("vision_msgs/ObjectHypothesisWithPose", hypothesis, self._pose_with_covariance(k))
        box = self._make("vision_msgs/BoundingBox3D", self._pose(k), self._size(k))
        return self._make("vision_msgs/Detection3D", self._header(), [result], box, str(scene.ids[k]))

    def _object(self, k: int) -> Any:
        twist, covariance = object_twist(self._scene, k)
        state = self._make(
            "autoware_perception_msgs/DetectedObjectKinematics",
            *(self._pose_with_covariance(k), bool(np.isfinite(self._covariance[k]).all())),
            *(orientation_availability(self._scene, k), self._twist(k)),
            *(bool(np.isfinite(twist).all()), bool(np.isfinite(covariance).all())),
        )
        what = (score(self._scene, k), [self._kinds[k]])
        return self._make("autoware_perception_msgs/DetectedObject", *what, state, self._shape(k))

    def _track(self, k: int) -> Any:
        motion = self._scene.motion
        assert motion is not None
        ahead = self._vector(np.array([np.nan_to_num(motion.acceleration[k]), 0.0, 0.0]))
        spread = np.zeros(36)
        spread[0] = np.nan_to_num(motion.acceleration_sigma[k] ** 2)
        accel = self._make("geometry_msgs/Accel", ahead, self._vector(np.zeros(3)))
        state = self._make(
            "autoware_perception_msgs/TrackedObjectKinematics",
            *(self._pose_with_covariance(k), self._twist(k)),
            self._make("geometry_msgs/AccelWithCovariance", accel, spread),
            *(orientation_availability(self._scene, k), bool(motion.standing[k])),
        )
        number = self._make("unique_identifier_msgs/UUID", uuid_of(self._scene.ids[k]))
        return self._make(
            "autoware_perception_msgs/TrackedObject",
            *(number, score(self._scene, k), [self._kinds[k]], state, self._shape(k)),
        )

    def _kind(self, k: int) -> Any:
        label = _LABELS.get(self._context.category(self._scene, k, _WORDS) or "", 0)
        return self._make("autoware_perception_msgs/ObjectClassification", label, score(self._scene, k))

    def _shape(self, k: int) -> Any:
        polygon = self._make("geometry_msgs/Polygon", [])
        return self._make("autoware_perception_msgs/Shape", 0, polygon, self._size(k))

    def _twist(self, k: int) -> Any:
        """In the object's own axes, as Autoware has it; 0 where it is not known."""
        twist, covariance = (np.nan_to_num(values) for values in object_twist(self._scene, k))
        both = self._make("geometry_msgs/Twist", self._vector(twist[:3]), self._vector(twist[3:]))
        return self._make("geometry_msgs/TwistWithCovariance", both, covariance.ravel())

    def _pose(self, k: int) -> Any:
        x, y, z = self._scene.centre[k].tolist()
        point = self._make("geometry_msgs/Point", x, y, z)
        return self._make("geometry_msgs/Pose", point, self._quaternion(self._turns[k]))

    def _pose_with_covariance(self, k: int) -> Any:
        return self._make("geometry_msgs/PoseWithCovariance", self._pose(k), self._covariance[k].ravel())

    def _size(self, k: int) -> Any:
        length, height, width = self._scene.size[k].tolist()
        return self._make("geometry_msgs/Vector3", length, width, height)

    def _vector(self, place: FloatArray) -> Any:
        return self._make("geometry_msgs/Vector3", *place.tolist())

    def _quaternion(self, turn: FloatArray) -> Any:
        w, x, y, z = turn.tolist()
        return self._make("geometry_msgs/Quaternion", x, y, z, w)


_WORDS = {name: name for name in _LABELS}
