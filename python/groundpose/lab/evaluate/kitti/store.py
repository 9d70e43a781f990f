"""Finished frames on disk, one a line, so that a run goes on where it was stopped."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from groundpose._checks import input_error
from groundpose.formats.skips import Skips
from groundpose.lab.evaluate.kitti.average_precision import Hits
from groundpose.lab.evaluate.kitti.frame import FrameResult

DIGITS = 6


@dataclass
class Line:
    """A frame that is finished; `result` is None when it was left out, `skipped` says why and what else
    was."""

    id: str
    result: FrameResult | None
    skipped: Skips = field(default_factory=Skips)

    def text(self) -> str:
        """One line of JSON."""
        record: dict[str, Any] = {"id": self.id, "skipped": self.skipped.record()}
        if self.result is not None:
            r = self.result
            record |= {
                "labels": [_rounded(row) for row in r.labels],
                "missed": r.missed,
                "boxes": r.boxes,
                "errors": {name: [_rounded(row) for row in rows] for name, rows in r.errors.items()},
                "hits": {
                    name: {class_name: [h.objects, h.detections] for class_name, h in by_class.items()}
                    for name, by_class in r.hits.items()
                },
                "seconds": r.seconds,
                "keypoint_seconds": r.keypoint_seconds,
            }
        return json.dumps(record, separators=(",", ":"), allow_nan=False) + "\n"

    @classmethod
    def parse(cls, text: str) -> Line:
        """The inverse of `text`."""
        raw = json.loads(text)
        skipped = Skips.from_record(raw["skipped"])
        if "labels" not in raw:
            return cls(raw["id"], None, skipped)
        hits = {
            name: {class_name: Hits(h[0], [tuple(d) for d in h[1]]) for class_name, h in by_class.items()}
            for name, by_class in raw["hits"].items()
        }
        errors = {name: [_with_nan(row) for row in rows] for name, rows in raw["errors"].items()}
        own = {key: raw[key] for key in ("labels", "missed", "seconds", "keypoint_seconds", "boxes")}
        return cls(raw["id"], FrameResult(**own, errors=errors, hits=hits), skipped)


def _rounded(row: Iterable[float]) -> list[float | None]:
    return [float(f"{x:.{DIGITS}g}") if math.isfinite(x) else None for x in row]


def _with_nan(row: Iterable[float | None]) -> list[float]:
    return [math.nan if x is None else x for x in row]


@dataclass
class Store:
    """The file: a line of settings, then frames in the order in which they were finished."""

    path: Path
    settings: dict[str, Any]
    done: set[str] = field(default_factory=set)
    _stream: IO[str] | None = None

    @classmethod
    def open(cls, path: Path, settings: dict[str, Any], fresh: bool = False) -> Store:
        """Go on with a file, or begin one. A last line that a stop cut off is taken away.

        Raises InputError for a file made with other settings.
        """
        store = cls(path, settings)
        path.parent.mkdir(parents=True, exist_ok=True)
        if fresh or not path.exists() or path.stat().st_size == 0:
            store._stream = path.open("w", encoding="utf-8")
            store._write(json.dumps({"settings": settings}) + "\n")
            return store
        whole = 0
        with path.open("rb") as stream:
            for number, raw in enumerate(stream):
                if not raw.endswith(b"\n"):
                    break
                record = store._record(raw, number)
                if number == 0 and record.get("settings") != json.loads(json.dumps(settings)):
                    raise input_error(
                        str(path), "frames of a run with the same settings", "other settings; --fresh"
                    )
                if number:
                    store.done.add(record["id"])
                whole += len(raw)
        with path.open("r+b") as stream:
            stream.truncate(whole)
        store._stream = path.open("a", encoding="utf-8")
        if whole == 0:
            store._write(json.dumps({"settings": settings}) + "\n")
        return store

    def _record(self, raw: bytes, number: int) -> dict[str, Any]:
        try:
            record = json.loads(raw)
            if isinstance(record, dict) and ("settings" if number == 0 else "id") in record:
                return record
        except ValueError:
            pass
        raise input_error(f"{self.path}:{number + 1}", "frames of an evaluation", "something else")

    def add(self, line: Line) -> None:
        """One frame more; on disk when this returns."""
        self._write(line.text())
        self.done.add(line.id)

    def _write(self, text: str) -> None:
        assert self._stream is not None
        self._stream.write(text)
        self._stream.flush()

    def close(self) -> None:
        """No more frames."""
        if self._stream is not None:
            self._stream.close()

    def lines(self) -> Iterator[Line]:
        """The frames, in the order of the file."""
        with self.path.open(encoding="utf-8") as stream:
            next(stream, None)
            for text in stream:
                yield Line.parse(text)
