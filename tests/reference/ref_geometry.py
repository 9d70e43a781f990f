"""Reference geometry: camera, tilt, side planes, horizon, projection, lens distortion.

Plain NumPy after the paper (Lee et al. 2021, sec. 3.2 and Appendix B). Written without sight of the Rust
core, so that the two can be compared. Camera axes: x right, y down, z forward. Ground axes: origin at the
camera, y down along the ground normal, z forward. Pixels (u, v); angles in radians; lengths in metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class RefCamera:
    """Pinhole camera; `distortion` holds k1, k2, p1, p2, k3 of OpenCV's model."""

    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] | None = None

    @property
    def K(self) -> Array:
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class RefView:
    """Camera and its tilt; `height` is that of the camera centre above the ground."""

    camera: RefCamera
    pitch: float = 0.0
    roll: float = 0.0
    height: float | None = None

    @property
    def R_cg(self) -> Array:
        """Camera from ground: R_z(roll) R_x(-pitch); pitch > 0 lifts the optical axis above the horizon."""
        return rot_z(self.roll) @ rot_x(-self.pitch)


def rot_x(a: float) -> Array:
    c, s = np.cos(a), np.sin(a)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rot_y(a: float) -> Array:
    c, s = np.cos(a), np.sin(a)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rot_z(a: float) -> Array:
    c, s = np.cos(a), np.sin(a)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def hat(w: Array) -> Array:
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def exp_so3(w: Array) -> Array:
    """Rodrigues' formula; sinc and the half-angle form stay exact for tiny angles."""
    angle = float(np.linalg.norm(w))
    W = hat(w)
    a = np.sinc(angle / np.pi)
    b = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.eye(3) + a * W + b * W @ W


def log_so3(R: Array) -> Array:
    """Rotation vector of R; atan2 keeps small angles exact. Not for angles near pi."""
    v = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    s, c = float(np.linalg.norm(v)), 0.5 * (np.trace(R) - 1.0)
    return v if s < 1e-300 else v * (np.arctan2(s, c) / s)


def rotation_angle(A: Array, B: Array) -> float:
    """Angle of A B^T, exact to rounding for small and large angles (an arccos would lose half the digits)."""
    chord = float(np.linalg.norm(A - B)) / np.sqrt(8.0)
    return 2.0 * float(np.arcsin(min(1.0, chord)))


def tilt_from_gravity(gravity: Array) -> tuple[float, float]:
    """(pitch, roll) with R_cg [0, 1, 0] = gravity / |gravity|, gravity pointing down in the camera frame."""
    g = gravity / np.linalg.norm(gravity)
    return float(np.arcsin(-g[2])), float(np.arctan2(-g[0], g[1]))


def rays_ground(view: RefView, pixels: Array) -> Array:
    """Rays of (N, 2) undistorted pixels in the ground frame, scaled to BEV length 1 (d_x of the paper)."""
    homogeneous = np.column_stack([pixels, np.ones(len(pixels))])
    rays = homogeneous @ np.linalg.inv(view.camera.K).T @ view.R_cg
    scaled: Array = rays / np.hypot(rays[:, 0], rays[:, 2])[:, None]
    return scaled


def side_planes(view: RefView, left: float, right: float) -> Array:
    """(2, 3) unit normals, ground frame, of the planes through columns `left` and `right`, inwards."""
    normals = []
    for sign, u in ((1.0, left), (-1.0, right)):
        n_camera = sign * view.camera.K.T @ np.array([1.0, 0.0, -u])
        # K^T [1, 0, -u] . X is depth * (u(X) - u) when the third entry of the pixel is X's depth
        n = view.R_cg.T @ n_camera
        normals.append(n / np.linalg.norm(n))
    return np.array(normals)


def horizon(view: RefView) -> Array:
    """Line (a, b, c), a u + b v + c = 0: pixels whose ray has no component along the ground normal."""
    line: Array = np.linalg.inv(view.camera.K).T @ view.R_cg @ np.array([0.0, 1.0, 0.0])
    return line


def project(camera: RefCamera, points: Array) -> Array:
    """Pinhole projection of (N, 3) camera-frame points; NaN for points not in front."""
    z = np.where(points[:, 2] > 0.0, points[:, 2], np.nan)
    return np.column_stack(
        [camera.fx * points[:, 0] / z + camera.cx, camera.fy * points[:, 1] / z + camera.cy]
    )


def distort_normalised(xy: Array, distortion: tuple[float, ...]) -> Array:
    """OpenCV's forward model k1 k2 p1 p2 k3 on (N, 2) normalised coordinates."""
    k1, k2, p1, p2, k3 = distortion
    x, y = xy[:, 0], xy[:, 1]
    r2 = x * x + y * y
    radial = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.column_stack([xd, yd])


def distort(camera: RefCamera, pixels: Array) -> Array:
    """Undistorted pinhole pixels (N, 2) -> pixels the lens gives."""
    f, c = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    if camera.distortion is None:
        return np.array(pixels)
    bent: Array = distort_normalised((pixels - c) / f, camera.distortion) * f + c
    return bent


def undistort(camera: RefCamera, pixels: Array) -> Array:
    """Inverse of `distort` by Newton from the distorted point; NaN where it does not arrive."""
    if camera.distortion is None:
        return np.array(pixels)
    f, c = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    target = (pixels - c) / f
    xy, h = target.copy(), 1e-7
    for _ in range(50):
        columns = [
            (distort_normalised(xy + d, camera.distortion) - distort_normalised(xy - d, camera.distortion))
            / (2.0 * h)
            for d in h * np.eye(2)
        ]
        J = np.stack(columns, axis=2)
        error = distort_normalised(xy, camera.distortion) - target
        xy = xy - np.linalg.solve(J, error[:, :, None])[:, :, 0]
    arrived = np.abs(distort_normalised(xy, camera.distortion) - target).max(axis=1) < 1e-12
    return np.where(arrived[:, None], xy * f + c, np.nan)


def box_corners(bbox_3d: Array, footprint: Array | None = None) -> Array:
    """(2 C, 3) corners of the box, or of the prism over a footprint (C, 2) of (x, z); the top first."""
    (x0, y0, z0), (x1, y1, z1) = bbox_3d
    # front left, front right, rear right, rear left: the paper's corners 1 to 4, as Table 1 implies
    plan = np.array([[x0, z1], [x1, z1], [x1, z0], [x0, z0]]) if footprint is None else footprint
    layer = [np.column_stack([plan[:, 0], np.full(len(plan), y), plan[:, 1]]) for y in (y0, y1)]
    return np.concatenate(layer)


def upright_pose(view: RefView, yaw: float, t_ground: Array) -> tuple[Array, Array]:
    """(R, t) camera_from_object of an upright object at t_ground in the ground frame."""
    return view.R_cg @ rot_y(yaw), view.R_cg @ t_ground


def box_columns(view: RefView, R: Array, t: Array, corners: Array) -> tuple[float, float, float, float]:
    """2D box (left, top, right, bottom) of the projected corners."""
    uv = project(view.camera, corners @ R.T + t)
    (left, top), (right, bottom) = uv.min(axis=0), uv.max(axis=0)
    return float(left), float(top), float(right), float(bottom)
