"""`groundpose demo`: a street with known poses, estimated, compared and drawn."""

from __future__ import annotations

import time
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from groundpose._checks import FloatArray
from groundpose.demo_picture import paint
from groundpose.demo_scene import Scene, make_scene
from groundpose.estimate import estimate_poses
from groundpose.poses import PoseBatch

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True, eq=False)
class Demo:
    """A scene, its estimated poses and the time of the call."""

    scene: Scene
    poses: PoseBatch
    seconds: float

    @property
    def position_errors(self) -> FloatArray:
        """(N,) metres between estimated and true origin; NaN without an answer."""
        return np.asarray(np.linalg.norm(self.poses.t - self.scene.t, axis=1))

    @property
    def rotation_errors(self) -> FloatArray:
        """(N,) radians between estimated and true rotation; NaN without an answer."""
        return rotation_angles(self.poses.R, self.scene.R)

    def table(self) -> Table:
        """Estimate beside truth, one row an object."""
        return _table(self)

    def write_picture(self, path: str | PathLike[str]) -> None:
        """Overlay and bird's-eye view as an image file."""
        ok, count = int(self.poses.ok.sum()), len(self.poses)
        took = f"{self.seconds * 1e6:.0f} µs on one thread"
        title = f"groundpose: {ok} of {count} vehicles placed from one image, {took}"
        self.poses.draw(paint(self.scene), path, truth=(self.scene.R, self.scene.t), title=title)


def run(seed: int = 0) -> Demo:
    """Make the scene of `seed` and estimate its poses; the time is the fastest of five one-thread calls."""
    scene = make_scene(seed)
    seconds = np.inf
    for _ in range(5):
        start = time.perf_counter()
        poses = estimate_poses(scene.view, scene.keypoints_2d, scene.bboxes, scene.models, threads=1)
        seconds = min(seconds, time.perf_counter() - start)
    return Demo(scene, poses, seconds)


def rotation_angles(first: FloatArray, second: FloatArray) -> FloatArray:
    """Angles (N,), radians, between rotations (N, 3, 3) and (N, 3, 3)."""
    traces = np.einsum("nij,nij->n", first, second)
    return np.asarray(np.arccos(np.clip(0.5 * (traces - 1.0), -1.0, 1.0)))


def _table(demo: Demo) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False, title="Estimate (truth)")
    for name in ("#", "vehicle", "status", "distance, m", "yaw, deg", "error", "inliers"):
        table.add_column(name, justify="left" if name in ("vehicle", "status") else "right", no_wrap=True)
    for i in range(len(demo.poses)):
        table.add_row(*_row(demo, i), style="" if demo.poses.ok[i] else "dim")
    pitch, roll = (np.degrees(angle) for angle in (demo.scene.true_view.pitch, demo.scene.true_view.roll))
    table.caption = (
        f"{len(demo.poses)} objects in {demo.seconds * 1e6:.0f} µs, one call on one thread\n"
        f"camera tilted by {pitch:.1f}° and {roll:.1f}°, told 0° and 0°"
    )
    return table


def _row(demo: Demo, index: int) -> list[str]:
    scene, pose = demo.scene, demo.poses[index]
    forward = scene.true_view.R_camera_from_ground.T @ scene.R[index, :, 2]
    true_yaw = _degrees(np.arctan2(forward[0], forward[2]))
    true_distance = np.linalg.norm(scene.t[index])
    seen = int(np.isfinite(pose.keypoints_2d).all(axis=1).sum())
    estimate, error = ["-", "-"], "-"
    if pose.ok:
        estimate = [f"{np.linalg.norm(pose.t):.1f}", f"{_degrees(pose.yaw):.1f}"]
        error = f"{demo.position_errors[index]:.2f} m {np.degrees(demo.rotation_errors[index]):.1f}°"
    return [
        str(index),
        scene.labels[index],
        pose.status,
        f"{estimate[0]} ({true_distance:.1f})",
        f"{estimate[1]} ({true_yaw:.1f})",
        error,
        f"{pose.inlier_count}/{seen}",
    ]


def _degrees(angle: float) -> float:
    """Radians in degrees between -90 and 270, so that 179 stands beside 181."""
    return float((np.degrees(angle) + 90.0) % 360.0 - 90.0)
