"""What `groundpose estimate` does with images, tables and frames, once its options are understood."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from groundpose.cli.box_choice import BoxChoice
from groundpose.cli.cameras import CameraChoice
from groundpose.cli.crew import split
from groundpose.cli.destination import Destination, Inputs, chosen_format
from groundpose.cli.frames import FrameWork, opened, tilted_record
from groundpose.cli.inputs import is_several
from groundpose.cli.journal import Settings
from groundpose.cli.output import refuse
from groundpose.cli.results import Output, Pictures, Style
from groundpose.cli.run import Mounting, run
from groundpose.formats.records import pose_record
from groundpose.options import Options


@dataclass(frozen=True)
class Job:
    """What is said of the method and of the results."""

    options: Options
    threads: int | None
    mounting: Mounting
    out: Path | None
    form: str
    draw: Path | None
    strict: bool
    inputs: Inputs
    settings: Settings | None

    def images(
        self,
        source: Path,
        boxes: BoxChoice,
        camera: CameraChoice,
        network: Path | None,
        vehicle_threshold: float | None,
        min_score: float | None,
        pictures: bool,
        classes: Mapping[str, str],
        exif: bool,
        providers: list[str] | None,
        topic: str | None,
    ) -> int:
        """Estimate images; returns the exit status."""
        from groundpose.cli.images import STYLE, ImageWork
        from groundpose.keypoints.network import Network  # with onnxruntime
        from groundpose.keypoints.pipeline import Pipeline  # with the vehicles' models

        boxes.check(source)
        crew, each = split(self.threads, is_several(source))
        pipeline = Pipeline(
            Network(network, each, providers),
            options=self.options,
            threads=self.threads,
            vehicle_threshold=vehicle_threshold,
            classes=classes,
        )
        least = -math.inf if min_score is None else min_score
        work = ImageWork(source, boxes, camera, self.mounting, least, pipeline, exif, topic, crew)
        form = chosen_format(self.form, self.out, images=True)
        where = Destination.of_images(self.out, form, work.several)
        drawn = self._pictures(work.several, where.pictures if pictures else None)
        return run(work, Output(where, form, self.inputs, STYLE, self.settings), drawn, self.strict)

    def tables(
        self,
        source: Path,
        for_files: Mapping[str, object],
        network: Path | None,
        detector: Path | None,
        detector_score: float | None,
        vehicle_threshold: float | None,
        classes: Mapping[str, str],
    ) -> int:
        """Estimate the frames of Parquet files; returns the exit status."""
        from groundpose.cli.tables import TableWork, style
        from groundpose.fleet.worker import EstimateFrames  # with the network and the vehicles' models

        _refuse_all(for_files, "is for images in files; tables have it in their rows")
        estimate = EstimateFrames(
            network=None if network is None else str(network),
            detector=None if detector is None else str(detector),
            detector_score=detector_score,
            options=self.options,
            threads=self.threads,
            vehicle_threshold=vehicle_threshold,
            classes=classes,
            folder=str(source if source.is_dir() else source.parent),
        )
        work = TableWork(source, estimate, self.mounting)
        form = chosen_format(self.form, self.out, images=False)
        where = Destination.of_frames(self.out, form, several=True)
        written = style(self.mounting.frame_sigma is not None)
        output = Output(where, form, self.inputs, written, self.settings)
        return run(work, output, self._pictures(several=True), self.strict)

    def frames(self, source: Path, for_images: Mapping[str, object]) -> int:
        """Estimate frames that have keypoints; returns the exit status."""
        _refuse_all(for_images, "is for images, which are given with --boxes or --detector")
        with opened(source) as frames:
            work = FrameWork(frames, self.options, self.threads, self.mounting)
            form = chosen_format(self.form, self.out, images=False)
            where = Destination.of_frames(self.out, form, frames.several)
            drawn = self._pictures(frames.several)
            style = Style(pose_record if self.mounting.frame_sigma is None else tilted_record)
            return run(work, Output(where, form, self.inputs, style, self.settings), drawn, self.strict)

    def _pictures(self, several: bool, instead: Path | None = None) -> Pictures | None:
        path = self.draw or instead
        return None if path is None else Pictures(path, several, self.inputs)


def _refuse_all(given: Mapping[str, object], why: str) -> None:
    for name, value in given.items():
        if value is not None:
            refuse(f"--{name}: {why}")
