"""The poses of a frame as a table for people."""

from __future__ import annotations

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from groundpose._checks import FloatArray
from groundpose.cli.output import harmless
from groundpose.formats.frames import Frame
from groundpose.poses import Pose, PoseBatch


def frame_table(frame: Frame, poses: PoseBatch) -> Table:
    """The poses of one frame, with errors where the truth is known."""
    table = Table(
        title=f"Frame {harmless(frame.id)}",
        title_justify="left",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        show_edge=False,
    )
    for name in ("object", "model", "status"):
        table.add_column(name, no_wrap=True)
    truth = frame.truth
    for name in ("x, z (m)", "yaw (°)", "inliers", "rms px", "± m", *(["error"] if truth else [])):
        table.add_column(name, justify="right", no_wrap=True)
    ground = poses.view.R_camera_from_ground
    for i, (item, pose) in enumerate(zip(frame.objects, poses, strict=True)):
        row = [harmless(item.id), harmless(item.model), pose.status, *_numbers(pose, ground)]
        if truth:
            row.append(_error(pose, truth[0][i], truth[1][i]))
        table.add_row(*row, style="" if pose.ok else "dim")
    return table


def _numbers(pose: Pose, ground: FloatArray) -> list[str]:
    seen = int(np.isfinite(pose.keypoints_2d).all(axis=1).sum())
    if not pose.ok:
        return ["-", "-", f"-/{seen}", "-", "-"]
    x, _, z = ground.T @ pose.t
    spread = float(np.sqrt(np.trace(pose.covariance[3:, 3:])))
    return [
        f"{x:.2f}, {z:.2f}",
        f"{np.degrees(pose.yaw):.1f}",
        f"{pose.inlier_count}/{seen}",
        f"{pose.reprojection_rmse:.2f}",
        "-" if np.isnan(spread) else f"{spread:.2f}",
    ]


def _error(pose: Pose, R: FloatArray, t: FloatArray) -> str:
    if not pose.ok or np.isnan(t).any():
        return "-"
    angle = np.degrees(np.arccos(np.clip(0.5 * (np.sum(pose.R * R) - 1.0), -1.0, 1.0)))
    return f"{np.linalg.norm(pose.t - t):.2f} m {angle:.1f}°"
