"""Time the renderer on one core: `python -m groundpose.lab.training.renderer_bench OUT.json`.

Run it on a quiet machine with one drawing thread (`LP_NUM_THREADS=1 taskset -c 1`). It is in this room
because it draws training crops.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from groundpose._writing import write_text
from groundpose.lab.drive.render.bench import CODEC, FRAMES, forget_bodies, measure
from groundpose.lab.training import rendered
from groundpose.lab.training.sources import source_named

_COMMAND = "LP_NUM_THREADS=1 taskset -c 1 python -m groundpose.lab.training.renderer_bench"


def main(path: str) -> None:
    """Measure and write; figures of alternatives in the file stay."""
    file = Path(path)
    old = json.loads(file.read_text("utf-8")) if file.exists() else {}
    kept = {"alternatives": old["alternatives"]} if "alternatives" in old else {}
    figures = measure(lambda: source_named("car")(0, "train", 0, FRAMES, CODEC), _forget)
    write_text(file, json.dumps({"command": _COMMAND, **figures, **kept}, indent=1) + "\n")


def _forget() -> None:
    """Make the renderer anew, so that only drawing is timed, and forget the bodies."""
    rendered.renderer.cache_clear()
    rendered.renderer()
    forget_bodies()


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "results/renderer.json")
