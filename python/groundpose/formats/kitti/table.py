"""KITTI vehicles as a table (.npz): the rows of many frames without images, as `KittiSet` gives them.

Arrays: `rows` (N, C) with the columns named in `cols` (split, seq, frame, track, cls, trunc, occ, alpha,
x1, y1, x2, y2, h, w, l, x, y, z, ry, det_score, det_x1 ... det_y2, imgW, imgH), `classes`, `P2_by_seq` (S,
3, 4). Every detection belongs to a label there, so that its average precision knows no wrong ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import FloatArray, describe, finite, input_error
from groundpose._core import InputError
from groundpose._npz import read_arrays
from groundpose.formats.kitti.dataset import KittiFrame, read_split
from groundpose.formats.kitti.labels import KittiLabel
from groundpose.formats.skips import Skips

_ARRAYS = {"rows": ("fiu", 2), "cols": ("U", 1), "classes": ("U", 1), "P2_by_seq": ("fiu", 3)}
"""Kinds of their dtypes, and their dimensions."""


@dataclass(frozen=True)
class KittiTable:
    """Frames are called `SS/FFFFFF`, after sequence and frame."""

    root: Path
    with_detections: bool = False

    @cached_property
    def _content(self) -> dict[str, Any]:
        content = read_arrays(self.root, f"arrays {', '.join(_ARRAYS)}")
        if missing := set(_ARRAYS) - set(content):
            raise input_error(str(self.root), f"arrays {', '.join(_ARRAYS)}", f"no {min(missing)}")
        for name, (kinds, dimensions) in _ARRAYS.items():
            if content[name].dtype.kind not in kinds or content[name].ndim != dimensions:
                expected = f"an array of {dimensions} dimensions"
                raise input_error(f"{self.root}: {name}", expected, describe(content[name]))
        return {**content, "cols": content["cols"].tolist(), "classes": content["classes"].tolist()}

    @cached_property
    def _frames(self) -> dict[str, list[int]]:
        """Rows of each frame."""
        numbers = (finite(f"{self.root}: {name}", self._column(name)) for name in ("seq", "frame"))
        seq, frame = (column.astype(int).tolist() for column in numbers)
        found: dict[str, list[int]] = {}
        for row, (s, f) in enumerate(zip(seq, frame, strict=True)):
            found.setdefault(f"{s:02d}/{f:06d}", []).append(row)
        return found

    def _column(self, name: str) -> FloatArray:
        columns: list[str] = self._content["cols"]
        if name not in columns:
            raise input_error(str(self.root), f"a column {name}", ", ".join(columns))
        return np.asarray(self._content["rows"][:, columns.index(name)])

    def ids(self, split: Path | None = None, skipped: Skips | None = None) -> list[str]:
        """Names of the frames: those of the sequences in an ImageSets file, or all."""
        if split is None:
            return sorted(self._frames)
        wanted = read_split(split, Skips() if skipped is None else skipped)
        return sorted(name for name in self._frames if name.partition("/")[0] in wanted)

    def read(self, frame_id: str, skipped: Skips) -> KittiFrame | None:
        """One frame."""
        rows = self._frames.get(frame_id)
        if rows is None:
            skipped.add("frame that is not in the table", frame_id)
            return None
        try:
            return self._frame(frame_id, rows)
        except InputError:
            raise
        except (IndexError, ValueError, OverflowError) as error:  # a class or a sequence that is not there
            skipped.add("frame of other arrays", f"{self.root}: {frame_id}: {error}")
            return None

    def _frame(self, frame_id: str, rows: list[int]) -> KittiFrame:
        projection = self._content["P2_by_seq"][int(frame_id.partition("/")[0])]
        size = (int(self._column("imgW")[rows[0]]), int(self._column("imgH")[rows[0]]))
        labels = [self._label(row) for row in rows]
        detections = [self._detection(row) for row in rows if np.isfinite(self._column("det_score")[row])]
        return KittiFrame(
            frame_id, projection, size, None, labels, detections if self.with_detections else None
        )

    def vehicles(self, frame_id: str) -> list[int]:
        """Numbers of a frame's vehicles, in the order of its labels; the same in all frames of a sequence."""
        track = self._column("track")
        return [int(track[row]) for row in self._frames[frame_id]]

    def detections(self, frame_id: str) -> list[KittiLabel | None]:
        """The detection of each label of a frame; None: it was not found."""
        found = self._column("det_score")
        return [self._detection(row) if np.isfinite(found[row]) else None for row in self._frames[frame_id]]

    def _values(self, row: int, names: str) -> list[float]:
        return [float(self._column(name)[row]) for name in names.split()]

    def _label(self, row: int) -> KittiLabel:
        kind, truncated, occluded, alpha = self._values(row, "cls trunc occ alpha")
        left, top, right, bottom = self._values(row, "x1 y1 x2 y2")
        height, width, length, x, y, z, angle = self._values(row, "h w l x y z ry")
        box, size = (left, top, right, bottom), (height, width, length)
        return KittiLabel(
            self._content["classes"][int(kind)], truncated, int(occluded), alpha, box, *size, (x, y, z), angle
        )

    def _detection(self, row: int) -> KittiLabel:
        kind, score, left, top, right, bottom = self._values(row, "cls det_score det_x1 det_y1 det_x2 det_y2")
        box, nowhere = (left, top, right, bottom), (-1000.0, -1000.0, -1000.0)
        kind_name = self._content["classes"][int(kind)]
        return KittiLabel(kind_name, -1.0, -1, -10.0, box, -1.0, -1.0, -1.0, nowhere, -10.0, score)
