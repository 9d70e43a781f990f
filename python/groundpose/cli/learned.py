"""`groundpose estimate --learn-camera`: one camera's state over all images of a run, and from run to run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from groundpose.camera_state import CameraState
from groundpose.frame import FramePriors
from groundpose.types import View


@dataclass
class LearnedCamera:
    """The state of the camera of a run, which is a drive of its own.

    Args:
        path: JSON file to go on with, if it is there, and to write at the end.
        priors: of a camera that is new.
    """

    path: Path
    priors: FramePriors
    state: CameraState | None = None

    def of(self, view: View) -> CameraState:
        """The state, of the first view that is asked for when it is new."""
        if self.state is None:
            if self.path.exists():
                self.state = CameraState.load(self.path)
                self.state.start_drive()
            else:
                self.state = CameraState(view, self.priors)
        return self.state

    def remarks(self) -> list[str]:
        """Save it, and say what was learned."""
        if self.state is None:
            return []
        self.state.save(self.path)
        return [f"{self.path}: {self.state}", *self.state.remarks]
