"""Tables of frames to tables of poses: what runs in every worker."""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import blamed, input_error
from groundpose._core import InputError
from groundpose.detector.detector import Detector
from groundpose.estimate import estimate_poses
from groundpose.formats.arrow_frames import BadRow, FrameRow, frame_rows
from groundpose.formats.arrow_poses import Answer, poses_table
from groundpose.formats.arrow_schema import POSES, schema_of
from groundpose.formats.parquet import package
from groundpose.frame import FramePriors
from groundpose.keypoints.codec import ByteArray
from groundpose.keypoints.image import as_rgb
from groundpose.keypoints.pipeline import Pipeline
from groundpose.options import Options
from groundpose.poses import PoseBatch

FRAMES_AT_ONCE = 64
"""Frames of a table whose poses are in memory at a time."""


@dataclass(frozen=True, kw_only=True)
class EstimateFrames:
    """Called with a table of frames it gives the table of their poses; see `groundpose.formats.arrow_schema`.

    A frame that cannot be estimated gives one row that says why. Network and detector are loaded once in a
    process, when they are first needed: an object of this class is small, and pickles.

    >>> poses = dataset.map_batches(EstimateFrames, batch_format="pyarrow", concurrency=2)   # doctest: +SKIP

    Args:
        network: as in `Pipeline`: a path, or the name of a bundled one.
        detector: the path of one, for rows without objects; None: these are bad frames.
        detector_score: as `min_score` of `Detector`.
        options: of the solver. threads: of network and solver in each process.
        vehicle_threshold, classes: as in `Pipeline`.
        priors: of each frame, whose vehicles then stand on one road; None: every vehicle alone.
        folder: to which names of pictures are relative.

    Raises:
        InputError: when it is called: a table of another schema or version, a column that is missing; a
            network that is none of ours.
        OSError: a file that cannot be read for another reason than that it is not there; the table is then to
            be tried again.
    """

    network: str | None = None
    detector: str | None = None
    detector_score: float | None = None
    options: Options = field(default_factory=Options)
    threads: int | None = 1
    vehicle_threshold: float | None = None
    classes: Mapping[str, str] = field(default_factory=dict)
    priors: FramePriors | None = None
    folder: str = ""

    def __call__(self, frames: Any) -> Any:
        """A `pyarrow.Table` of poses of a Table or RecordBatch of frames, in its order."""
        arrow = package()
        table = arrow.Table.from_batches([frames]) if isinstance(frames, arrow.RecordBatch) else frames
        if not isinstance(table, arrow.Table):
            raise input_error("frames", "a pyarrow Table or RecordBatch", type(frames).__name__)
        starts = range(0, table.num_rows, FRAMES_AT_ONCE) or [0]  # an empty table is judged, too
        return arrow.concat_tables(
            [poses_table(self._answers(table.slice(k, FRAMES_AT_ONCE))) for k in starts]
        )

    def batches(self, frames: Iterable[Any]) -> Iterator[Any]:
        """The same of a stream of RecordBatches, which is what Spark's `mapInArrow` wants."""
        for batch in frames:
            yield from self(batch).combine_chunks().to_batches()

    def nested(self, frames: Any) -> Any:
        """Of each frame the list of its rows without the column `frame`, for engines whose functions give as
        many rows as they get (Daft): a `pyarrow.ListArray`."""
        table = frames if isinstance(frames, package().Table) else package().Table.from_batches([frames])
        answers = self._answers(table)
        counts = [max(1, 0 if a.poses is None else len(a.poses)) for a in answers]
        rows = poses_table(answers).drop_columns(["frame"]).combine_chunks()
        structs = rows.to_struct_array()
        inside = structs.combine_chunks() if hasattr(structs, "combine_chunks") else structs
        inside = inside.chunk(0) if hasattr(inside, "num_chunks") else inside
        offsets = package().array(np.concatenate([[0], np.cumsum(counts)]), type=package().int32())
        return package().ListArray.from_arrays(offsets, inside)

    @staticmethod
    def schema() -> Any:
        """The `pyarrow.Schema` of what it gives."""
        return schema_of(POSES)

    def settings(self) -> dict[str, str]:
        """What decides the rows, in words; a network's and a detector's file with size and time."""
        said = {
            f.name: repr(getattr(self, f.name)) for f in fields(self) if f.name not in ("threads", "folder")
        }
        for name in ("network", "detector"):
            path = getattr(self, name)
            if path is not None and Path(path).is_file():
                found = Path(path).stat()
                said[name] += f" of {found.st_size} bytes, {found.st_mtime_ns}"
        return said

    def load(self) -> None:
        """Load network and detector, unless this process has them. Raises OSError, InputError."""
        _ = self._pipeline
        if self.detector is not None:
            _detector(self.detector, self.threads, self.detector_score)

    def _answers(self, table: Any) -> list[Answer]:
        return [self._answer(row) for row in frame_rows(table)]

    def _answer(self, row: FrameRow | BadRow) -> Answer:
        if isinstance(row, BadRow):
            return Answer(row.frame, None, row.message, row.time, row.image)
        if row.needs_picture:
            self.load()  # whose errors are no frame's
        try:
            with blamed(f"frame {row.frame}"):
                poses = self.poses(row)
        except InputError as error:
            if isinstance(error.__cause__, (MemoryError, OSError)) and not _is_gone(error.__cause__):
                raise error.__cause__ from None  # of the worker, not of the frame
            said = str(error).replace(f"{Path(self.folder)}{os.sep}", "")  # the same rows wherever it lies
            return Answer(row.frame, None, said, row.time, row.image)
        given = row.objects or ()
        ids = [o.id for o in given] or None
        scores = [o.score for o in given] or None
        return Answer(row.frame, poses, None, row.time, row.image, ids, scores=scores)

    def poses(self, row: FrameRow, **known: Any) -> PoseBatch:
        """Of one row; `known`: `frame` and `frame_tilt_sigma` of `estimate_poses`, instead of `priors`.

        Raises:
            InputError: a frame that cannot be estimated. OSError: naming the picture.
        """
        known = known or {"frame": self.priors}
        if not row.needs_picture:
            return self._of_keypoints(row, known)
        if row.objects is None and self.detector is None:
            raise input_error("objects", "boxes, or a detector", "null")
        with_keypoints = sum(o.keypoints_2d is not None for o in row.objects or ())
        if with_keypoints:
            expected = "keypoints of all objects or of none"
            raise input_error("objects", expected, f"those of {with_keypoints} of {len(row.objects or ())}")
        pixels = self.pixels(row)
        boxes = row.boxes
        if row.objects is None and self.detector is not None:
            boxes = _detector(self.detector, self.threads, self.detector_score)(pixels)
        return self._pipeline(pixels, boxes, row.view, **known)

    def _of_keypoints(self, row: FrameRow, known: Mapping[str, Any]) -> PoseBatch:
        objects = row.objects or ()
        keypoints: Any = [o.keypoints_2d for o in objects]
        scores: Any = None
        if any(o.keypoint_scores is not None for o in objects):
            scores = [
                np.ones(len(points)) if o.keypoint_scores is None else o.keypoint_scores
                for o in objects
                if (points := o.keypoints_2d) is not None
            ]
        return estimate_poses(
            row.view,
            keypoints,
            [o.bbox for o in objects],
            [o.model for o in objects if o.model is not None],
            scores,
            self.options,
            self.threads,
            **known,
        )

    def pixels(self, row: FrameRow) -> ByteArray:
        """The picture of a row. Raises InputError, OSError."""
        if row.picture is None:
            raise input_error("image", "a file's name, or its bytes", "null")
        return as_rgb(Path(self.folder) / row.picture if isinstance(row.picture, str) else row.picture)

    @property
    def _pipeline(self) -> Pipeline:
        return _pipeline(
            pickle.dumps(
                (self.network, self.options, self.threads, self.vehicle_threshold, dict(self.classes))
            )
        )


def _is_gone(error: BaseException | None) -> bool:
    return isinstance(error, (FileNotFoundError, NotADirectoryError, IsADirectoryError))


@lru_cache(2)
def _pipeline(settings: bytes) -> Pipeline:
    """The one of this process."""
    network, options, threads, vehicle_threshold, classes = pickle.loads(settings)
    return Pipeline(
        network, options=options, threads=threads, vehicle_threshold=vehicle_threshold, classes=classes
    )


@lru_cache(2)
def _detector(path: str, threads: int, min_score: float | None) -> Detector:
    return Detector(path, threads, min_score=min_score)
