"""A picture of how a calibration settled."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from groundpose._writing import whole_path
from groundpose.self_calibration.calibrate import Calibration

_BLUE, _GREY = "#1f5f99", "#999999"


def draw_calibration(calibration: Calibration, path: str | PathLike[str]) -> None:
    """Write the picture: pitch, roll, height after more and more vehicles with their 95 % intervals, and the
    residuals of the contacts over distance. Raises OSError."""
    figure = Figure(figsize=(11.0, 6.4), layout="constrained")
    axes = figure.subplots(2, 2).ravel()
    settled = calibration.settling
    for k, (name, turned) in enumerate(
        (("pitch, degrees", True), ("roll, degrees", True), ("height, m", False))
    ):
        axis, mean, sigma = axes[k], settled.mean[:, k], 1.96 * settled.sigma[:, k]
        ends = np.stack([mean - sigma, mean, mean + sigma])
        low, middle, high = np.degrees(ends) if turned else np.exp(ends)
        axis.fill_between(settled.vehicles, low, high, color=_BLUE, alpha=0.2, lw=0)
        axis.plot(settled.vehicles, middle, color=_BLUE, marker="o", ms=3)
        axis.set(ylabel=name, xlabel="vehicles", xscale="log")
        last = slice(len(low) // 2, None)
        margin = 0.3 * (high[last].max() - low[last].min())
        axis.set_ylim(low[last].min() - margin, high[last].max() + margin)
        axis.grid(alpha=0.3)
    _residuals(axes[3], calibration)
    profile = calibration.profile
    height, pitch = profile.view.height, math.degrees(profile.view.pitch)
    figure.suptitle(
        f"{profile.vehicles} vehicles: pitch {pitch:.2f} ± {math.degrees(profile.pitch_sigma):.2f} degrees, "
        f"height {height:.2f} ± {profile.height_sigma:.2f} m (standard deviations; shaded: 95 %)"
    )
    with whole_path(path) as part:
        figure.savefig(part, dpi=110, format=Path(path).suffix.lstrip(".") or "png")


def _residuals(axis: object, calibration: Calibration) -> None:
    """Height of the contacts over the plane, as a fraction of the camera's height."""
    contacts, plane = calibration.contacts, calibration.plane
    n = calibration.profile.view.R_camera_from_ground[:, 1]
    depth = contacts.points @ n
    residual = np.log(np.maximum(depth, 0.05)) - plane.mean[2] + plane.mean[3 + contacts.classes]
    away = np.linalg.norm(contacts.points, axis=1)
    used = plane.weights > 0.5
    scatter = axis.scatter  # type: ignore[attr-defined]
    scatter(away[~used], 100.0 * residual[~used], s=6, color=_GREY, label="weighs less")
    scatter(away[used], 100.0 * residual[used], s=6, color=_BLUE, label="contacts")
    axis.axhline(0.0, color="black", lw=0.8)  # type: ignore[attr-defined]
    spread = 100.0 * max(3.0 * float(np.std(residual[used])) if used.any() else 0.3, 0.05)
    axis.set(xlabel="distance, m", ylabel="depth under the camera, % off", ylim=(-spread, spread))  # type: ignore[attr-defined]
    axis.legend(loc="upper right", fontsize=8)  # type: ignore[attr-defined]
    axis.grid(alpha=0.3)  # type: ignore[attr-defined]
