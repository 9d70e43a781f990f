"""The compiled core. Private: `groundpose` is the public face."""

from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "CROP_FILL",
    "EVIDENCE",
    "LENSES",
    "SOLVERS",
    "STATUS",
    "STOP_REASONS",
    "VIEWING_ANGLES",
    "Answers",
    "Camera",
    "Estimator",
    "InputError",
    "Model",
    "Models",
    "Options",
    "Tracker",
    "View",
    "build_info",
    "camera_state",
    "check_frame_priors",
    "cut_crops",
    "default_frame_priors",
    "default_options",
    "default_track_options",
    "region_radius2",
    "solve_frame",
    "solve_p1p",
    "solve_p1p_height",
    "solve_p3p",
    "solve_up2p",
    "synthetic_scenes",
]

_Floats = NDArray[np.float64]
_Bytes = NDArray[np.uint8]

STATUS: list[str]
STOP_REASONS: list[str]
SOLVERS: list[str]
EVIDENCE: int
VIEWING_ANGLES: int
LENSES: list[str]
CROP_FILL: tuple[int, int, int]

class InputError(ValueError):
    """A mistake in an argument. The message says which one, what was expected and what was given."""

@final
class Camera:
    def __new__(
        cls,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        distortion: tuple[float, ...] | None = None,
        image_size: tuple[float, float] | None = None,
        lens: str = ...,
    ) -> Camera: ...
    @property
    def fx(self) -> float: ...
    @property
    def fy(self) -> float: ...
    @property
    def cx(self) -> float: ...
    @property
    def cy(self) -> float: ...
    @property
    def distortion(self) -> list[float] | None: ...
    @property
    def image_size(self) -> list[float] | None: ...
    def project(self, points_camera: _Floats) -> _Floats: ...
    def rays(self, pixels: _Floats) -> _Floats: ...
    def image_of(self, points_camera: _Floats) -> _Floats: ...
    def directions_of(self, pixels: _Floats) -> _Floats: ...
    def undistort(self, pixels: _Floats) -> _Floats: ...
    def distort(self, pixels: _Floats) -> _Floats: ...

@final
class View:
    def __new__(
        cls, camera: Camera, pitch: float = 0.0, roll: float = 0.0, height: float | None = None
    ) -> View: ...
    @staticmethod
    def from_gravity(camera: Camera, gravity: _Floats, height: float | None = None) -> View: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def pitch(self) -> float: ...
    @property
    def roll(self) -> float: ...
    @property
    def height(self) -> float | None: ...
    @property
    def R_camera_from_ground(self) -> _Floats: ...
    def horizon(self) -> tuple[float, float, float]: ...
    def side_planes(self, left: float, right: float) -> _Floats: ...

@final
class Model:
    def __new__(
        cls,
        keypoints_3d: _Floats,
        bbox_3d: _Floats,
        basis: _Floats | None = None,
        eigenvalues: _Floats | None = None,
        footprint: _Floats | None = None,
        bbox_basis: _Floats | None = None,
    ) -> Model: ...
    @property
    def footprint(self) -> _Floats: ...

@final
class Options:
    def __new__(cls, **fields: Any) -> Options: ...

def default_options() -> dict[str, Any]: ...

@final
class Models:
    @staticmethod
    def of(models: Any) -> Models | None: ...

@final
class Answers:
    names: list[str]
    def __len__(self) -> int: ...
    @property
    def modes(self) -> int: ...
    @property
    def tilt(self) -> tuple[float, float, _Floats] | None: ...
    @property
    def model_indices(self) -> list[int] | None: ...
    def array(self, name: str) -> NDArray[Any] | None: ...
    def fill(self, fields: dict[str, Any]) -> None: ...

@final
class Estimator:
    def __new__(
        cls,
        view: View,
        models: Models | None,
        options: Options,
        inlier_thresholds: _Floats | None = None,
        threads: int = 0,
        frame_tilt_sigma: float | None = None,
    ) -> Estimator: ...
    def estimate(
        self,
        keypoints_2d: object,
        bboxes: object = None,
        keypoint_scores: object = None,
        model_indices: object = None,
        vehicle_probability: object = None,
        viewing_angle_probabilities: object = None,
    ) -> Answers | None: ...

def region_radius2(level: float, dimensions: int, dof: float) -> float: ...
def default_frame_priors() -> dict[str, float]: ...
def check_frame_priors(sigmas: tuple[float, ...], scales: _Floats) -> None: ...
def solve_frame(
    view: View,
    sigmas: tuple[float, ...],
    scales: _Floats,
    classes: list[int],
    bottom_centres: _Floats,
    rotations: _Floats,
    translations: _Floats,
    covariances: _Floats,
    carried: tuple[_Floats, _Floats] | None = None,
) -> dict[str, Any]: ...
def camera_state(
    view: View,
    sigmas: tuple[float, ...],
    scales: _Floats,
    carried: tuple[_Floats, _Floats] | None = None,
    another_drive: bool = True,
) -> dict[str, Any]: ...
def default_track_options() -> dict[str, Any]: ...

@final
class Tracker:
    def __new__(cls, given: dict[str, Any]) -> Tracker: ...
    def update(
        self,
        time: float,
        ego_motion: tuple[float, ...] | None,
        view: View,
        poses: tuple[_Floats, _Floats, _Floats],
        others: tuple[_Floats, _Floats, _Floats],
        bottom_centres: _Floats,
        numbers: _Floats,
        classes: list[int],
        error_dof: float,
    ) -> tuple[dict[str, Any], list[tuple[int, str]]]: ...
    def finish(self) -> None: ...
    def take_finished(self) -> dict[str, Any]: ...
    def open_frame(self) -> int: ...

def cut_crops(image: _Bytes, windows: _Floats, out: _Bytes, threads: int) -> None: ...
def solve_p1p(
    view: View,
    model: Model,
    keypoint_index: int,
    keypoint_2d: _Floats,
    bbox: _Floats,
    cases: str = "all",
) -> tuple[_Floats, _Floats]: ...
def solve_up2p(view: View, points_3d: _Floats, pixels: _Floats) -> tuple[_Floats, _Floats]: ...
def solve_p3p(camera: Camera, points_3d: _Floats, pixels: _Floats) -> tuple[_Floats, _Floats]: ...
def solve_p1p_height(
    view: View, model: Model, keypoint_index: int, keypoint_2d: _Floats, bbox: _Floats
) -> tuple[_Floats, _Floats]: ...
def synthetic_scenes(
    kind: str,
    trials: int,
    seed: int = 0,
    first_trial: int = 0,
    n_points: int = 300,
    outlier_ratio: float = 0.5,
    outliers: str = "image",
    noise_sigma: float = 2.0,
    pitch_error_deg: float = 0.0,
    bbox_error: float = 0.0,
    bbox_error_kind: str = "outward",
) -> dict[str, Any]: ...
def build_info() -> dict[str, Any]: ...
