r"""Where the instructions of an estimate go, from a profile of `benches/instructions.rs`.

    CARGO_PROFILE_BENCH_DEBUG=1 cargo bench --no-run --bench instructions
    valgrind --tool=callgrind --separate-callers=4 --toggle-collect=instructions::measured \
        --dump-after=instructions::measured --callgrind-out-file=where \
        EXE --only "vehicle M = 5, search + hre"
    python -m groundpose.lab.bench.where where.1 --objects 100
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from pathlib import Path

PARTS = (
    ("covariance", ("refine::covariance", "certainty")),
    ("noise of the keypoints", ("NoiseModel::estimate",)),
    (
        "median absolute deviations",
        ("refine::mad", "schedule::median", "Keypoints::measure'groundpose::refine::schedule"),
    ),
    ("shape to points", ("Keypoints::hold", "refine::modes")),
    ("costs of trials and candidates", ("Objective::cost", "Objective::truncated_cost")),
    ("normal equations", ("Objective::linearise",)),
    ("test against chance", ("false_alarms",)),
    ("scores of hypotheses", ("Run::score",)),
    ("P1P and the order of draws", ("search::search",)),
    ("residuals and what is said", ("estimate::describe", "Looks")),
    ("steps: elimination, new poses, decisions", ("pipeline::answer",)),
    ("laying out, set-up", ("pipeline::estimate_ideal",)),
)
"""Parts of an estimate with what occurs in their functions' chains of callers; the first that fits counts."""

_NAMED = re.compile(r"\((\d+)\)(?: (.*))?$")


def parts_of(profile: str) -> dict[str, int]:
    """Instructions of every part of `PARTS`, and of "other", in the text of a callgrind file."""
    names: dict[str, str] = {}
    found: Counter[str] = Counter()
    function, is_call = "", False
    for line in profile.splitlines():
        if line.startswith(("fn=", "cfn=")):
            key, name = _NAMED.fullmatch(line.split("=", 1)[1]).groups()  # type: ignore[union-attr]
            names.setdefault(key, name)
            function = names[key] if line.startswith("fn=") else function
        elif line.startswith("calls="):
            is_call = True
        elif line[:1] in set("0123456789+-*"):
            # The line after a call holds what the callee did.
            found[_part(function)] += 0 if is_call else int(line.split()[1])
            is_call = False
    return dict(found)


def _part(chain: str) -> str:
    for part, marks in PARTS:
        if any(mark in chain for mark in marks):
            return part
    return "other"


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("profile", type=Path)
    parser.add_argument("--objects", type=int, default=100)
    arguments = parser.parse_args()
    found = parts_of(arguments.profile.read_text())
    total = sum(found.values())
    print("| part | instructions per object | % |\n| --- | --- | --- |")
    print(f"| all | {total / arguments.objects:,.0f} | 100 |")
    for part, count in sorted(found.items(), key=lambda row: -row[1]):
        print(f"| {part} | {count / arguments.objects:,.0f} | {100 * count / total:.1f} |")


if __name__ == "__main__":
    main()
