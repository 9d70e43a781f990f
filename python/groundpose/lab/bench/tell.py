"""Tables on the terminal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.table import Table
from rich.text import Text

from groundpose.lab.bench import targets
from groundpose.lab.bench.baseline import BETTER, SAME, Difference

_COLUMNS = ("us per object", "times ours", "middle half", "mean e_r deg", "failures %")


def race(name: str, case: dict[str, Any]) -> Table:
    """Everybody's line of a race, and who is left out and why."""
    table = Table(title=f"{name}: {case['label']}", title_justify="left", title_style="bold")
    table.add_column("method")
    for column in _COLUMNS:
        table.add_column(column, justify="right")
    for line in case["lines"]:
        numbers = [f"{line['us']:.4g}", "1", ""]
        if "times ours" in line:
            low, high = line["times ours, quartiles"]
            numbers[1:] = [f"{line['times ours']:.3g}", f"{low:.3g} to {high:.3g}"]
        table.add_row(line["method"], *numbers, f"{line['mean e_r deg']:.3g}", f"{line['failures %']:.3g}")
    for method, reason in case["left out"].items():
        table.add_row(method, reason, style="dim")
    return table


def result(name: str, case: dict[str, Any]) -> Table:
    """Any case."""
    if "lines" in case:
        return race(name, case)
    table = Table(title=f"{name}: {case.get('label', '')}", title_justify="left", show_header=False)
    for key, value in _flat("", {k: v for k, v in case.items() if k not in ("group", "label")}):
        table.add_row(key, f"{value:.4g}" if isinstance(value, float) else str(value))
    return table


def _flat(prefix: str, value: Any) -> Iterable[tuple[str, Any]]:
    """Nested numbers as lines; rows of a table by setting and work."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(f"{prefix} {key}".strip(), inner)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for row in value:
            each = row["instructions"] / row["objects"]
            yield f"{row['setting']}: {row['work']}", f"{each:,.0f} instructions per object"
    elif isinstance(value, list):
        yield prefix, " to ".join(f"{x:.4g}" for x in value)
    else:
        yield prefix, value


def target_table(cases: dict[str, Any]) -> Table:
    """What the numbers must show; targets that were not measured are left out."""
    table = Table(title="What it must show", title_justify="left")
    for column in ("measure", "what", "value", "target", ""):
        table.add_column(column)
    for line in targets.table(cases):
        if line["met"] is not None:
            mark = Text("met", "green") if line["met"] else Text("NOT met", "red")
            table.add_row(line["measure"], line["what"], line["value"], line["target"], mark)
    return table


def differences(found: list[Difference]) -> Table | None:
    """What is not the same as in the baseline."""
    changed = [d for d in found if d.verdict != SAME]
    if not changed:
        return None
    table = Table(title="Against the baseline", title_justify="left")
    for column in ("case", "what", "before", "now", ""):
        table.add_column(column)
    for d in sorted(changed, key=lambda d: d.verdict == BETTER):
        now = "-" if d.now is None else f"{d.now:.4g}"
        table.add_row(d.case, d.what, f"{d.before:.4g}", now, d.verdict)
    return table
