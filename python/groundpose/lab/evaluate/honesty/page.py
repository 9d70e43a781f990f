"""The tables of docs/honesty.md between its marks, and the README's sentence, from results/honesty.json."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from groundpose._writing import write_text
from groundpose.lab.evaluate.honesty import figures
from groundpose.lab.evaluate.honesty.numbers import ALLOWED, CLEAR
from groundpose.lab.evaluate.honesty.sources import ALL_RENDERS, MANY_LOOKS, RENDERS
from groundpose.lab.evaluate.honesty.targets import WANTED
from groundpose.lab.evaluate.networks.targets import target_table
from groundpose.lab.evaluate.report import MARKS, README, between, read_json, table

RESULTS, PAGE = Path("results/honesty.json"), Path("docs/honesty.md")
SENTENCE = ("<!-- coverage: begin -->", "<!-- coverage: end -->")
SHOWN = "default"
"""The network of the README's sentence."""


def write_stored(root: Path) -> Path | None:
    """The page from the stored results; None when there are none."""
    found = read_json(root / RESULTS)
    return write_page(root, found) if found else None


def write_page(root: Path, found: dict[str, Any]) -> Path | None:
    """Put the tables between the marks of the page, the sentence into the README, and draw the figures; None
    when there is no page."""
    path, readme = root / PAGE, root / README
    if readme.exists():
        write_text(readme, with_sentence(readme.read_text("utf-8"), found))
    if not path.exists():
        return None
    write_text(path, between(path.read_text("utf-8"), MARKS, f"\n{tables(found)}\n"))
    figures.draw(root, found.get("trained", {}))
    return path


def with_sentence(readme: str, found: dict[str, Any]) -> str:
    """The README with the sentence about covariances made anew."""
    return between(readme, SENTENCE, sentence(found)) if SENTENCE[0] in readme else readme


def sentence(found: dict[str, Any]) -> str:
    """How often 95 % regions hold the truth, by the kind of data."""
    scenes = [one for name, one in found["callers"].items() if name.startswith("synthetic")]
    parts = [f"{_range(scenes)} of synthetic scenes with independent noise"]
    if one := found.get("trained", {}).get(SHOWN):
        seen = one["vehicles"]
        renders = [seen[name]["coverage"][CLEAR] for name in RENDERS]
        parts.append(f"{_range(renders)} of right answers through the bundled network on held-out renders")
        if streets := seen.get(MANY_LOOKS):
            raw, allowed = (_range([streets["coverage"][name]]) for name in (CLEAR, ALLOWED))
            parts.append(f"{raw} on 27 real cars ({allowed} when errors of their labels are allowed for)")
    return f"its 95 % regions (`region()`) hold the truth in {', '.join(parts)}"


def _range(covered: list[dict[str, Any]]) -> str:
    """The whole pose's 95 % regions of some groups."""
    values = sorted({f"{one['inside']['pose']['95']:.0f}" for one in covered}, key=int)
    return f"{values[0]} to {values[-1]} %" if len(values) > 1 else f"{values[0]} %"


def tables(found: dict[str, Any]) -> str:
    """All of them."""
    trained = found.get("trained", {})
    parts = [f"`{found['command']}`", *(FIGURES if trained else ()), "### Targets"]
    parts.append(table(target_table(found, WANTED)))
    for title, words, lines in (
        ("Keypoints of the caller", COVERAGE, _callers(found["callers"])),
        ("Their probability", CALLERS, _callers_probability(found["callers_probability"])),
        ("Fitted numbers", FITTED, _certainty(trained)),
        ("Regions", COVERAGE, _coverage(trained)),
        ("Right answers and their probability", PROBABILITY, _probability(trained)),
        ("The other reading", AMBIGUITY, _ambiguity(trained)),
        ("Nothing there", BACKGROUND, _background(trained)),
    ):
        if lines:
            parts += [f"### {title}", words, table(lines)]
    return "\n\n".join(parts)


FIGURES = tuple(
    f"![{words}]({path.name})"
    for words, path in (
        ("Fraction of true values inside the stated regions, against the level", figures.COVERAGE),
        ("Probability and ambiguity against the fraction that is true", figures.RELIABILITY),
    )
)
COVERAGE = (
    "Percentage of right answers whose truth is inside the stated 50 / 90 / 95 % region, by quantity; "
    "sharpness: median stated standard deviation over the robust one of the errors."
)
CALLERS = (
    "Percentage of the poses that are right, mean distance of stated and true probability (percent), AUC of "
    "right against wrong ones; nothing refused. Mixture: synthetic objects of every quality."
)
FITTED = "What `--fit` has stored in the network's file."
PROBABILITY = (
    "All percentages. Right: yaw within 15 degrees and distance within 15 %, of well visible vehicles. Kept: "
    "right answers that get the status `ok`, of well visible vehicles and of all. Right of `ok`: over all "
    "vehicles. Error: mean distance of stated and true probability. AUC: of right against wrong answers."
)
AMBIGUITY = (
    "Poses turned by more than 90 degrees, and how many of them have another reading (`alternatives`), and "
    "one with the right yaw. Stated / true: mean `ambiguity` and percentage turned, by bins of `ambiguity`, "
    "with the number of answers."
)
BACKGROUND = (
    "Percentage of boxes without a vehicle that get a pose at all, that the network takes for a vehicle, and "
    "that get the status `ok`."
)


def _inside(covered: dict[str, Any]) -> dict[str, Any]:
    cells: dict[str, Any] = {"answers": covered["answers"]}
    for quantity, by in covered["inside"].items():
        cells[quantity] = " / ".join(f"{by[level]:.0f}" for level in ("50", "90", "95"))
    cells["sharpness: yaw, distance, lateral"] = ", ".join(f"{v:.2f}" for v in covered["sharpness"].values())
    return cells


def _callers(callers: dict[str, Any]) -> list[dict[str, Any]]:
    return [{"keypoints": name, **_inside(one)} for name, one in callers.items()]


def _callers_probability(judged: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "keypoints": name,
            "objects": one["objects"],
            "with a pose": one["answers"],
            "right": one["right"],
            "error": 100 * one["calibration_error"],
            "AUC": one["auc"],
        }
        for name, one in judged.items()
    ]


def _certainty(trained: dict[str, Any]) -> list[dict[str, Any]]:
    lines = []
    for name, one in trained.items():
        own = one["certainty"]
        lines.append({
            "network": name,
            "error factor": own["error_factor"],
            "degrees of freedom": own["error_dof"],
            "shift, % of the box": 100.0 * own["error_shift"],
            "turn, deg": math.degrees(own["error_turn"]),
            "ambiguity: bias, slope": _numbers(own["ambiguity_coefficients"] or (0.0, 1.0)),
            "coefficients: bias, score, misfit, noise, false alarms, vehicle, ambiguity": _numbers(
                own["probability_coefficients"]
            ),
            "least probability": own["min_probability"],
        })  # fmt: skip
    return lines


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def _coverage(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {"network": name, "source": source, "group": group, **_inside(covered)}
        for name, one in trained.items()
        for source, numbers in one["vehicles"].items()
        if source != ALL_RENDERS
        for group, covered in numbers["coverage"].items()
    ]


def _probability(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "network": name,
            "source": source,
            "vehicles": numbers["vehicles"],
            "well visible": numbers["well_visible"],
            "right": numbers["right"],
            "yaw right": numbers["right_yaw_only"],
            "kept, well visible": numbers["kept"],
            "kept, all": numbers["kept_all"],
            "right of `ok`": numbers["right_of_called"],
            "error": 100 * numbers["probability"]["calibration_error"],
            "AUC": numbers["probability"]["auc"],
        }
        for name, one in trained.items()
        for source, numbers in one["vehicles"].items()
    ]


def _ambiguity(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "network": name,
            "source": source,
            "turned": numbers["ambiguity"]["flips"],
            "AUC": numbers["ambiguity"]["auc"],
            "another reading / it is right, %": _pair(
                numbers["ambiguity"]["with_other"], numbers["ambiguity"]["other_right"]
            ),
            "stated / true %": ", ".join(
                f"{100 * said:.1f} / {100 * true:.1f} ({count})"
                for said, true, count in numbers["ambiguity"]["bins"]
            ),
        }
        for name, one in trained.items()
        for source, numbers in one["vehicles"].items()
    ]


def _pair(first: float | None, second: float | None) -> str | None:
    return None if first is None or second is None else f"{first:.0f} / {second:.0f}"


def _background(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "network": name,
            "source": source,
            "boxes": numbers["boxes"],
            "a pose": numbers["solved"],
            "taken for a vehicle": numbers["called_vehicle"],
            "`ok`": numbers["called_right"],
            "`ok` by kind": ", ".join(f"{k} {n['called_right']:.1f}" for k, n in numbers["kinds"].items()),
        }
        for name, one in trained.items()
        for source, numbers in one["background"].items()
    ]
