"""The demo itself: the pipeline on the bundled street, estimate beside truth, times, the picture."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from groundpose._checks import FloatArray
from groundpose.demo.street import Street, example
from groundpose.keypoints.pipeline import Pipeline
from groundpose.keypoints.vehicle_poses import VehiclePoses

if TYPE_CHECKING:
    from rich.table import Table

_RUNS = 5
# Of distance, yaw and length in the table.
_DIGITS = (1, 0, 1)


@dataclass(frozen=True, eq=False)
class Demo:
    """The street and what the pipeline made of it; the times are those of the fastest of five runs."""

    street: Street
    poses: VehiclePoses

    @property
    def seconds(self) -> float:
        """From the image in memory to all poses."""
        return sum(self.poses.seconds.values())

    @property
    def position_errors(self) -> FloatArray:
        """(N,) metres between estimated and true origin; NaN without an answer."""
        return np.asarray(np.linalg.norm(self.poses.t - self.street.t, axis=1))

    @property
    def rotation_errors(self) -> FloatArray:
        """(N,) radians between estimated and true rotation; NaN without an answer."""
        traces = np.einsum("nij,nij->n", self.poses.R, self.street.R)
        return np.asarray(np.arccos(np.clip(0.5 * (traces - 1.0), -1.0, 1.0)))

    def table(self) -> Table:
        """Estimate beside truth, one row per vehicle."""
        return _table(self)

    def write_picture(self, path: str | PathLike[str]) -> None:
        """Overlay and bird's-eye view as an image file."""
        ok, count = int(self.poses.ok.sum()), len(self.poses)
        took = f"{self.seconds * 1e3:.0f} ms on one core"
        title = f"groundpose: {ok} of {count} vehicles placed from one image, {took}"
        truth = (self.street.R, self.street.t, self.street.bbox_3d)
        self.poses.draw(self.street.image, path, truth=truth, title=title)


def run(network: str | PathLike[str] | None = None) -> Demo:
    """Run the pipeline on one thread with the network in file `network` (None: the bundled one).

    Raises:
        OSError: no such file. InputError: a file that is not a network of ours.
    """
    pipeline, street = Pipeline(network, threads=1), example()
    runs = [pipeline(street.image, street.bboxes, street.view) for _ in range(1 + _RUNS)]
    return Demo(street, min(runs[1:], key=lambda poses: sum(poses.seconds.values())))


def _table(demo: Demo) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False, title="Estimate (truth)")
    for name in ("#", "class", "distance, m", "yaw, °", "length, m", "error"):
        table.add_column(name, justify="left" if name == "class" else "right", no_wrap=True)
    for i in range(len(demo.poses)):
        table.add_row(*_row(demo, i), style="" if demo.poses.ok[i] else "dim")
    table.caption = _caption(demo)
    return table


def _caption(demo: Demo) -> str:
    steps = ", ".join(f"{name} {seconds * 1e3:.1f}" for name, seconds in demo.poses.seconds.items())
    each = demo.seconds * 1e3 / max(len(demo.poses), 1)
    pitch, roll = (np.degrees(angle) for angle in (demo.street.true_view.pitch, demo.street.true_view.roll))
    return (
        f"{steps} ms\n{each:.1f} ms per vehicle on one core\n"
        f"camera tilted by {pitch:.1f}° and {roll:.1f}°, nominally 0° and 0°"
    )


def _row(demo: Demo, index: int) -> list[str]:
    true, pose = demo.street, demo.poses[index]
    class_name = str(demo.poses.classes[index]) or "-"
    named = class_name if class_name == true.classes[index] else f"{class_name} ({true.classes[index]})"
    forward = true.true_view.R_camera_from_ground.T @ true.R[index, :, 2]
    truth = (
        np.linalg.norm(true.t[index]),
        _degrees(np.arctan2(forward[0], forward[2])),
        _length(true.bbox_3d[index]),
    )
    numbers, error = ["-"] * len(truth), pose.status
    if pose.ok:
        length = _length(pose.model.stretched_bbox_3d(pose.shape_coefficients))
        estimate = (np.linalg.norm(pose.t), _degrees(pose.yaw), length)
        numbers = [f"{x:.{digits}f}" for x, digits in zip(estimate, _DIGITS, strict=True)]
        error = f"{demo.position_errors[index]:.2f} m {np.degrees(demo.rotation_errors[index]):.1f}°"
    compared = [f"{n} ({x:.{d}f})" for n, x, d in zip(numbers, truth, _DIGITS, strict=True)]
    return [str(index), named, *compared, error]


def _length(bbox_3d: FloatArray) -> float:
    return float(bbox_3d[1, 2] - bbox_3d[0, 2])


def _degrees(angle: float) -> float:
    """Radians in degrees between -90 and 270, so that 179 stands beside 181."""
    return float((np.degrees(angle) + 90.0) % 360.0 - 90.0)
