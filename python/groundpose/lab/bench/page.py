"""The numbers of docs/performance.md: `groundpose evaluate pages` after `groundpose bench`.

Text is written by hand and holds no measured number; tables stand between marks and are made from
results/bench.json and, of the way from pictures to poses, results/image_path.json.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from groundpose._core import InputError
from groundpose._writing import write_text
from groundpose.lab.bench import stages, targets
from groundpose.lab.bench.targets import line
from groundpose.lab.contenders.registry import DEFAULT, TO_BEAT
from groundpose.lab.evaluate import image_path, report

RESULTS, PAGE = Path("results/bench.json"), Path("docs/performance.md")
Lines = list[dict[str, Any]]
Blocks = dict[str, Callable[[dict[str, Any]], str]]
_MARK = "<!-- measured {}: {} -->"


def made_on(content: dict[str, Any]) -> str:
    """Machine and versions."""
    packages = ", ".join(f"{name} {number}" for name, number in content["versions"].items())
    libraries = "; ".join(f"{name}: {text}" for name, text in content["libraries"].items())
    toolchain = content["cases"].get("instructions", {}).get("toolchain", "no instructions counted")
    return f"{content['machine']}. {packages}, {toolchain}. {libraries}."


def vehicles(content: dict[str, Any]) -> str:
    """Everybody on V1."""
    case = content["cases"]["vehicles"]
    lines = [
        {
            "method": f"**{each['method']}**" if each["method"] == DEFAULT else each["method"],
            "time per object, µs": each["us"],
            "middle half": each["us quartiles"],
            "time / ours": each.get("times ours", 1.0),
            "middle half of turns": each.get("times ours, quartiles"),
            "mean e_r, deg": each["mean e_r deg"],
            "failures, %": each["failures %"],
            "objects checked": each["objects"],
        }
        for each in case["lines"]
    ]
    left_out = [f"{name}: {reason}." for name, reason in case["left out"].items()]
    return "\n\n".join([report.table(lines), *left_out])


def curves(content: dict[str, Any]) -> str:
    """Ours and the one to beat, every case of the curves."""
    lines = []
    for name, case in content["cases"].items():
        methods = [each["method"] for each in case.get("lines", ())]
        if case.get("group") not in ("keypoints", "outliers", "shape", "batch") or TO_BEAT not in methods:
            continue
        mine, theirs = case["lines"][0], line(content["cases"], name, TO_BEAT)
        lines.append(
            {
                "case": case["label"],
                "ours, µs": mine["us"],
                f"{TO_BEAT}, µs": theirs["us"],
                "times ours": theirs["times ours"],
                "95 % of the median": theirs["times ours, 95 %"],
                "ours, mean e_r deg": mine["mean e_r deg"],
                "theirs": theirs["mean e_r deg"],
                "ours, failures %": mine["failures %"],
                "their failures %": theirs["failures %"],
            }
        )
    return report.table(lines)


def core(content: dict[str, Any]) -> str:
    """What the core can do."""
    machine = content["cases"]["machine"]
    return report.table([{name: machine[name] for name in machine if name not in ("group", "label")}])


def roofline(content: dict[str, Any]) -> str:
    """Stages of every setting against what the core can do."""
    found = content["cases"].get("instructions", {})
    if "rows" not in found:
        return f"Not measured: {found.get('missing', 'run `groundpose bench --instructions`')}."
    machine, parts = content["cases"]["machine"], []
    for setting in stages.MODES:
        lines = [_stage(each, machine) for each in stages.of(found["rows"], setting)]
        if lines:
            parts += [f"### Stages: {setting}", report.table(lines)]
    return "\n\n".join(parts)


def _stage(stage: dict[str, Any], machine: dict[str, Any]) -> dict[str, Any]:
    """Operations a second, and the least of what arithmetic (multiplied and added apart) and cache allow."""
    rate = None if stage["operations"] is None else 1e-3 * stage["operations"] / stage["us"]
    bound = 0.5 * machine["gflops"]
    if stage["operations a byte"] is not None:
        bound = min(bound, stage["operations a byte"] * machine["cache GB/s"])
    return {
        "stage": stage["stage"],
        "µs per object": stage["us"],
        "instructions": f"{stage['instructions']:,.0f}",
        "operations on paper": None if rate is None else f"{stage['operations']:,.0f}",
        "Gop/s": rate,
        "on paper at most": None if rate is None else bound,
        "of that, %": None if rate is None else 100 * rate / bound,
        "instructions an operation": None if rate is None else stage["instructions"] / stage["operations"],
    }


def traffic(content: dict[str, Any]) -> str:
    """Bytes per object at the measured pace."""
    cases = content["cases"]
    size, us = cases["overhead"]["bytes per object"], line(cases, "batch/10000")["us"]
    rate = 1e-3 * (size["in"] + size["out"]) / us
    lines = [
        {
            "bytes in": size["in"],
            "bytes out": size["out"],
            "GB/s at 10,000 objects": rate,
            "of memory bandwidth, %": 100 * rate / cases["machine"]["memory GB/s"],
        }
    ]
    return report.table(lines)


def arm(content: dict[str, Any]) -> str:
    """The estimate for an automotive Arm core."""
    lines = []
    for setting, work in ARM:
        found = stages.whole(content["cases"].get("instructions", {}).get("rows", []), setting, work)
        if found is not None:
            low, high, middle = stages.arm_us(found["instructions"])
            lines.append(
                {
                    "object": f"{setting}, {work}",
                    "instructions here": f"{found['instructions']:,.0f}",
                    "here, µs": found["us"],
                    "Cortex-A78AE at 2 GHz, µs": [low, high],
                    "middle": middle,
                }
            )
    return report.table(lines) if lines else "Not measured: run `groundpose bench --instructions`."


ARM = (
    ("vehicle", "search + hre"),
    ("vehicle", "search + default"),
    ("vehicle M = 5", "search + hre"),
    ("vehicle M = 5", "search + default"),
    ("cube 50 %", "search + default"),
)
BLOCKS: Blocks = {
    "on": made_on,
    "targets": lambda content: report.table(targets.table(content["cases"])),
    "vehicles": vehicles,
    "curves": curves,
    "core": core,
    "roofline": roofline,
    "traffic": traffic,
    "arm": arm,
}
"""Tables of the page by the name in their marks."""
IMAGE_BLOCKS: Blocks = {
    "image": image_path.vehicles_table,
    "folder": image_path.folder_table,
    "networks": image_path.networks_table,
    "picture": image_path.picture_table,
    "start": image_path.start_table,
}


def filled(page: str, content: dict[str, Any], blocks: Blocks = BLOCKS) -> str:
    """The page with its tables made anew. InputError when a table has no marks in it."""
    for name, make in blocks.items():
        begin, end = (_MARK.format(name, which) for which in ("begin", "end"))
        if begin not in page or end not in page:
            raise InputError(f"page: expected {begin} and {end}, got neither or one")
        try:
            made = make(content)
        except KeyError as missing:
            made = f"Not measured: {missing.args[0]}."
        pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
        page = pattern.sub(lambda _, text=f"{begin}\n{made}\n{end}": text, page)  # type: ignore[misc]
    return page


def write_page(root: Path) -> Path | None:
    """Make the tables of the page anew from the stored runs; None when there is none."""
    page, found = root / PAGE, False
    for stored, blocks in ((RESULTS, BLOCKS), (image_path.OUT, IMAGE_BLOCKS)):
        content = report.read_json(root / stored)
        if content:
            write_text(page, filled(page.read_text("utf-8"), content, blocks))
            found = True
    return page if found else None
