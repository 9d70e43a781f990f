"""`groundpose estimate` of frames in Parquet files: a file, or a folder of them and of such folders."""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from groundpose._checks import blamed
from groundpose._core import InputError
from groundpose.cli.images import STYLE, vehicle_record
from groundpose.cli.results import Style
from groundpose.cli.run import Mounting, Result
from groundpose.fleet.parts import files_of
from groundpose.fleet.worker import FRAMES_AT_ONCE, EstimateFrames
from groundpose.formats.arrow_frames import BadRow, FrameRow, frame_rows
from groundpose.formats.frames import Frame, FrameObject
from groundpose.formats.parquet import package
from groundpose.formats.records import pose_record, tilt_members
from groundpose.keypoints.vehicle_poses import NOT_A_VEHICLE, VehiclePoses
from groundpose.poses import PoseBatch


def named_images(source: Path) -> list[Path]:
    """The pictures that the rows of tables name. Raises OSError, InputError (no Parquet file)."""
    parquet = import_module(f"{package().__name__}.parquet")
    folder, found = source if source.is_dir() else source.parent, []
    for path in files_of(source):
        with blamed(path), parquet.ParquetFile(path) as file:
            if "image" in file.schema_arrow.names:
                for batch in file.iter_batches(columns=["image"]):
                    found += [folder / name for name in batch.column(0).to_pylist() if isinstance(name, str)]
    return found


@dataclass
class TableWork:
    """Rows of tables, estimated one after the other, a few of them in memory; see `cli.run.Work`.

    Raises:
        OSError: no such file. InputError: a file that is no Parquet file.
    """

    path: Path
    estimate: EstimateFrames
    mounting: Mounting
    finished: Container[int] = ()
    no_vehicle: int = 0
    noun = "frames"
    several = True

    def __post_init__(self) -> None:
        """Find the files and how many rows they have."""
        parquet = import_module(f"{package().__name__}.parquet")
        self.name, self._files, self._open = str(self.path), files_of(self.path), parquet.ParquetFile
        self.total = 0
        for path in self._files:
            with blamed(path), self._open(path) as file:
                self.total += file.metadata.num_rows

    @property
    def passed_over(self) -> int:
        """How many boxes hold no vehicle."""
        return self.no_vehicle

    def remarks(self) -> list[str]:
        """What held no vehicle."""
        boxes = f"{self.no_vehicle} box{'es hold' if self.no_vehicle > 1 else ' holds'} no vehicle"
        return ([boxes] if self.no_vehicle else []) + self.mounting.remarks()

    def __iter__(self) -> Iterator[Result | InputError | None]:
        """Rows in order; a bad one gives its error and the next one goes on."""
        for number, (path, row) in enumerate(self._rows()):
            yield None if number in self.finished else self._done(path, row)

    def _rows(self) -> Iterator[tuple[Path, FrameRow | BadRow]]:
        arrow = package()
        for path in self._files:
            with self._open(path, pre_buffer=False) as file:
                metadata = file.schema_arrow.metadata
                for batch in file.iter_batches(FRAMES_AT_ONCE):
                    table = arrow.Table.from_batches([batch]).replace_schema_metadata(metadata)
                    yield from ((path, row) for row in frame_rows(table, str(path)))

    def _done(self, path: Path, row: FrameRow | BadRow) -> Result | InputError:
        place = f"{path}: frame {row.frame}"
        if isinstance(row, BadRow):
            return InputError(f"{place}: {row.message}")
        row, pixels = replace(row, view=self.mounting.of(row.view)), None
        if row.needs_picture:
            self.estimate.load()  # whose errors are no frame's
        try:
            with blamed(place):
                if row.needs_picture:
                    pixels = self.estimate.pixels(row)
                    row = replace(row, picture=pixels)
                poses = self.estimate.poses(row, **self.mounting.arguments(row.view))
        except InputError as error:
            return InputError(f"{place}: {str(error).removeprefix(f'{place}: ')}")
        no_vehicle = int((poses.status == NOT_A_VEHICLE).sum())
        self.no_vehicle += no_vehicle
        return Result(self._frame(row, place, poses), poses, pixels, no_vehicle)

    def _frame(self, row: FrameRow, place: str, poses: PoseBatch) -> Frame:
        """What was found, as a frame has it."""
        given: Any = row.objects or ()
        ids = [o.id for o in given] if given else [str(label) for label in getattr(poses, "ids", ())]
        scores = [o.score for o in given] if given else [None] * len(poses)
        names = getattr(poses, "classes", [model.name for model in poses.models])
        objects = tuple(
            FrameObject(label, str(name), pose.keypoints_2d, own, pose.bbox.tolist(), None, score)
            for label, name, pose, own, score in zip(ids, names, poses, _scores(poses), scores, strict=True)
        )
        image = None if row.image is None else Path(self.estimate.folder) / row.image
        return Frame(row.frame, place, poses.view, image, objects, poses.models, row.time)


def _scores(poses: PoseBatch) -> list[list[float] | None]:
    """Of each object's keypoints, as the network gives them."""
    if not isinstance(poses, VehiclePoses):
        return [None] * len(poses)
    rows = zip(poses.keypoint_scores.tolist(), poses.models, strict=True)
    return [row[: len(model.keypoints_3d)] for row, model in rows]


def style(tilted: bool) -> Style:
    """Of rows: what a network says where one was asked, and the tilt where it is estimated."""

    def record(frame: Frame, poses: PoseBatch) -> str:
        if isinstance(poses, VehiclePoses):
            return vehicle_record(frame, poses)
        return pose_record(frame, poses, tilt_members(poses.view) if tilted else None)

    return Style(record, STYLE.kitti_type)
