"""How poses and classes depend on the focal length and on the roll of the camera: numbers and figure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from groundpose.draw.save import save_figure
from groundpose.keypoints.network import Network
from groundpose.lab.evaluate.networks.judged import judge
from groundpose.lab.evaluate.networks.renders import FOCAL, ROLL, renders

FIGURE = Path("docs/model_sweeps.png")
# Name, sets and their names' form, the point that is the drive's own camera, label.
_SWEEPS = (
    ("focal length", tuple(FOCAL), "focal length x {:g}", 1.0, "focal length / that of the drive's camera"),
    ("roll", tuple(ROLL), "roll {:g} deg", 0.0, "roll of the camera (deg)"),
)
_QUANTITIES = (("median_e_r_deg", "median e_r (deg)", 1.0), ("class_accuracy", "right class (%)", 100.0))


def measure(network: Network, folder: Path, tell: Callable[[str], None]) -> dict[str, Any]:
    """`{sweep: {point: numbers}}`, and under "worst {sweep}" the largest median e_r by that of the drive's
    own camera."""
    found: dict[str, Any] = {}
    for sweep, points, form, own, _ in _SWEEPS:
        numbers = {f"{x:g}": judge(network, renders(folder, form.format(x), tell)).numbers() for x in points}
        medians = {x: m["median_e_r_deg"] for x, m in numbers.items()}
        found[sweep] = numbers
        found[f"worst {sweep}"] = max(medians.values()) / medians[f"{own:g}"]
    return found


def draw(root: Path, trained: dict[str, Any]) -> None:
    """The figure of all networks that were measured; none where none was."""
    measured = {name: one["sweeps"] for name, one in trained.items() if "sweeps" in one}
    if not measured:
        return
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.6), layout="constrained")
    grid = figure.subplots(2, 2, sharex="col", sharey="row")
    for column, (sweep, points, _, _, label) in enumerate(_SWEEPS):
        for row, (key, quantity, factor) in enumerate(_QUANTITIES):
            axes = grid[row][column]
            for name, numbers in measured.items():
                values = [factor * numbers[sweep][f"{x:g}"][key] for x in points]
                axes.plot(points, values, marker="o", label=name)
            axes.set_ylabel(quantity if column == 0 else "")
            axes.grid(visible=True, linewidth=0.4, alpha=0.5)
            if row == 1:
                axes.set_xlabel(label)
            axes.set_xticks(points, [f"{x:g}" for x in points])
    # after all curves: a limit ends the scaling of the axes that share it
    grid[0][0].set_ylim(bottom=0.0)
    grid[1][0].set_ylim(min(90.0, grid[1][0].get_ylim()[0]), 101.0)
    grid[0][0].legend(fontsize=8)
    save_figure(figure, root / FIGURE, 90, metadata={"Software": None})
