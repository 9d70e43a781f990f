"""groundpose: from one calibrated image, the 6-DoF pose and shape of every vehicle on the ground.

>>> import groundpose as gp
>>> view = gp.View(gp.Camera(fx=1000, fy=1000, cx=640, cy=360), pitch=0.01)
>>> model = gp.ShapeModel([[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2], [0.9, -0.7, 2.2]])
>>> len(gp.estimate_poses(view, [], None, model))
0

Frames: camera x right, y down, z forward; object x right, y down, z forward (its length); a pose is
`X_camera = R @ X_object + t`. Metres, pixels, radians (a degree carries `_deg`).
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from groundpose._core import InputError, build_info
from groundpose.estimate import estimate_poses
from groundpose.estimator import Estimator
from groundpose.options import Options
from groundpose.poses import Alternatives, Pose, PoseBatch, region_radius2
from groundpose.shape import ShapeModel
from groundpose.types import Camera, View

if TYPE_CHECKING:
    from groundpose.camera_profile import CameraProfile
    from groundpose.camera_state import CameraState
    from groundpose.detector.detector import Detector
    from groundpose.frame import EstimatedView, FramePriors
    from groundpose.keypoints.network import Network
    from groundpose.keypoints.pipeline import Pipeline
    from groundpose.keypoints.vehicle_poses import VehiclePoses
    from groundpose.self_calibration.calibrate import Calibration, calibrate
    from groundpose.self_calibration.plane import Known
    from groundpose.self_calibration.sightings import Sightings
    from groundpose.sizes import ClassSize, SizePrior
    from groundpose.tracking import SeenVehicles, Tracker, TrackOptions, Tracks
    from groundpose.traffic import Crossing, CrossingCounter, Flow, Lane, Line, TrafficSummary
    from groundpose.world import World

__version__: str = build_info()["version"]

# What a program may need besides the solver is imported when it is first asked for: what is known of a frame,
# networks with onnxruntime and the vehicles' models, calibration, tracks, traffic.
_TRACKING = ("SeenVehicles", "Tracker", "TrackOptions", "Tracks")
_TRAFFIC = ("Crossing", "CrossingCounter", "Flow", "Lane", "Line", "TrafficSummary")
_LAZY = {
    **dict.fromkeys(_TRACKING, "groundpose.tracking"),
    **dict.fromkeys(_TRAFFIC, "groundpose.traffic"),
    "CameraState": "groundpose.camera_state",
    "ClassSize": "groundpose.sizes",
    "EstimatedView": "groundpose.frame",
    "FramePriors": "groundpose.frame",
    "SizePrior": "groundpose.sizes",
    "World": "groundpose.world",
    "Calibration": "groundpose.self_calibration.calibrate",
    "CameraProfile": "groundpose.camera_profile",
    "Known": "groundpose.self_calibration.plane",
    "Sightings": "groundpose.self_calibration.sightings",
    "calibrate": "groundpose.self_calibration.calibrate",
    "Detector": "groundpose.detector.detector",
    "Network": "groundpose.keypoints.network",
    "Pipeline": "groundpose.keypoints.pipeline",
    "VehiclePoses": "groundpose.keypoints.vehicle_poses",
}

__all__ = [
    "Alternatives",
    "Calibration",
    "Camera",
    "CameraProfile",
    "CameraState",
    "ClassSize",
    "Crossing",
    "CrossingCounter",
    "Detector",
    "EstimatedView",
    "Estimator",
    "Flow",
    "FramePriors",
    "InputError",
    "Known",
    "Lane",
    "Line",
    "Network",
    "Options",
    "Pipeline",
    "Pose",
    "PoseBatch",
    "SeenVehicles",
    "ShapeModel",
    "Sightings",
    "SizePrior",
    "TrackOptions",
    "Tracker",
    "Tracks",
    "TrafficSummary",
    "VehiclePoses",
    "View",
    "World",
    "__version__",
    "build_info",
    "calibrate",
    "estimate_poses",
    "region_radius2",
]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(_LAZY[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
