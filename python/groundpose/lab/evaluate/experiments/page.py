"""docs/experiments.md, generated from stored results."""

from __future__ import annotations

import math
from pathlib import Path

from groundpose._writing import write_text
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.experiments.figures import drawn
from groundpose.lab.evaluate.experiments.findings import CLAIMS, Finding
from groundpose.lab.evaluate.experiments.series import MICROSECONDS, Results
from groundpose.lab.evaluate.experiments.settings import EXPERIMENTS, OUTLIERS, Setting, settings_of
from groundpose.lab.evaluate.experiments.store import FOLDER

PAGE, FIGURES = Path("docs/experiments.md"), Path("docs/experiments")
INTRODUCTION = """\
The synthetic experiments of the paper (sec. 4.1, Figs. 4 and 5), with every method it names, today's
libraries and our default. Cubes of points 20 to 40 m away, f = 800 px, noise 2 px, threshold 4 px,
confidence 0.99, at most 10000 iterations. E1 varies the outlier ratio, E2 the number of points (50 %
outliers), E3 the error of the nominal pitch, E4 errors of the 2D box sides: both outward (negative: inward)
and both shifted, as the paper does not say which.

How to read it:

- Two outlier models: uniform in the image, and uniform in the object's box (closer to a real detector).
- e_t is divided by the norm of the estimate, as in the paper. No answer counts as 180 deg and 100 %.
- Inliers are counted anew on the final pose, with the threshold, for every method.
- Oracles are least squares on the true inliers: floors, not methods. The 4-DoF one trusts the
  nominal pitch.
- Times: median over chunks of 50 objects, one thread a process; ours is the whole Python batch call, a
  library's its own calls alone. **RPnP, ASPnP, OPnP+N, EPPnP and REPPnP are NumPy here: their accuracy
  counts, their time does not.** EPnP is OpenCV's, its GN is NumPy. Times of ours, RNSC-P1P with GN and HRE
  and PoseLib tuned are of one later run with the present core, one process at a time, on an AMD EPYC without
  AVX-512; all others are of the run before, on a busy one.
- RNSC-P1P and RNSC-P3P, their GN and HRE run in our core: four cases, inlier count, priors forgotten
  after the search.
- Fewer trials where a library is too slow; the tables say how many.
- No library we know offers a robust pose with a known tilt in Python: "ours, UP2P search" (two points,
  known tilt, no box, our refinement) stands in for it."""
VERDICTS = {True: "Confirmed.", False: "**Not confirmed.**", None: "Not measured yet."}
FIGURES_OF = {"HRE": ("fig5",)}
"""Where an experiment is drawn that is not in both figures 4."""
QUIET_LOAD = 1.5
"""Processes running, in the mean over a minute, beyond which times are called disturbed."""
SHOWN = {"E1": (0.5, 0.9), "E2": (50.0, 1000.0), "E3": (0.0, 3.0), "E4": (0.0, 3.0)}
"""Settings shown as tables; figures show all."""


def render(results: Results, figures: list[Path]) -> str:
    """The whole page."""
    parts = [
        "# The paper's synthetic experiments",
        INTRODUCTION,
        "`groundpose experiment all` makes it again.",
    ]
    parts.append(_state(results))
    whole = complete(results)
    if not whole:
        parts.append("This run is not finished.")
    parts += [f"![{path.stem}](experiments/{path.name})" for path in figures]
    for section, claims in CLAIMS.items():
        parts += [f"## {section}", *(_claim(check(results), whole) for check in claims)]
    parts.append("## Numbers")
    for experiment, values in SHOWN.items():
        for setting in settings_of(experiment):
            if setting.value in values and (lines := _lines(results, experiment, setting)):
                parts += [f"### {experiment}: {setting.key}", report.table(lines)]
    parts += ["## Methods", _methods(results)]
    return "\n\n".join(parts) + "\n"


def write(results: Results, page: Path = PAGE, figures: Path = FIGURES) -> Path:
    """Render and store; figures are drawn before."""
    page.parent.mkdir(parents=True, exist_ok=True)
    names = ("fig4_paper", "fig4_today", "fig5")
    found = [figures / f"{name}_{outliers}.png" for name in names for outliers in OUTLIERS]
    write_text(page, render(results, [path for path in found if path.exists()]))
    return page


def write_stored(root: Path) -> Path | None:
    """The page from the results of the repository; None when there are none."""
    results = Results.read(root / FOLDER)
    return write(results, root / PAGE, root / FIGURES) if results.stores else None


def complete(results: Results) -> bool:
    """Whether every setting of every experiment has every method that its figures show."""
    figures = {name: FIGURES_OF.get(name, ("fig4_paper", "fig4_today")) for name in EXPERIMENTS}
    shown = {name: {one for figure in some for one in drawn(figure)} for name, some in figures.items()}
    return all(
        experiment in results.stores
        and shown[experiment] <= set(results.stores[experiment].results.get(setting.key, {}))
        for experiment, settings in EXPERIMENTS.items()
        for setting in settings
    )


def _claim(finding: Finding, whole: bool) -> str:
    so_far = "" if whole or finding.confirmed is None else " (So far: not everything is measured yet.)"
    head = f"**Claim:** {finding.claim}. {VERDICTS[finding.confirmed]}{so_far}"
    return "\n".join([head, "", *(f"- {line}" for line in finding.numbers)]).rstrip()


def _state(results: Results) -> str:
    """How much of it is measured, and where."""
    lines = []
    for experiment, store in results.stores.items():
        settings, environment = len(settings_of(experiment)), store.environment
        versions = ", ".join(f"{name} {number}" for name, number in environment.get("versions", {}).items())
        cells = sum(len(cell) for cell in store.results.values())
        lines.append(
            f"- {experiment}: {store.trials} trials, seed {store.seed}, {len(store.results)} of {settings} "
            f"settings, {cells} (setting, method) pairs. {versions}. {environment.get('machine', '')}"
            + _busy(environment.get("busiest_load"))
        )
    return "\n".join(["What is measured:", "", *lines]) if lines else "Nothing is measured yet."


def _busy(load: float | None) -> str:
    """A warning when more ran than the one process that was timed."""
    disturbed = load is not None and load > QUIET_LOAD
    return f". Up to {load:.0f} processes ran: times are disturbed" if disturbed else ""


def _lines(results: Results, experiment: str, setting: Setting) -> list[dict[str, object]]:
    """One table: every method of one setting."""
    lines: list[dict[str, object]] = []
    store = results.stores.get(experiment)
    for method, numbers in (store.results.get(setting.key, {}) if store else {}).items():
        microseconds = results.value(experiment, setting.key, method, MICROSECONDS)
        lines.append(
            {
                "method": method,
                "trials": numbers["trials"],
                "mean e_r deg": numbers["mean_e_r_deg"],
                "mean e_t %": numbers["mean_e_t_percent"],
                "failures %": 100.0 * numbers["failures"],
                "inliers": numbers["mean_inliers"],
                "iterations": numbers["mean_iterations"],
                "us": None if math.isnan(microseconds) else microseconds,
            }
        )
    return lines


def _methods(results: Results) -> str:
    notes = {name: note for store in results.stores.values() for name, note in store.methods.items()}
    return "\n".join(f"- {name}: {note}" for name, note in notes.items())
