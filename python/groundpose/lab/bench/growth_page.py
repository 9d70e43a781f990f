"""The tables of docs/growth.md, made from what `groundpose.lab.bench.growth` measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from groundpose._writing import write_text
from groundpose.lab.bench import growth_images, stages
from groundpose.lab.bench.page import Blocks, filled
from groundpose.lab.evaluate import report

BENCH = Path("results/bench.json")
"""What one core of the machine can do, and what an object takes on paper."""
BOX_BYTES, MODEL_BYTES, POINT_BYTES = 32, 8, 16
"""What an object reads beside its keypoints: its box, its place in the list of models."""
MANY = 1_000
"""Objects below which pages of memory are larger than the result."""
_STAGES = (
    "P1P of the draws",
    "scores",
    "refinement default (with a second search where needed)",
    "covariance",
)
_BUSY = 0.5
"""Average number of processes that run, above which others are at work."""
Content = dict[str, Any]


def of_objects(content: Content) -> list[Content]:
    """V1's vehicles, a line for each number of objects."""
    rows = _vehicles(content)
    lines = []
    for one, two in ((_of(rows, n, 1), _of(rows, n, 2)) for n in sorted({row["objects"] for row in rows})):
        is_large = one["objects"] >= MANY
        lines.append(
            {
                "objects of a call": f"{one['objects']:,}",
                "one thread, µs per object": one["us per object"],
                "two threads": two["us per object"],
                "bytes per object held": round(one["bytes per object"]) if is_large else None,
                "with all fields": round(one["bytes per object, all fields"]) if is_large else None,
            }
        )
    return lines


def of_keypoints(content: Content) -> list[Content]:
    """The cube, a line for each number of keypoints."""
    rows = [row for row in content["rows"] if row["scene"] == "cube"]
    return [
        {
            "keypoints": row["keypoints"],
            "µs per object": row["us per object"],
            "bytes per object held": round(row["bytes per object"]),
        }
        for row in rows
    ]


def of_images(content: Content) -> list[Content]:
    """A folder, a line for each number of images; the last is extrapolated."""
    rows, lines = content["images"], []
    each = {threads: dict(growth_images.per_image(rows, threads)) for threads in (1, 2)}
    for count in sorted({row["images"] for row in rows}):
        one, two = (_image_row(rows, count, threads) for threads in (1, 2))
        lines.append(
            {
                "images": f"{count:,}",
                "one thread, s": one["s"],
                "ms per image more": each[1].get(count),
                "two threads, s": two["s"],
                "ms per image more, two": each[2].get(count),
                "MB at most": one["MB at most"],
                "MB at most, two": two["MB at most"],
            }
        )
    alone, both = (growth_images.extrapolated(rows, threads) for threads in (1, 2))
    lines.append(
        {
            "images": f"{growth_images.EXTRAPOLATED:,}, extrapolated",
            "one thread, s": alone,
            "ms per image more": None,
            "two threads, s": both,
            "ms per image more, two": None,
            "MB at most": None,
            "MB at most, two": None,
        }
    )
    return lines


def limits(content: Content, bench: Content) -> list[Content]:
    """What an object asks of memory and of arithmetic, against what a core can do; empty where that is not
    known."""
    cases = bench.get("cases", {})
    machine, instructions = cases.get("machine"), cases.get("instructions", {}).get("rows")
    if machine is None or instructions is None:
        return []
    most = max(_vehicles(content), key=lambda row: (row["objects"], -row["threads"]))
    us = most["us per object"]
    moved = most["keypoints"] * POINT_BYTES + BOX_BYTES + MODEL_BYTES + most["bytes per object"]
    found = [stage for stage in stages.of(instructions, "vehicle") if stage["stage"] in _STAGES]
    operations = sum(stage["operations"] for stage in found)
    return [
        _limit("memory, bytes read and held", moved, 1e-3 * moved / us, machine["memory GB/s"]),
        _limit("arithmetic, operations on paper", operations, 1e-3 * operations / us, machine["gflops"]),
        _limit(
            "the same, products and sums apart", operations, 1e-3 * operations / us, 0.5 * machine["gflops"]
        ),
    ]


def _limit(what: str, of_an_object: float, rate: float, most: float) -> Content:
    return {
        "one thread": what,
        "of an object": f"{of_an_object:,.0f}",
        "G/s": rate,
        "G/s a core can": most,
        "of that, %": 100 * rate / most,
    }


def single_precision(content: Content) -> str:
    """What keypoints in single precision hold."""
    row = next(row for row in content["rows"] if row["single precision"])
    held = round(row["bytes per object"])
    return (
        f"Where single precision holds the keypoints: {held} bytes per object ({row['objects']:,} objects)."
    )


def blocks(bench: Content) -> Blocks:
    """Tables of the page by the name in their marks."""
    return {
        "machine": _machine,
        "objects": lambda content: report.table(of_objects(content)),
        "single": single_precision,
        "keypoints": lambda content: report.table(of_keypoints(content)),
        "images": lambda content: report.table(of_images(content)),
        "limits": lambda content: report.table(limits(content, bench)),
    }


def write_page(page: Path, content: Content, bench: Content) -> None:
    """Make the tables of the page anew."""
    write_text(page, filled(page.read_text("utf-8"), content, blocks(bench)))


def _machine(content: Content) -> str:
    load = content["load at the beginning"]
    busy = " Others used it too: times are longer than its own." if load > _BUSY else ""
    return f"Measured on {content['machine']}, with a load of {load:g} at the beginning.{busy}"


def _vehicles(content: Content) -> list[Content]:
    """Rows of V1's vehicles as they are drawn."""
    return [row for row in content["rows"] if row["scene"] == "vehicle" and not row["single precision"]]


def _of(rows: list[Content], objects: int, threads: int) -> Content:
    return next(row for row in rows if (row["objects"], row["threads"]) == (objects, threads))


def _image_row(rows: list[Content], images: int, threads: int) -> Content:
    return next(row for row in rows if (row["images"], row["threads"]) == (images, threads))
