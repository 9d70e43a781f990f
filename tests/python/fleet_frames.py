"""Tables of frames with keypoints of known vehicles, for the tests of fleets."""

from pathlib import Path
from typing import Any

from conftest import make_batch
from groundpose.formats.arrow_frames import frames_table
from groundpose.formats.frames import Frame, FrameObject
from groundpose.vehicles import shape_model


def keypoint_frame(number: int, objects: int, seed: int | None = None) -> Frame:
    """A frame of so many cars."""
    model = shape_model("car")
    batch = make_batch(objects, seed=number if seed is None else seed, model=model)
    rows = tuple(
        FrameObject(k, "car", points, None, box.tolist(), None)
        for k, (points, box) in enumerate(zip(batch.keypoints_2d, batch.bboxes, strict=True))
    )
    return Frame(f"{number:06d}", "test", batch.view, None, rows, (model,) * objects, 0.1 * number)


def write_frames(folder: Path, files: int, groups: int, frames: int, objects: int) -> None:
    """So many files in partitions by day, each of so many row groups of frames."""
    from pyarrow import parquet

    for file in range(files):
        first = file * groups * frames
        made = [keypoint_frame(first + k, objects) for k in range(groups * frames)]
        place = folder / f"day={file % 2}"
        place.mkdir(parents=True, exist_ok=True)
        parquet.write_table(frames_table(made), place / f"{file:03d}.parquet", row_group_size=frames)


def all_rows(folder: Path) -> dict[str, Any]:
    """The tables of the parts of an output, by name."""
    from pyarrow import parquet

    names = sorted(p for p in folder.rglob("*.parquet"))
    return {str(p.relative_to(folder)): parquet.ParquetFile(p).read() for p in names}


def same_rows(a: Any, b: Any) -> bool:
    """Bit for bit, NaN like NaN."""
    plain = [table.combine_chunks().replace_schema_metadata(None) for table in (a, b)]
    return repr(plain[0].to_pylist()) == repr(plain[1].to_pylist())
