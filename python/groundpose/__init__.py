"""groundpose: from one calibrated image, the 6-DoF pose and shape of every vehicle on the ground.

>>> import groundpose as gp
>>> view = gp.View(gp.Camera(fx=1000, fy=1000, cx=640, cy=360), pitch=0.01)
>>> model = gp.ShapeModel([[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2], [0.9, -0.7, 2.2]])
>>> len(gp.estimate_poses(view, [], None, model))
0

Frames: camera x right, y down, z forward; object x right, y down, z forward (its length); a pose is
`X_camera = R @ X_object + t`. Metres, pixels, radians (a degree carries `_deg`).
"""

from importlib.metadata import version

from groundpose._core import InputError, build_info
from groundpose.estimate import estimate_poses
from groundpose.poses import Pose, PoseBatch
from groundpose.shape import ShapeModel
from groundpose.types import Camera, Options, View

__version__ = version("groundpose")

__all__ = [
    "Camera",
    "InputError",
    "Options",
    "Pose",
    "PoseBatch",
    "ShapeModel",
    "View",
    "__version__",
    "build_info",
    "estimate_poses",
]
