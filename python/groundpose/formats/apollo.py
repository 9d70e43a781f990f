"""ApolloCar3D as it unpacks: `car_poses/NAME.json`, `keypoints/NAME/NAME_K.txt`, `images/NAME.jpg`,
`split/*.txt`.

A pose is `roll, pitch, yaw, x, y, z` of a car model (x left, y up, z forward) with `R = Rz(yaw) Ry(pitch)
Rx(roll)` in radians and metres; a line of keypoints is `number, u, v`. The set does not say which keypoints
belong to which pose: each file goes to the pose that projects its model nearest to it. Intrinsics are those
of the set's own tools.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from groundpose._checks import FloatArray, input_error, read_text
from groundpose._core import InputError
from groundpose.formats.fields import Field, parse
from groundpose.formats.kitti.dataset import read_split
from groundpose.formats.skips import Skips
from groundpose.types import Camera

IMAGE_SIZE = (3384, 2710)
KEYPOINTS = 66
OURS_FROM_APOLLO = np.diag([-1.0, -1.0, 1.0])
CAMERAS = {
    "Camera_5": Camera(
        2304.54786556982, 2305.875668062, 1686.23787612802, 1354.98486439791, None, IMAGE_SIZE
    ),
    "Camera_6": Camera(
        2300.39065314361, 2301.31478860597, 1713.21615190657, 1342.91100799715, None, IMAGE_SIZE
    ),
}
"""By the end of an image's name."""
_FARTHEST = 0.15
"""Keypoints whose median distance from a projected model is larger, as a fraction of their extent, are not
its."""
_MARGIN = 0.1
"""Boxes are the extent of the labelled keypoints and so much of it on every side."""


@dataclass(frozen=True)
class ApolloCar:
    """One labelled car."""

    car_id: int
    R: FloatArray
    """Our object frame (x right, y down, z forward) to the camera's."""
    t: FloatArray
    keypoints_2d: FloatArray
    """(66, 2) px, NaN = not labelled."""

    @property
    def bbox(self) -> tuple[float, float, float, float]:
        """Around the labelled keypoints, inside the image."""
        low, high = np.nanmin(self.keypoints_2d, axis=0), np.nanmax(self.keypoints_2d, axis=0)
        limit = np.array(IMAGE_SIZE) - 1.0
        grown = np.clip([low - _MARGIN * (high - low), high + _MARGIN * (high - low)], 0.0, limit)
        left, top, right, bottom = grown.ravel().tolist()
        return left, top, right, bottom


@dataclass(frozen=True)
class ApolloImage:
    """An image with those of its cars that have labelled keypoints."""

    id: str
    camera: Camera
    image: Path | None
    cars: list[ApolloCar]


@dataclass(frozen=True)
class ApolloSet:
    """A folder; `models` (79, 66, 3) metres, our object frame: the keypoints of its car models by
    `car_id`."""

    root: Path
    models: FloatArray

    def __post_init__(self) -> None:
        """Raises InputError for another folder or other models."""
        for name in ("car_poses", "keypoints"):
            if not (self.root / name).is_dir():
                raise input_error(str(self.root), "a folder with car_poses and keypoints", f"none of {name}")
        if self.models.ndim != 3 or self.models.shape[1:] != (KEYPOINTS, 3):
            raise input_error("models", f"shape (N, {KEYPOINTS}, 3)", self.models.shape)

    @cached_property
    def _all(self) -> list[str]:
        return sorted(path.stem for path in (self.root / "car_poses").glob("*.json"))

    def ids(self, split: Path | None = None, skipped: Skips | None = None) -> list[str]:
        """Names of the images: those of a split file (with or without their ending), or all."""
        if split is None:
            return self._all
        return [Path(name).stem for name in read_split(split, Skips() if skipped is None else skipped)]

    def read(self, name: str, skipped: Skips) -> ApolloImage | None:
        """One image; None when it cannot be used. What is left out goes to `skipped`."""
        camera = next((camera for end, camera in CAMERAS.items() if name.endswith(end)), None)
        if camera is None:
            skipped.add("image of an unknown camera", name)
            return None
        path = self.root / "car_poses" / f"{name}.json"
        try:
            poses = [_pose(field, len(self.models)) for field in parse(read_text(path), str(path)).items()]
        except OSError as error:
            skipped.add("image without readable poses", f"{path}: {error}")
            return None
        except InputError as error:
            skipped.add("image with bad poses", str(error))
            return None
        cars = self._cars(name, poses, camera, skipped)
        image = self.root / "images" / f"{name}.jpg"
        return ApolloImage(name, camera, image if image.exists() else None, cars)

    def _cars(
        self, name: str, poses: list[tuple[int, FloatArray, FloatArray]], camera: Camera, skipped: Skips
    ) -> list[ApolloCar]:
        """Each file of keypoints with the free pose that fits it best."""
        projected = [camera.project(self.models[k] @ R.T + t) for k, R, t in poses]
        free, cars = set(range(len(poses))), []
        for path in sorted((self.root / "keypoints" / name).glob(f"{name}_*.txt")):
            try:
                keypoints = read_keypoints(path)
            except (OSError, InputError) as error:
                skipped.add("bad file of keypoints", str(error))
                continue
            extent = float(np.nanmax(np.nanmax(keypoints, axis=0) - np.nanmin(keypoints, axis=0)))
            away = {k: float(np.nanmedian(np.linalg.norm(projected[k] - keypoints, axis=1))) for k in free}
            best = min(away, key=lambda k: away[k], default=None)
            if best is None or not away[best] <= _FARTHEST * extent:
                skipped.add("keypoints that fit no pose", str(path))
                continue
            free.remove(best)
            cars.append(ApolloCar(*poses[best], keypoints))
        return cars


def read_keypoints(path: Path) -> FloatArray:
    """(66, 2) px, NaN = not labelled. Raises OSError, InputError naming the line; a file without any is
    one."""
    points = np.full((KEYPOINTS, 2), np.nan)
    for number, line in enumerate(read_text(path).splitlines(), 1):
        if not line.strip():
            continue
        try:
            index, u, v = (float(x) for x in line.split())
        except ValueError:
            raise input_error(f"{path}:{number}", "number, u, v", repr(line)) from None
        if not (index.is_integer() and 0 <= index < KEYPOINTS and math.isfinite(u + v)):
            raise input_error(f"{path}:{number}", f"a keypoint from 0 to {KEYPOINTS - 1}", repr(line))
        points[int(index)] = u, v
    if np.isnan(points).all():
        raise input_error(str(path), "keypoints", "none")
    return points


def _pose(field: Field, models: int) -> tuple[int, FloatArray, FloatArray]:
    number = field.need("car_id")
    car_id = number.number()
    if not (car_id.is_integer() and 0 <= car_id < models):
        number.fail(f"a model from 0 to {models - 1}")
    roll, pitch, yaw, x, y, z = field.need("pose").numbers(6)
    return int(car_id), rotation(roll, pitch, yaw) @ OURS_FROM_APOLLO.T, np.array([x, y, z])


def rotation(roll: float, pitch: float, yaw: float) -> FloatArray:
    """`Rz(yaw) Ry(pitch) Rx(roll)`, (3, 3)."""
    (cx, sx), (cy, sy), (cz, sz) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)
