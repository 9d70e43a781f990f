"""The data of one frame of the drive, used by labels and renderer.

World frame: x right, y down, z forward at the start of the drive. Camera and object frames are those of the
rest of groundpose. Metres, radians.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.drive.rigs import Mount
from groundpose.lab.drive.road import Road
from groundpose.types import Camera, View


@dataclass(frozen=True, eq=False)
class Light:
    """Light of a drive.

    Args:
        class_name: "sun", "overcast", "dusk", "glare", "shade" and so on.
        sun_direction: (3,) world, unit length, pointing to the sun.
        sun_strength: 0 without a sun.
        sky: index of the environment.
        exposure: factor of the camera.
        seed: of everything else that the renderer draws at random.
    """

    kind: str
    sun_direction: FloatArray
    sun_strength: float
    sky: int
    exposure: float
    seed: int


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A vehicle and its pose, `X_world = R_world @ X_object + t_world`.

    Its body is `groundpose.lab.bodies.body(class_name, seed)`. `look_seed` decides paint, dirt and plate;
    `state` is "moving", "parked", "turning" or "crossing"; `steering` is the angle of the front wheels,
    radians, positive to the right.
    """

    class_name: str
    seed: int
    R_world: FloatArray
    t_world: FloatArray
    look_seed: int
    lamps_on: bool
    braking: bool
    state: str
    steering: float = 0.0


@dataclass(frozen=True, eq=False)
class Prop:
    """A thing beside the road.

    Its local frame is x right, y down, z forward with the origin at the middle of its foot; `yaw` turns it
    about the world's y axis as that of a vehicle; it fills width x height x length = `size` upwards from
    `position`.
    """

    kind: str
    seed: int
    position: FloatArray
    yaw: float
    size: FloatArray


@dataclass(frozen=True, eq=False)
class Scene:
    """One frame.

    `pitch` and `roll` are the true tilt of the camera against the plane of the road under it, `height` its
    metres above that plane; `mount` has the nominal tilt;
    `X_camera = R_camera_from_world @ X_world + t_camera_from_world`. `film`: of a video, whose camera has the
    same exposure, colours and lens in all frames.
    """

    camera: Camera
    mount: Mount
    R_camera_from_world: FloatArray
    t_camera_from_world: FloatArray
    pitch: float
    roll: float
    height: float
    speed: float
    road: Road
    vehicles: tuple[Vehicle, ...]
    props: tuple[Prop, ...]
    light: Light
    split: str
    seed: int
    number: int
    film: bool = False

    @property
    def view(self) -> View:
        """The camera with its true tilt and height against the road under it."""
        return View(self.camera, self.pitch, self.roll, self.height)

    @property
    def camera_position(self) -> FloatArray:
        """(3,) world."""
        return np.asarray(-self.R_camera_from_world.T @ self.t_camera_from_world)

    def camera_from_object(self, vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
        """Pose `(R, t)` of a vehicle in the camera."""
        R = self.R_camera_from_world
        return R @ vehicle.R_world, R @ vehicle.t_world + self.t_camera_from_world
