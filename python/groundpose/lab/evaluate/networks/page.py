"""The tables of docs/model.md, generated from results/networks.json between its marks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from groundpose._writing import write_text
from groundpose.lab.evaluate.networks import reliability, sweeps
from groundpose.lab.evaluate.networks.robust_tables import robust_tables
from groundpose.lab.evaluate.networks.targets import target_table
from groundpose.lab.evaluate.report import MARKS, between, read_json, table

RESULTS, PAGE = Path("results/networks.json"), Path("docs/model.md")
PAPER = {
    # class accuracy %, vertex error px, GMAC (Table 1)
    "res50-256x192": (99.7, 5.24),
    "res10-256x192": (99.0, 7.12),
    "res50-128x96": (99.3, 7.57),
    "res10-128x96": (98.6, 10.05),
}
"""Table 1 of the paper, on its own simulator's test set."""
_SHOWN = ("mean_e_r_deg", "median_e_r_deg", "mean_e_t_percent", "mean_e_v_cm")
ERRORS = (
    "Mean / median rotation error in degrees / mean error of the place in %, and where shapes are found (G2) "
    "mean vertex error in cm."
)
_METHODS = (
    ("ours, default", "ours, default, scores as weights"),
    ("RNSC-P1P+HRE", "RNSC-P1P+HRE, score >= 0.1"),
    ("RNSC-P3P+HRE", "RNSC-P3P+HRE, score >= 0.1"),
    ("PoseLib tuned", "PoseLib tuned, score >= 0.1"),
)
NOTHING = (
    "Boxes of photographs without a vehicle, grey and noise that the network calls a vehicle, %, by what is "
    "there; vehicles of the development frames, each looked at twelve times, that it calls none, %."
)
TIMES = (
    "The network alone on one crop; then a whole object on one thread, from an image in memory to pose and "
    "shape, by step: the image's objects in one call, medians over calls."
)


def write_stored(root: Path) -> Path | None:
    """The page from the stored results; None when there are none."""
    found = read_json(root / RESULTS)
    return write_page(root, found) if found else None


def write_page(root: Path, found: dict[str, Any]) -> Path | None:
    """Put the tables between the marks of the page, and draw its figures; None when there is no page."""
    path = root / PAGE
    if not path.exists():
        return None
    write_text(path, between(path.read_text("utf-8"), MARKS, f"\n{tables(found)}\n"))
    trained = found.get("trained", {})
    for figure in (sweeps, reliability):
        figure.draw(root, trained)
    return path


def tables(found: dict[str, Any]) -> str:
    """All of them."""
    parts = [
        "### Targets",
        table(target_table(found)),
        "### Held-out drive (the paper's Table 1)",
        table(_accuracy(found)),
        "### Cost",
        table(_costs(found)),
    ]
    trained = found.get("trained", {})
    for title, words, lines in (
        ("Real streets, development frames", "", _streets(trained)),
        *robust_tables(trained),
        ("Nothing there", NOTHING, _nothing(trained)),
        ("Poses from held-out pictures (G1, G2)", ERRORS, _poses(trained)),
        ("Milliseconds", TIMES, _times(trained)),
    ):
        if lines:
            parts += [f"### {title}", *filter(None, [words]), table(lines)]
    return "\n\n".join(parts)


def _accuracy(found: dict[str, Any]) -> list[dict[str, Any]]:
    lines: list[dict[str, Any]] = []
    for name, one in found.get("trained", {}).items():
        for group, m in one.get("held_out", {}).items():
            lines.append({
                "network": name,
                "vehicles": f"{group}: {m['crops']:.0f}",
                "class accuracy, %": 100 * m["class_accuracy"],
                "vertex error, px": m["error_px"],
                "visible only, px": m["error_px_visible"],
                "vertex error, % of the box": 100 * m["error_share"],
                "visible within 0.0375 l, %": 100 * m["within_visible"],
            })  # fmt: skip
    for name, (accuracy, error) in PAPER.items():
        paper = f"{name}, paper, its own simulator"
        lines.append({"network": paper, "class accuracy, %": accuracy, "vertex error, px": error})
    return lines


def _costs(found: dict[str, Any]) -> list[dict[str, Any]]:
    named = {
        "GMAC": "gmac",
        "paper": "paper_gmac",
        "parameters, M": "parameters_m",
        "fp16 file, MB": "fp32_mb",
        "fp32, ms": "fp32_ms_1_threads",
        "2 threads": "fp32_ms_2_threads",
        "int8 file, MB": "int8_mb",
        "int8, ms": "int8_ms_1_threads",
        "int8, 2 threads": "int8_ms_2_threads",
    }
    return [
        {"network": name, **{shown: one[key] for shown, key in named.items()}}
        for name, one in found["costs"].items()
    ]


def _streets(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [{"network": name, **one["streets"]} for name, one in trained.items() if "streets" in one]


def _nothing(trained: dict[str, Any]) -> list[dict[str, Any]]:
    lines = []
    for name, one in trained.items():
        if found := one.get("nothing"):
            cells = {
                f"{kind}: {m['boxes']}": 100 * m["called_vehicle"] for kind, m in found["nothing"].items()
            }
            if vehicles := found.get("vehicles"):
                cells[f"vehicles called none: {vehicles['boxes']}"] = 100 * vehicles["called_none"]
            lines.append({"network": name, **cells})
    return lines


def _poses(trained: dict[str, Any]) -> list[dict[str, Any]]:
    lines = []
    for name, one in trained.items():
        for setting, methods in one.get("poses", {}).items():
            found = {shown: methods[stored] for shown, stored in _METHODS if stored in methods}
            if found:
                count = next(iter(found.values()))["trials"]
                cells = {shown: _errors(m) for shown, m in found.items()}
                lines.append({"network": name, "setting": setting, "vehicles": count, **cells})
    return lines


def _errors(m: dict[str, Any]) -> str:
    return " / ".join(f"{m[key]:.3g}" for key in _SHOWN if m.get(key) is not None)


def _times(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {"file": name, "MB": one["mb"], **one["crop_ms"], **one["object_ms"]}
        for name, one in trained.items()
        if "crop_ms" in one
    ]
