"""Work in parts: a row group of an input file, and the output file that is named by it."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from groundpose._checks import input_error
from groundpose._core import build_info
from groundpose._writing import whole_path, write_text
from groundpose.fleet.worker import FRAMES_AT_ONCE, EstimateFrames
from groundpose.formats.arrow_poses import BAD_FRAME, NO_OBJECTS
from groundpose.formats.arrow_schema import POSES, schema_of
from groundpose.formats.parquet import package

MANIFEST = "_groundpose.json"
"""In the folder of the output: what decides its rows."""
PART_KEY = b"groundpose.part"
"""In the metadata of an output file: which part of which input it is."""
_OURS = ".groundpose"
"""How locks and unfinished files begin."""
_ROWS = 4096
"""Of a row group that is written."""


@dataclass(frozen=True)
class Part:
    """A row group of an input file.

    Attributes:
        source: the file. row_group: its number. frames: how many. size: in bytes. target: the file to write.
        name: of the source in the folder of the input. stamp: its size and time.
    """

    source: Path
    row_group: int
    frames: int
    size: int
    target: Path
    name: str
    stamp: str

    @property
    def said(self) -> bytes:
        """What the output says of it."""
        names = ("name", "row_group", "frames", "stamp")
        return json.dumps({name: getattr(self, name) for name in names}).encode()

    def is_done(self) -> bool:
        """Whether its output is there, and of this input."""
        try:
            metadata = _parquet().read_schema(self.target).metadata or {}
        except (OSError, package().ArrowException):
            return False
        return bool(metadata.get(PART_KEY) == self.said)


def _parquet() -> Any:
    package()
    return import_module("pyarrow.parquet")


def files_of(source: Path) -> list[Path]:
    """The Parquet files of a folder and the folders in it, in order, or a file alone.

    Raises OSError, InputError.
    """
    if not source.is_dir():
        source.open("rb").close()  # OSError in Python's own words
        return [source]
    found = sorted(p for p in source.rglob("*.parquet") if not _is_hidden(p.relative_to(source)))
    if not found:
        raise input_error(str(source), "a folder with Parquet files", "none in it")
    return found


def _is_hidden(path: Path) -> bool:
    return any(step.startswith((".", "_")) for step in path.parts)


def parts_of(source: Path, out: Path) -> list[Part]:
    """The parts of the input in order. Raises OSError, InputError: a file that is no Parquet file."""
    folder = source if source.is_dir() else source.parent
    return [part for path in files_of(source) for part in _parts(path, path.relative_to(folder), out)]


def _parts(path: Path, name: Path, out: Path) -> Iterator[Part]:
    try:
        metadata = _parquet().read_metadata(path)
    except package().ArrowException as error:
        raise input_error(str(path), "a Parquet file", error) from None
    found = path.stat()
    for k in range(metadata.num_row_groups):
        group = metadata.row_group(k)
        size = sum(group.column(c).total_compressed_size for c in range(group.num_columns))
        target = out / name.parent / f"{name.stem}.{k:05d}.parquet"
        stamp = f"{found.st_size} {found.st_mtime_ns}"
        yield Part(path, k, group.num_rows, size, target, name.as_posix(), stamp)


def claim(out: Path, source: Path, estimate: EstimateFrames) -> None:
    """Make the folder of the output that of these settings.

    Raises:
        InputError: it holds the input, lies in it, holds something else or poses of other settings. OSError.
    """
    inside = os.path.realpath(source), os.path.realpath(out)
    if source.is_dir() and os.path.commonpath(inside) in inside:
        raise input_error(str(out), f"a folder apart from {source}", "one in it or around it")
    settings = {"groundpose": build_info()["version"], "input": source.name, **estimate.settings()}
    manifest = out / MANIFEST
    if manifest.exists():
        stored = _stored(manifest)
        for name in (n for n in settings if stored.get(n) != settings[n]):
            expected = f"poses with {name} {settings[name]}"
            raise input_error(str(out), expected, f"those of another run, with {stored.get(name)}")
        return
    if out.is_dir() and any(not entry.name.startswith(_OURS) for entry in out.iterdir()):
        raise input_error(str(out), "a new or empty folder, or one of such a run", "one with other files")
    out.mkdir(parents=True, exist_ok=True)
    write_text(manifest, json.dumps(settings, indent=1))


def _stored(manifest: Path) -> dict[str, Any]:
    try:
        stored = json.loads(manifest.read_text(encoding="utf-8"))
    except ValueError:
        stored = None
    if not isinstance(stored, dict):
        raise input_error(str(manifest), "what `groundpose fleet` writes", "something else")
    return stored


def estimate_part(estimate: EstimateFrames, part: Part) -> None:
    """Write the output of a part, whole or not at all; memory holds a few thousand rows.

    Raises InputError, OSError.
    """
    arrow, parquet = package(), _parquet()
    schema = schema_of(POSES)
    schema = schema.with_metadata({**schema.metadata, PART_KEY: part.said})
    part.target.parent.mkdir(parents=True, exist_ok=True)
    with (
        whole_path(part.target) as place,
        parquet.ParquetFile(part.source, pre_buffer=False) as frames,
        parquet.ParquetWriter(place, schema, compression="zstd") as writer,
    ):
        waiting, rows = [], 0
        for batch in frames.iter_batches(FRAMES_AT_ONCE, [part.row_group]):
            given = arrow.Table.from_batches([batch]).replace_schema_metadata(frames.schema_arrow.metadata)
            waiting.append(estimate(given).replace_schema_metadata(schema.metadata))
            rows += waiting[-1].num_rows
            if rows >= _ROWS:
                writer.write_table(arrow.concat_tables(waiting))
                waiting, rows = [], 0
        if waiting:
            writer.write_table(arrow.concat_tables(waiting))


def counts_of(parts: list[Part]) -> Counter[str]:
    """How many "frames", "objects", "poses" and bad frames ("bad") the outputs hold that are there."""
    counts: Counter[str] = Counter()
    for part in parts:
        if part.is_done():
            counts["frames"] += part.frames
            column = _parquet().read_table(part.target, columns=["status"]).column("status")
            found = {row["values"]: row["counts"] for row in column.value_counts().to_pylist()}
            counts["bad"] += found.pop(BAD_FRAME, 0)
            found.pop(NO_OBJECTS, 0)
            counts["objects"] += sum(found.values())
            counts["poses"] += found.get("ok", 0)
    return counts
