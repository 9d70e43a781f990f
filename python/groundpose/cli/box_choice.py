"""What is said of where the 2D boxes of images come from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from groundpose.cli.output import refuse

if TYPE_CHECKING:
    from groundpose.cli.boxes import BoxSource
    from groundpose.keypoints.pipeline import Pipeline


@dataclass(frozen=True)
class BoxChoice:
    """Files of `--boxes`, or the file of `--detector` and its `--detector-score`."""

    boxes: Path | None
    detector: Path | None
    score: float | None

    def check(self, source: Path) -> None:
        """Refuse none of them, and both."""
        if self.boxes is None and self.detector is None:
            refuse(
                f"{source}: is an image or a folder; give the 2D boxes too, --boxes FILE, or --detector FILE"
            )
        if self.boxes is not None and self.detector is not None:
            refuse("--detector: expected no --boxes beside it, got both")
        if self.detector is None and self.score is not None:
            refuse("--detector-score: is for --detector")

    def source(self, images: Path, pipeline: Pipeline, several: bool) -> BoxSource:
        """The boxes of these images, of which there may be `several`. Raises OSError, InputError."""
        from groundpose.cli.boxes import BoxesOfDetector, BoxesOfFiles  # with onnxruntime
        from groundpose.detector.detector import Detector

        if self.detector is not None:
            found = Detector(
                self.detector, pipeline.threads, min_score=self.score, providers=pipeline.network.providers
            )
            return BoxesOfDetector(found, pipeline)
        assert self.boxes is not None
        return BoxesOfFiles(self.boxes, images, several)
