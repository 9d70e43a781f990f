"""Cameras calibrated by traffic: `python -m groundpose.lab.evaluate.calibrate.measure` writes
results/calibrate.json, the table of docs/calibrate.md and its picture.

Each drive is a mast of its own with traffic of its own, vehicles in other mean sizes than the shape models'
and keypoints with errors as a network's. Drives that are in the file already are not measured again.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import groundpose as gp
from groundpose._core import InputError
from groundpose.lab.evaluate.calibrate.drives import CLASS_SIGMA, Truth, first_vehicles, kept
from groundpose.lab.evaluate.report import between
from groundpose.self_calibration.figure import draw_calibration
from groundpose.vehicles import shape_model

OUT, PAGE, PICTURE = Path("results/calibrate.json"), Path("docs/calibrate.md"), Path("docs/calibrate.png")
MARKS = ("<!-- calibrated: begin -->", "<!-- calibrated: end -->")
VEHICLES, FOCAL_VEHICLES, LEAST = 100, 300, 40
"""Of a calibration, of one with its focal length, and fewest of a drive that is measured."""
GUESS = (0.8, 1.25)
"""Range of the guess of the focal length over the true one."""
_KNOWN_SIZE = 0.02
_OWN_SIZE = 0.05

Row = dict[str, Any]


def drive(seed: int, seconds: int, picture: Path | None = None) -> Row | None:
    """What is found before one mast: errors and stated standard deviations; None: too few vehicles."""
    seen, truth = kept(seed, seconds)
    count = len(set(seen.vehicles.tolist()))
    if count < LEAST:
        return None
    some = first_vehicles(seen, VEHICLES)
    blind = gp.calibrate(some)
    if picture is not None:
        draw_calibration(blind, picture)
    row: Row = {
        "seed": seed,
        "vehicles in sight": count,
        "slope of the road deg": round(math.degrees(truth.pitch - truth.pitch_under), 3),
        "sizes unknown": _errors(blind, truth),
        "sizes within 2 %": _errors(gp.calibrate(some, sizes=known_sizes(truth)), truth),
    }
    low, high = np.log(GUESS)
    guess = float(np.random.default_rng((seed, 43)).uniform(low, high))
    camera = replace(seen.camera, fx=seen.camera.fx * math.exp(guess), fy=seen.camera.fy * math.exp(guess))
    guessed = first_vehicles(seen, FOCAL_VEHICLES).seen_by(camera)
    try:
        found = gp.calibrate(guessed, focal=True)
    except InputError as error:
        return row | {"focal length": {"said": str(error)}}
    numbers = _errors(found, truth)
    if found.focal is None:
        return row | {"focal length": {"said": found.profile.remarks[-1]}}
    numbers["focal error %"] = 100.0 * (found.focal.log_factor + guess)
    numbers["focal sigma %"] = 100.0 * found.focal.sigma
    return row | {"focal length": _rounded(numbers)}


def known_sizes(truth: Truth) -> gp.SizePrior:
    """The true mean sizes of the classes, within 2 %."""
    covariance = _OWN_SIZE**2 * np.ones((3, 3)) + 1e-4 * np.eye(3)
    sizes = {}
    for name, scale in truth.scales.items():
        length, height, width = (math.exp(scale) * side for side in shape_model(name).size)
        sizes[name] = gp.ClassSize((length, height, width), covariance, _KNOWN_SIZE)
    return gp.SizePrior(sizes)


def _errors(found: gp.Calibration, truth: Truth) -> Row:
    profile = found.profile
    view = profile.view
    assert view.height is not None
    return _rounded(
        {
            "vehicles": profile.vehicles,
            "pitch error deg": math.degrees(view.pitch - truth.pitch),
            "pitch sigma deg": math.degrees(profile.pitch_sigma),
            "roll error deg": math.degrees(view.roll - truth.roll),
            "roll sigma deg": math.degrees(profile.roll_sigma),
            "height error %": 100.0 * math.log(view.height / truth.height),
            "height sigma %": 100.0 * profile.height_sigma / view.height,
        }
    )


def _rounded(row: Row) -> Row:
    return {name: round(value, 4) for name, value in row.items()}


QUANTITIES = (
    ("sizes unknown", "pitch", "deg"),
    ("sizes unknown", "roll", "deg"),
    ("sizes unknown", "height", "%"),
    ("sizes within 2 %", "height", "%"),
    ("focal length", "focal", "%"),
    ("focal length", "pitch", "deg"),
)


def summary(rows: list[Row]) -> list[Row]:
    """Over all drives: median and 90th percentile of the errors, median of the stated standard deviations,
    root of the mean squared error in standard deviations, how many 95 % intervals hold the truth."""
    lines = []
    for how, what, unit in QUANTITIES:
        pairs = [
            (row[how][f"{what} error {unit}"], row[how][f"{what} sigma {unit}"])
            for row in rows
            if f"{what} error {unit}" in row[how]
        ]
        if not pairs:
            continue
        error, sigma = np.array(pairs).T
        z = error / sigma
        lines.append(
            {
                "how": how,
                "what": f"{what}, {unit}",
                "drives": len(pairs),
                "median error": float(np.median(np.abs(error))),
                "90th percentile": float(np.percentile(np.abs(error), 90)),
                "median stated sigma": float(np.median(sigma)),
                "rms error over sigma": float(np.sqrt(np.mean(z**2))),
                "inside 95 % interval, %": float(100.0 * np.mean(np.abs(z) < 1.96)),
            }
        )
    return lines


def table(rows: list[Row]) -> str:
    """The summary as Markdown."""
    columns = (
        "median error", "90th percentile", "median stated sigma", "rms error over sigma",
        "inside 95 % interval, %",
    )  # fmt: skip
    head = "| | drives | " + " | ".join(columns) + " |\n|---|" + "---|" * (len(columns) + 1)
    lines = [head]
    for line in summary(rows):
        numbers = " | ".join(f"{line[name]:.2f}" for name in columns[:-1])
        lines.append(
            f"| {line['how']}: {line['what']} | {line['drives']} | {numbers} | {line[columns[-1]]:.0f} |"
        )
    return "\n".join(lines)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--drives", type=int, default=24)
    parser.add_argument("--seconds", type=int, default=150)
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--again", action="store_true", help="measure all drives again")
    given = parser.parse_args()
    stored = [] if given.again or not given.out.exists() else json.loads(given.out.read_text())["drives"]
    known = {row["seed"]: row for row in stored if row["seconds"] == given.seconds}
    for seed in range(given.drives):
        if seed in known:
            continue
        began = time.monotonic()
        row = drive(seed, given.seconds, PICTURE if seed == 0 else None) or {"seed": seed, "left out": True}
        known[seed] = row | {"seconds": given.seconds}
        rows = [known[key] for key in sorted(known)]
        used = [one for one in rows if "left out" not in one]
        content = {
            "vehicles": VEHICLES, "vehicles with focal length": FOCAL_VEHICLES, "class sigma": CLASS_SIGMA,
            "summary": [_rounded_text(line) for line in summary(used)], "drives": rows,
        }  # fmt: skip
        given.out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        print(f"drive {seed}: {time.monotonic() - began:.0f} s", flush=True)
    used = [row for row in known.values() if "left out" not in row]
    if given.out == OUT and PAGE.exists():
        text = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(between(text, MARKS, f"\n{table(used)}\n"), encoding="utf-8")
    print(table(used))


def _rounded_text(line: Row) -> Row:
    return {name: round(value, 3) if isinstance(value, float) else value for name, value in line.items()}


if __name__ == "__main__":
    main()
