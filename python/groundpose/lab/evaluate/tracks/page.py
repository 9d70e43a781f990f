"""docs/tracks.md from results/tracks.json: the tables between its marks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from groundpose._writing import write_text
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.tracks.measure import ALONE, FILTER, JSON, SMOOTHED, SORT

PAGE = Path("docs/tracks.md")
MARKS = ("<!-- tracks: begin -->", "<!-- tracks: end -->")
_SHOWN = (
    *("contender", "yaw above 30 deg %", "median yaw error deg", "median distance error %"),
    *("median size error %", "median speed error km/h", "mean speed error km/h"),
    *("median speed error of a passage km/h", "mean speed error of a passage km/h"),
    *("region of place holds %", "interval of heading holds %", "interval of speed holds %"),
    *("identity switches per 100 vehicles", "MOTA %", "HOTA %"),
)


def write_stored(root: Path) -> Path | None:
    """The page from the stored results under `root`, if there are any."""
    stored = root / JSON
    return write_page(report.read_json(stored), root / PAGE) if stored.exists() else None


def write_page(content: dict[str, Any], path: Path) -> Path:
    """The tables between the marks of the page."""
    parts = [""]
    for name, found in content["sets"].items():
        shown = [{key: row.get(key, "") for key in _SHOWN} for row in found["rows"]]
        used = [key for key in _SHOWN if any(row[key] != "" for row in shown)]
        parts += [f"### {name}: {found['frames']} frames"]
        parts += [report.table([{key: row[key] for key in used} for row in shown])]
    parts += ["### Targets", report.table(targets(content)), ""]
    new = "\n\n".join(parts)
    write_text(path, report.between(path.read_text(encoding="utf-8"), MARKS, new))
    return path


def targets(content: dict[str, Any]) -> list[dict[str, Any]]:
    """What was to be shown, and whether it was."""
    rows: list[dict[str, Any]] = []
    for name, found in content["sets"].items():
        by = {row["contender"]: row for row in found["rows"]}
        alone, now, later, boxes = by[ALONE], by[FILTER], by[SMOOTHED], by[SORT]
        kitti = name.startswith("KITTI")
        low, high = (90.0, 98.0) if kitti else (93.0, 97.0)
        if kitti:
            for measure, row, factor in (
                ("yaw above 30 deg %", now, 0.5),
                ("yaw above 30 deg %", later, 0.25),
                ("median distance error %", later, 2.0 / 3.0),
                ("median size error %", later, 0.5),
            ):
                rows.append(
                    _at_most(name, f"{measure}, {row['contender']}", row[measure], factor * alone[measure])
                )
        key = "identity switches per 100 vehicles"
        rows.append(_at_most(name, key, later[key], 0.5 * boxes[key]))
        for measure in (
            "region of place holds %",
            "interval of heading holds %",
            "interval of speed holds %",
        ):
            if measure in later:
                value = later[measure]
                rows.append(_row(name, measure, value, f"{low:g} to {high:g}", low <= value <= high))
        for measure, most in (("median speed error", 0.6), ("mean speed error", 1.0)):
            for key in (f"{measure} km/h", f"{measure} of a passage km/h"):
                if not kitti and key in later:
                    rows.append(_at_most(name, key, later[key], most))
    time = content["time"]
    rows.append(_at_most("time", "update, us per object and frame", time["update us"], 10.0))
    rows.append(_at_most("time", "an hour of 10 Hz poses of 20 vehicles, s", time["hour s"], 10.0))
    rows.append(_at_most("time", "its memory beyond that of twelve minutes, MB", time["hour MB more"], 1.0))
    return rows


def _at_most(name: str, measure: str, value: float, most: float) -> dict[str, Any]:
    return _row(name, measure, value, f"at most {most:.3g}", value <= most)


def _row(name: str, measure: str, value: float, target: str, met: bool) -> dict[str, Any]:
    return {"set": name, "measure": measure, "value": value, "target": target, "met": "yes" if met else "no"}
