"""Runs cases one after the other; what is measured is on the disk before the next begins."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from groundpose import _core
from groundpose._checks import input_error
from groundpose.lab.bench.cases import Case
from groundpose.lab.bench.races import Effort
from groundpose.lab.bench.sources import Missing
from groundpose.lab.contenders.registry import described
from groundpose.lab.evaluate import report

Content = dict[str, Any]
Advance = Callable[[int, int, str], None]
"""Called with the number of finished cases, of all, and what is done now."""


def setup(effort: Effort) -> Content:
    """What numbers must share to stand in one file."""
    core = hashlib.sha256(Path(str(_core.__file__)).read_bytes()).hexdigest()[:12]
    versions = report.versions()
    return {
        "seed": effort.seed,
        "quick": effort.quick,
        "machine": report.machine(),
        "versions": versions,
        "core": core,
        "libraries": described("bench"),
    }


def start(path: Path, cases: Sequence[Case], effort: Effort, fresh: bool) -> Content:
    """The stored content with the cases still to measure in "pending".

    A run that was interrupted goes on; a finished one is measured again, and cases that are not asked for
    stay. Raises InputError where they are of another build, machine or seed: one file is one setup.
    """
    now, stored = setup(effort), report.read_json(path)
    wanted = [case.id for case in cases]
    if fresh or not stored:
        return {**now, "pending": wanted, "cases": {}}
    differs = [name for name, value in now.items() if stored.get(name) != value]
    kept = set(stored.get("cases", {})) - set(wanted)
    if differs and kept:
        other = f"numbers of another {differs[0]} ({', '.join(sorted(kept))})"
        raise input_error("--out", "a new file, or --fresh to measure all again", f"{path}, with {other}")
    if differs:
        return {**now, "pending": wanted, "cases": {}}
    left = [name for name in stored.get("pending", ()) if name in wanted]
    return {**now, "pending": left or wanted, "cases": dict(stored["cases"])}


def run(
    path: Path,
    cases: Sequence[Case],
    effort: Effort,
    *,
    fresh: bool = False,
    advance: Advance = lambda done, total, text: None,
    finished: Callable[[str, Content], None] = lambda name, result: None,
) -> Content:
    """Measure and store. A case that needs something that is not there says so in "missing"."""
    content = start(path, cases, effort, fresh)
    to_do = [case for case in cases if case.id in content["pending"]]
    for k, case in enumerate(to_do):

        def tell(text: str, done: int = k, name: str = case.id) -> None:
            advance(done, len(to_do), f"{name}: {text}")

        tell("")
        try:
            result = case.run(effort, tell)
        except Missing as error:
            result = {"group": case.group, "missing": str(error)}
        content["cases"][case.id] = result
        content["pending"] = [name for name in content["pending"] if name != case.id]
        report.write_json(path, content)
        finished(case.id, result)
    advance(len(to_do), len(to_do), "")
    return report.read_json(path)
