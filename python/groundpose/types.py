"""Camera and tilt: what a caller says before the first object."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from groundpose import _core
from groundpose._checks import (
    FloatArray,
    describe,
    finite,
    float_array,
    input_error,
    integer,
    number,
    shaped,
    type_error,
)
from groundpose._value import Value
from groundpose.calibration import read_kitti_projection
from groundpose.lens import DEFAULT_LENS, LENSES, lens_name


@dataclass(frozen=True)
class Camera(Value):
    """A pinhole camera. Pixel centres are at integer coordinates, as in OpenCV.

    Args:
        fx, fy: focal lengths in pixels, positive.
        cx, cy: principal point in pixels.
        distortion: coefficients of the lens model, undone on the way in; `k1, k2, p1, p2[, k3]` of OpenCV's
            model, its 8, 12 or 14 with `lens="rational"`, the four of its fisheye with `lens="equidistant"`,
            `xi, alpha` with "double_sphere", `xi, k1, k2, p1, p2` with "omnidirectional", `omega` with
            "field_of_view". None: no lens.
        image_size: `(width, height)` in pixels; tells which box sides are cut by the image border.
        lens: the lens model, a name in `groundpose.lens.LENSES`.

    Raises:
        InputError: a number that cannot be. TypeError: not a number.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] | None = None
    image_size: tuple[int, int] | None = None
    lens: str = DEFAULT_LENS
    _handle: _core.Camera = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the numbers; the core keeps a copy."""
        values = {name: number(name, getattr(self, name)) for name in ("fx", "fy", "cx", "cy")}
        model, distortion = LENSES[lens_name("lens", self.lens)], self.distortion
        if distortion is not None:
            distortion = model.checked("distortion", distortion)
        size = None if self.image_size is None else _image_size(self.image_size)
        handle = _core.Camera(**values, distortion=distortion, image_size=size, lens=self.lens)
        self._set(**values, distortion=distortion, image_size=size, _handle=handle)

    @classmethod
    def from_K(
        cls,
        K: ArrayLike,
        distortion: Sequence[float] | None = None,
        image_size: tuple[int, int] | None = None,
        lens: str = DEFAULT_LENS,
    ) -> Camera:
        """From the 3 x 3 matrix `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`; its transpose is refused."""
        a = finite("K", shaped("K", K, (3, 3)))
        if np.any(a[2, :2] != 0.0) and not np.any(a[:2, 2] != 0.0):
            raise input_error("K", "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]", "its transpose; pass K.T")
        if a[0, 1] != 0.0 or a[1, 0] != 0.0 or np.any(a[2] != [0.0, 0.0, 1.0]):
            raise input_error("K", "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]] without skew", a.tolist())
        return cls(a[0, 0], a[1, 1], a[0, 2], a[1, 2], distortion, image_size, lens)  # type: ignore[arg-type]

    @classmethod
    def from_fov(cls, width: int, height: int, horizontal_fov: float) -> Camera:
        """Square pixels, principal point in the middle of the image; `horizontal_fov` in radians."""
        width, height = _image_size((width, height))
        if not 0.0 < number("horizontal_fov", horizontal_fov) < math.pi:
            raise input_error("horizontal_fov", "radians between 0 and pi", horizontal_fov)
        f = 0.5 * width / math.tan(0.5 * horizontal_fov)
        # The image reaches half a pixel beyond the first and the last pixel centre.
        return cls(f, f, 0.5 * (width - 1), 0.5 * (height - 1), image_size=(width, height))

    @classmethod
    def from_file(cls, path: str | PathLike[str], name: str | None = None) -> Camera:
        """The camera of a file of any format that `groundpose.formats.calibrations` knows, by its content.

        Args:
            path: the file.
            name: which camera of several: its key, name, token, channel or number in the file.

        Raises:
            OSError: no such file. InputError: naming file and key; a file of several cameras lists them.
        """
        from groundpose.formats.calibrations import read_calibration

        return read_calibration(path, name).camera

    @classmethod
    def from_kitti(
        cls, path: str | PathLike[str], name: str = "P2", image_size: tuple[int, int] | None = None
    ) -> Camera:
        """The camera of line `name` of a KITTI calibration file.

        Poses are in this camera's own frame; KITTI's labels are in that of camera 0, which stands
        beside it (`t_camera0 = t - inv(K) @ P[:, 3]`, 6 cm for P2).
        """
        return cls.from_K(read_kitti_projection(path, name)[:, :3], image_size=image_size)

    @classmethod
    def from_opencv_yaml(cls, path: str | PathLike[str]) -> Camera:
        """`from_file` under its former name, of the time when it read OpenCV's and ROS's YAML alone."""
        return cls.from_file(path)

    @property
    def K(self) -> FloatArray:
        """`[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`, (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def project(self, points_camera: ArrayLike) -> FloatArray:
        """Undistorted pixels (..., 2) of points (..., 3) of the camera frame; NaN behind the camera."""
        return _row_by_row("points_camera", points_camera, 3, self._handle.project)

    def rays(self, pixels: ArrayLike) -> FloatArray:
        """Directions (..., 3), with z = 1, of undistorted pixels (..., 2): the inverse of `project`."""
        return _row_by_row("pixels", pixels, 2, self._handle.rays)

    def image_of(self, points_camera: ArrayLike) -> FloatArray:
        """Pixels (..., 2) at which the picture shows points (..., 3) of the camera frame, through the lens.

        A wide lens shows points beside the camera and behind it, too. NaN: not shown, behind the camera or
        beyond the limit of the lens model.
        """
        return _row_by_row("points_camera", points_camera, 3, self._handle.image_of)

    def directions_of(self, pixels: ArrayLike) -> FloatArray:
        """Directions (..., 3), of length 1 in the camera frame, of what the picture shows at pixels (..., 2),
        through the lens: the inverse of `image_of`; NaN where the lens shows nothing."""
        return _row_by_row("pixels", pixels, 2, self._handle.directions_of)

    def undistort(self, pixels: ArrayLike) -> FloatArray:
        """Pixels (N, 2) as an ideal lens would show them; NaN where the distortion cannot be undone, and 90
        degrees and more from the optical axis, which `directions_of` knows."""
        return self._handle.undistort(shaped("pixels", pixels, ("N", 2)))

    def distort(self, pixels: ArrayLike) -> FloatArray:
        """Pixels (N, 2) of an ideal lens where this lens shows them: the inverse of `undistort`; NaN beyond
        the limit of a wide lens."""
        return self._handle.distort(shaped("pixels", pixels, ("N", 2)))


@dataclass(frozen=True)
class View(Value):
    """A camera and its tilt against the ground: `R_camera_from_ground = R_z(roll) @ R_x(-pitch)`.

    The ground frame has its origin in the camera, y down along the ground's normal and z along the
    camera's forward direction laid on the ground.

    Args:
        camera: the camera.
        pitch: radians, positive when the optical axis points above the horizon, which then lies
            at row `cy + fy * tan(pitch)`.
        roll: radians, rotation of the camera about its optical axis.
        height: metres of the camera above the ground, if known: used with `frame=`, where all vehicles stand
            on one road, by solver "p1p_height", and for boxes that the image cuts on one side.

    Raises:
        InputError: an angle or height that cannot be. TypeError: not a number.
    """

    camera: Camera
    pitch: float = 0.0
    roll: float = 0.0
    height: float | None = None
    _handle: _core.View = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the numbers; the core keeps a copy."""
        if not isinstance(self.camera, Camera):
            raise type_error("camera", "a Camera", self.camera)
        pitch, roll = number("pitch", self.pitch), number("roll", self.roll)
        height = None if self.height is None else number("height", self.height)
        handle = _core.View(self.camera._handle, pitch, roll, height)
        self._set(pitch=pitch, roll=roll, height=height, _handle=handle)

    @classmethod
    def from_gravity(cls, camera: Camera, gravity: ArrayLike, height: float | None = None) -> View:
        """From the direction of gravity (downwards), (3,) of any length, in the camera frame."""
        if not isinstance(camera, Camera):
            raise type_error("camera", "a Camera", camera)
        core = _core.View.from_gravity(camera._handle, shaped("gravity", gravity, (3,)))
        return cls(camera, core.pitch, core.roll, height)

    @property
    def R_camera_from_ground(self) -> FloatArray:
        """Rotation (3, 3) from the ground frame to the camera frame."""
        return self._handle.R_camera_from_ground

    @property
    def remarks(self) -> tuple[str, ...]:
        """What looks wrong in it, in words; of a nominal view nothing is known."""
        return ()

    def horizon(self) -> tuple[float, float, float]:
        """`(a, b, c)` of the horizon's line `a u + b v + c = 0` in undistorted pixels."""
        return self._handle.horizon()

    def side_planes(self, left: float, right: float) -> FloatArray:
        """Unit normals (2, 3), in the ground frame and pointing inwards, of the planes through the
        pixel columns `left` and `right`."""
        return self._handle.side_planes(number("left", left), number("right", right))

    def ground_of(self, pixels: ArrayLike) -> FloatArray:
        """Places (N, 2) on the ground, metres right and forward of the camera, of what the picture shows at
        pixels (N, 2), through the lens; NaN at the horizon and above. Raises InputError without a height."""
        if self.height is None:
            raise input_error("height", "metres of the camera above the ground", "none")
        rays = self.camera.directions_of(shaped("pixels", pixels, ("N", 2))) @ self.R_camera_from_ground
        with np.errstate(divide="ignore", invalid="ignore"):
            places = rays[:, [0, 2]] * (self.height / rays[:, 1:2])
        return np.where(rays[:, 1:2] > 0.0, places, np.nan)

    def project(self, points_camera: ArrayLike) -> FloatArray:
        """Undistorted pixels (N, 2) of points (N, 3) of the camera frame; NaN behind the camera."""
        return self.camera._handle.project(shaped("points_camera", points_camera, ("N", 3)))


def _row_by_row(
    argument: str, value: Any, width: int, function: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """A function of rows, on an array of any number of dimensions."""
    array = float_array(argument, value, f"numbers of shape (..., {width})")
    if array.shape[-1:] != (width,):
        raise input_error(argument, f"shape (..., {width})", f"shape {array.shape}")
    rows = function(array.reshape(-1, width))
    return rows.reshape(*array.shape[:-1], rows.shape[1])


def _image_size(value: object) -> tuple[int, int]:
    if not isinstance(value, (tuple, list, np.ndarray)) or len(value) != 2:
        raise type_error("image_size", "(width, height)", value)
    width, height = (integer("image_size", side) for side in value)
    if not max(width, height) < 2**31:
        raise input_error("image_size", "at most 2**31 - 1 pixels", f"{describe(width)}, {describe(height)}")
    return width, height
