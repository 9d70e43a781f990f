"""Which camera took the images: a file, a folder with a file per image, or a field of view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from groundpose._checks import input_error
from groundpose.cli.inputs import companion
from groundpose.formats.calibrations import read_calibration
from groundpose.types import Camera, View


@dataclass
class CameraChoice:
    """What the command line says of the camera.

    Args:
        calibration: a file for all images, or a folder with a file per image.
        name: which camera of the file.
        fov_deg: degrees across an ideal lens, instead of a file.

    Raises:
        InputError: options that exclude each other.
    """

    calibration: Path | None
    name: str | None = None
    fov_deg: float | None = None

    def __post_init__(self) -> None:
        """Check what goes together."""
        if self.name is not None and self.calibration is None:
            raise input_error("--camera", "--calib with a file of several cameras", "none")
        if self.fov_deg is not None and self.calibration is not None:
            raise input_error("--fov-deg", "no --calib beside it", "both")
        if self.fov_deg is not None and not 0.0 < self.fov_deg < 180.0:
            raise input_error("--fov-deg", "degrees between 0 and 180", f"{self.fov_deg:g}")

    @property
    def is_given(self) -> bool:
        """Whether the images' boxes need no camera of their own."""
        return self.calibration is not None or self.fov_deg is not None

    def of_all(self) -> View | None:
        """The view of a file for all images. Raises OSError, InputError."""
        file = self.calibration
        return None if file is None or file.is_dir() else read_calibration(file, self.name)

    def of_one(self, image: str, size: tuple[int, int]) -> View | None:
        """The view of an image of a folder of files, or of a field of view. Raises OSError, InputError."""
        if self.fov_deg is not None:
            return View(Camera.from_fov(*size, math.radians(self.fov_deg)))
        return (
            None
            if self.calibration is None
            else read_calibration(companion(self.calibration, image), self.name)
        )
