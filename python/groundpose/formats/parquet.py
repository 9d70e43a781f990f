"""Poses as an Apache Parquet file, with the package pyarrow (extra `parquet`)."""

from __future__ import annotations

import importlib
import itertools
import json
from os import PathLike
from pathlib import Path
from typing import Any

from groundpose._checks import input_error
from groundpose._writing import whole_path
from groundpose.formats.columns import COLUMNS, TEXTS

_ROWS = 4096  # in memory at once


def package() -> Any:
    """The package `pyarrow`. Raises InputError when it is not installed."""
    try:
        return importlib.import_module("pyarrow")
    except ModuleNotFoundError as error:
        wanted = "pyarrow (pip install 'groundpose[parquet]')"
        raise input_error("parquet", wanted, f"no package {error.name}") from None


def convert(rows: str | PathLike[str], path: str | PathLike[str]) -> None:
    """Write the rows of `groundpose.formats.columns`, a JSON list on each line of a file, as a Parquet file.

    Raises:
        InputError: pyarrow is not installed. OSError: naming `path`.
    """
    arrow = package()
    parquet = importlib.import_module("pyarrow.parquet")
    types = [arrow.string()] * TEXTS + [arrow.float64()] * (len(COLUMNS) - TEXTS)
    schema = arrow.schema(list(zip(COLUMNS, types, strict=True)))
    with (
        whole_path(path) as part,
        Path(rows).open(encoding="utf-8") as lines,
        parquet.ParquetWriter(part, schema, compression="zstd") as writer,
    ):
        while some := [json.loads(line) for line in itertools.islice(lines, _ROWS)]:
            values = zip(zip(*some, strict=True), types, strict=True)
            arrays = [arrow.array(column, type=kind) for column, kind in values]
            writer.write_table(arrow.Table.from_arrays(arrays, schema=schema))
