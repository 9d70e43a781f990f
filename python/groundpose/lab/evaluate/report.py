"""Stored results (JSON) and the page generated from them (Markdown)."""

from __future__ import annotations

import json
import math
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from groundpose._writing import write_text

PACKAGES = ("groundpose", "numpy", "poselib", "opencv-python-headless", "pycolmap")
SOLVER_JSON, REAL_JSON = Path("results/solver.json"), Path("results/real.json")
PAGE, README = Path("docs/results.md"), Path("README.md")
MARKS = ("<!-- measured: begin -->", "<!-- measured: end -->")


def versions() -> dict[str, str]:
    """Python and the packages a number depends on."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def machine() -> str:
    """The processor, for tables of times."""
    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = [line for line in cpuinfo.read_text(encoding="utf-8").splitlines() if "model name" in line]
        name = models[0].split(":", 1)[1].strip() if models else name
    return f"{name}, {os.cpu_count()} logical cores"


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Readable, stable JSON: numbers to 6 digits and a line for each innermost object or list, so that a
    rerun shows only what changed.

    The path of the real data, if GROUNDPOSE_DATA names it, is written as `$GROUNDPOSE_DATA`: it is another
    one on every machine.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, _text(_portable(content)) + "\n")


def read_json(path: Path) -> dict[str, Any]:
    """What `write_json` wrote; empty when there is nothing yet."""
    if not path.exists():
        return {}
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def _text(value: Any, indent: str = "\n") -> str:
    """JSON whose lines are the members of what has members that have members."""
    members = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    if not any(isinstance(member, (dict, list)) for member in members):
        return json.dumps(value, ensure_ascii=False)
    deeper = indent + " "
    if isinstance(value, dict):
        lines = [f"{json.dumps(key, ensure_ascii=False)}: {_text(value[key], deeper)}" for key in value]
        return f"{{{deeper}{f',{deeper}'.join(lines)}{indent}}}"
    return f"[{deeper}{f',{deeper}'.join(_text(member, deeper) for member in value)}{indent}]"


def _portable(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _portable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_portable(item) for item in value]
    if isinstance(value, str) and os.sep in (data := os.environ.get("GROUNDPOSE_DATA", "")):
        return value.replace(data, "$GROUNDPOSE_DATA")
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value


def table(lines: list[dict[str, Any]]) -> str:
    """A Markdown table; columns in the order in which keys first appear."""
    columns = list(dict.fromkeys(key for line in lines for key in line))
    rows = [[_cell(line.get(column)) for column in columns] for line in lines]
    head = [f"| {' | '.join(columns)} |", "|" + " --- |" * len(columns)]
    return "\n".join(head + [f"| {' | '.join(row)} |" for row in rows])


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "**no**"
    if isinstance(value, float):
        return f"{value:.3g}" if 0.001 <= abs(value) < 1000 else f"{value:.4g}"
    if isinstance(value, list):
        return " to ".join(_cell(item) for item in value)
    return str(value)


def render(root: Path) -> str:
    """The whole page from the stored results under `root`."""
    solver, real = read_json(root / SOLVER_JSON), read_json(root / REAL_JSON)
    parts = ["# Results", "Generated from `results/*.json`; the command above each table makes it again."]
    if solver:
        parts += _solver(solver)
    for path in sorted((root / SOLVER_JSON).parent.glob("solver_seed*.json")):
        other = read_json(path)
        parts += ["## The same with another seed", *_summary(other)]
    if real:
        parts += _real(real)
    return "\n\n".join(parts) + "\n"


def write_page(root: Path) -> Path:
    """Render and store the page, and the table of the README if there is one."""
    page = root / PAGE
    page.parent.mkdir(parents=True, exist_ok=True)
    write_text(page, render(root))
    readme, solver = root / README, read_json(root / SOLVER_JSON)
    if readme.exists() and solver:
        write_text(readme, with_headline(readme.read_text(encoding="utf-8"), solver))
    return page


def headline(solver: dict[str, Any]) -> str:
    """The README's table: accuracy and time on vehicle-like scenes, every method of the time row.

    Empty as long as one of the two rows was not measured.
    """
    rows = {row["id"]: row for row in solver["rows"]}
    if not {"v1", "time"} <= set(rows):
        return ""
    accuracy = {line["method"]: line for line in rows["v1"]["details"]}
    timed = [line for line in rows["time"]["times"] if line["setting"] == "V1"]
    lines = [
        {
            "method": f"**{line['method']}**" if line["ratio"] == 1.0 else line["method"],
            "mean rotation error, deg": accuracy[line["method"]]["mean e_r deg"],
            "failures, %": accuracy[line["method"]]["failures %"],
            "time per object, µs": line["us per object"],
            "time / ours": line["ratio"],
        }
        for line in timed
        if line["method"] in accuracy
    ]
    return table(lines)


def with_headline(readme: str, solver: dict[str, Any]) -> str:
    """The README with the table between its two marks made anew."""
    return between(readme, MARKS, f"\n{headline(solver)}\n")


def between(text: str, marks: tuple[str, str], new: str) -> str:
    """The text with `new` in place of what stands between two marks."""
    begin, end = marks
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(end)
    return f"{before}{begin}{new}{end}{after}"


def _summary(content: dict[str, Any]) -> list[str]:
    lines, short = [], []
    for row in content["rows"]:
        if row["missing"]:
            lines.append({"measure": row["measure"], "what": f"not measured: {row['missing']}"})
        for check in row["checks"]:
            value = None if check["value"] is None else f"{check['value']:.4g}{check['unit']}"
            lines.append(
                {
                    "measure": row["measure"],
                    "what": check["what"],
                    "value": value,
                    "target": check["target"],
                    "met": check["met"],
                }
            )
            if check["shortfall"]:
                short.append(f"- {row['measure']}: {check['shortfall']}")
    verdict = "Not met:\n\n" + "\n".join(short) if short else "Every target that was measured is met."
    return [f"`{content['command']}`", _made_on(content), table(lines), verdict]


def _solver(content: dict[str, Any]) -> list[str]:
    parts = ["## What the solver must show", *_summary(content)]
    for row in content["rows"]:
        for lines in (row["details"], row["times"]):
            if lines:
                parts += [f"### {row['measure']}", f"`{row['command']}`", table(lines)]
        if row["note"]:
            parts.append(row["note"])
    return parts


def _real(content: dict[str, Any]) -> list[str]:
    parts = ["## Real keypoints", f"`{content['command']}`", _made_on(content)]
    for group in content["sets"]:
        parts += [f"### {group['name']}, {group['objects']} cars", group["note"], table(group["methods"])]
    return parts


def _made_on(content: dict[str, Any]) -> str:
    packages = ", ".join(f"{name} {number}" for name, number in content["versions"].items())
    libraries = "; ".join(f"{name}: {text}" for name, text in content.get("libraries", {}).items())
    return f"{packages}. Times: {content['machine']}, one thread unless said otherwise. {libraries}".rstrip()
