"""A camera as a profile or any camera file says it, for all frames of a run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from groundpose.camera_profile import CameraProfile, is_profile
from groundpose.cli.output import refuse
from groundpose.cli.run import Mounting
from groundpose.formats.calibrations import read_calibration
from groundpose.frame import FramePriors
from groundpose.sizes import SizePrior
from groundpose.types import View


def read_profile(option: str, path: Path, **instead: object) -> CameraProfile:
    """The profile of a file, which says all of the camera: options that say it too are refused. Raises
    OSError, InputError."""
    given = [f"--{name.replace('_', '-')}" for name, value in instead.items() if value is not None]
    if given:
        refuse(f"{option}: a profile says camera, tilt and height; leave out {' and '.join(given)}")
    return CameraProfile.load(path)


def profiled_frame(profile: CameraProfile, region: str | None) -> FramePriors:
    """What a profile says of each frame; the sizes of a region instead of those that it learned."""
    priors = profile.priors()
    return priors if region is None else replace(priors, size=SizePrior.region(region))


@dataclass(frozen=True)
class KnownCamera:
    """The view of all frames, and how its poses are found.

    Attributes:
        view: camera, tilt, height.
        mounting: with the standard deviations and the sizes of a profile, those of the world else.
    """

    view: View
    mounting: Mounting

    @classmethod
    def read(cls, path: Path, height: float | None) -> KnownCamera:
        """Of `--camera` and `--height`. Raises OSError, InputError."""
        if is_profile(path):
            profile = read_profile("--camera", path, height=height)
            return cls(profile.view, Mounting(frame=profile.priors(), view=profile.view))
        found = read_calibration(path)
        view = found if height is None else replace(found, height=height)
        frame = None if view.height is None else FramePriors()
        return cls(view, Mounting(view.pitch, view.roll, view.height, None, frame))
