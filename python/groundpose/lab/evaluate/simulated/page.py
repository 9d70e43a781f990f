"""docs/experiments_simulated.md, generated from stored results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from groundpose._writing import write_text
from groundpose.lab.contenders.own import DEFAULT, NEVER_REFUSES, UP2P_NEVER_REFUSES
from groundpose.lab.contenders.use import CUT, NO_SCORES, WEIGHTS
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.experiments.store import Store
from groundpose.lab.evaluate.simulated.fit import AGREEMENT, COMMAND, QUANTILES
from groundpose.lab.evaluate.simulated.run import BOXES, DETECTORS, EXPERIMENTS, SETTINGS, SLOW, Setting

OWN = (DEFAULT, NEVER_REFUSES, UP2P_NEVER_REFUSES)
SIMPLE = {"G1": "gn", "G2": "re"}
"""The refinement that the paper compares HRE with."""
PAGE = Path("docs/experiments_simulated.md")
INTRODUCTION = """\
The paper's experiments on a driving simulator (sec. 4.2, Table 2), on our own virtual drive: vehicles of four
classes, camera 1914 x 1080 with 50.8 deg, nominal pitch and roll 0 while the camera shakes and roads slope.
**G1**: each vehicle's own keypoints and box are known. **G2**: only the shape model of its class is.

There is no network in it. A simulated detector gives keypoints, scores and boxes, with errors as measured on
KITTI (last section). So this compares solvers; it says nothing about a network.

- Vehicles: those of the test split that KITTI counts: 25 px high and more, truncated by at most a half, at
  most largely occluded.
- Detectors of keypoints:
{detectors}
  Quality scales the noise, the fraction of keypoints that are not found and that of confused objects.
- Boxes: the true ones, as in the paper, and with the errors of a real detector.
- Thresholds as in the paper: t_in = tau1 = 0.0375 l, tau2 = 0.05 l, tau3 = 0.15 l, where l is the longer side
  of the box given.
- e_r and e_t as in the paper; no answer counts as 180 deg and 100 %. Failure: e_r > 10 deg or e_t > 10 % or
  no answer. In G2 size and distance trade: e_t and failures there say what the shape prior makes of it.
- e_v: mean distance, in the object's frame, between the keypoints of the true shape and of the reconstructed
  one scaled by |t_true| / |t|; no answer counts as a shape without extent. "e_v posed": the same where the
  shapes stand in the camera's frame, errors of rotation and direction included.
- Scores: the paper has none. "{cut}": low ones are left out, which is all that the paper's methods and other
  libraries can do with scores. "{weights}": ours.
- PoseLib gets the mean shape in G2: it has no shapes. "Tuned" as in docs/results.md. As it comes it takes a
  millisecond a vehicle and is given the first {slow} only.
- "{default}" searches with one keypoint and the box, and where the answer is doubtful again with two
  keypoints. It refuses poses that chance explains and pays 180 deg and 100 % for it. The others answer
  always: "{never}" compares like with like. "{up2p}" searches with two
  keypoints and the nominal tilt, and looks at the box in the refinement only.
- Times: processor time of one thread, relative to our default; ours are batch calls from Python, a library's
  its own calls alone. Microseconds and machine are in the stored results."""
PAPER = {
    "G1": (
        "RNSC-P1P+GN | RNSC-P1P+HRE | RNSC-P3P+GN | RNSC-P3P+HRE: Res10 e_r 3.78 | 1.56 | 1.90 | 1.41, "
        "e_t 6.28 | 1.61 | 1.76 | 1.30; Res50 e_r 3.76 | 1.19 | 1.46 | 0.96, e_t 6.38 | 1.36 | 1.41 | 0.93"
    ),
    "G2": (
        "RNSC-P1P+RE | RNSC-P1P+HRE | RNSC-P3P+RE | RNSC-P3P+HRE: Res10 e_r 2.98 | 2.20 | 3.68 | 2.77, "
        "e_v 30.53 | 21.16 | 23.08 | 21.28; Res50 e_r 2.57 | 1.96 | 3.16 | 2.43, "
        "e_v 21.43 | 21.23 | 22.18 | 20.77"
    ),
}
"""Table 2 of the paper, deg, % and cm: other vehicles, a network, true boxes."""
DETECTOR = """\
the real ones are 108 cars of three KITTI tracks with the keypoints of a CNN and 2549 boxes of a detector that
the image border does not cut. The simulated ones have the same cars, poses and boxes. Taken away before: the
shift that all keypoints of a track share, 8 to 10 % of the box, which comes from the mean shape and the
labels. Left out: vehicles the detector missed, errors that neighbours and successive frames share, places in
a picture that attract wrong keypoints, any dependence of keypoints on size, light and what hides them. The
fraction of confused objects is one car of three: little more than a guess."""
ERRORS = {
    "G1": {"e_r deg": "mean_e_r_deg", "e_t %": "mean_e_t_percent"},
    "G2": {"e_r deg": "mean_e_r_deg", "e_v cm": "mean_e_v_cm"},
}
KNOWN = {"G1": "Known models (G1)", "G2": "Shape models (G2)"}
TO_REACH = {
    "G1": ("RNSC-P3P+HRE", "PoseLib tuned", "PoseLib"),
    "G2": tuple(f"RNSC-{solver}+{refinement}" for solver in ("P1P", "P3P") for refinement in ("RE", "HRE")),
}
GROUPED = (DETECTORS[0], DETECTORS[-1])
Stores = dict[str, Store]


def methods(experiment: str, scores: bool) -> dict[str, str]:
    """{heading: stored name} of one table, the paper's columns first."""
    refinements = (SIMPLE[experiment].upper(), "HRE")
    papers = [f"RNSC-{solver}+{refinement}" for solver in ("P1P", "P3P") for refinement in refinements]
    own, others = (WEIGHTS, CUT) if scores else (NO_SCORES, NO_SCORES)
    names = {name: others for name in (*papers, "PoseLib", "PoseLib tuned")}
    names |= {method.name: own for method in OWN}
    return {name: f"{name}, {used}" if used else name for name, used in names.items()}


def table_2(store: Store, boxes: str, scores: bool) -> str:
    """The paper's Table 2, one half."""
    lines = []
    for detector in DETECTORS:
        cell = store.results.get(Setting(detector, boxes).key, {})
        for what, key in ERRORS[store.experiment].items():
            named = methods(store.experiment, scores).items()
            values = {heading: cell[name][key] if name in cell else None for heading, name in named}
            best = min((v for v in values.values() if v is not None), default=None)
            line: dict[str, Any] = {"keypoints": detector.name, "mean": what}
            lines.append(line | {heading: _number(value, best) for heading, value in values.items()})
    return report.table(lines)


def _number(value: float | None, best: float | None) -> str | None:
    if value is None:
        return None
    return f"**{value:.2f}**" if value == best else f"{value:.2f}"


def reached(store: Store, setting: Setting, scores: bool) -> list[dict[str, Any]]:
    """Our default and variants of it against the best of the rows they have to reach, means.

    "noise" is the standard error of the difference between the default and that row, taken as independent.
    """
    cell, names = store.results.get(setting.key, {}), methods(store.experiment, scores)
    rows = {row: names[row] for row in TO_REACH[store.experiment] if names[row] in cell}
    ours = {method.name: names[method.name] for method in OWN}
    if not rows or not set(ours.values()) <= set(cell):
        return []
    found = []
    for what, key in ERRORS[store.experiment].items():
        best = min(rows, key=lambda row: cell[rows[row]][key])
        line: dict[str, Any] = {
            "setting": f"{setting.key}, {'with' if scores else 'without'} scores",
            "mean": what,
        }
        line |= {"at most": cell[rows[best]][key], "of": best}
        error = f"error_of_{key}"
        line["noise"] = float(np.hypot(cell[ours[DEFAULT.name]][error], cell[rows[best]][error]))
        for name, stored in ours.items():
            value = cell[stored][key]
            line |= {name: value, f"{name}, met": value <= line["at most"]}
        found.append(line)
    return found


def _details(store: Store, setting: Setting) -> str:
    """Means, medians, failures and relative times of every method of one setting."""
    lines: list[dict[str, Any]] = []
    times = store.microseconds.get(setting.key, {})
    for name, n in store.results.get(setting.key, {}).items():
        line = {
            "method": name,
            "mean e_r deg": n["mean_e_r_deg"],
            "+-": n["error_of_mean_e_r_deg"],
            "without failures": n["mean_e_r_ok_deg"],
            "median e_r deg": n["median_e_r_deg"],
            "mean e_t %": n["mean_e_t_percent"],
            "median e_t %": n["median_e_t_percent"],
        }
        if store.experiment == "G2":
            line |= {
                "mean e_v cm": n["mean_e_v_cm"],
                "median e_v cm": n["median_e_v_cm"],
                "median e_v posed cm": n["median_posed_e_v_cm"],
            }
        line |= {"failures %": 100.0 * n["failures"], "no answer %": 100.0 * (1.0 - n["answered"])}
        lines.append(
            line | {"time / ours": times[name] / times[DEFAULT.name] if DEFAULT.name in times else None}
        )
    return report.table(lines)


def _grouped(store: Store, setting: Setting) -> str:
    """By distance, class, truncation, occlusion and tilt error: our default and two others, with scores."""
    cell, what = store.results.get(setting.key, {}), ERRORS[store.experiment]
    names = methods(store.experiment, scores=True)
    shown = {
        heading: names[heading] for heading in (DEFAULT.name, "RNSC-P1P+HRE", "RNSC-P3P+HRE", "PoseLib tuned")
    }
    shown = {heading: name for heading, name in shown.items() if name in cell}
    lines = []
    for by, members in next((cell[name]["groups"] for name in shown.values()), {}).items():
        for group, numbers in members.items():
            line: dict[str, Any] = {"by": by, "group": group, "vehicles": numbers["trials"]}
            for heading, name in shown.items():
                own = cell[name]["groups"][by][group]
                line[heading] = " / ".join(f"{own[key]:.2f}" for key in (*what.values(), "median_e_r_deg"))
                line[heading] += f" / {100.0 * own['failures']:.1f}"
            lines.append(line)
    return report.table(lines)


def render(stores: Stores, agreement: dict[str, Any]) -> str:
    """The whole page."""
    parts = ["# G1 and G2 with a simulated detector", _introduction()]
    parts += ["`groundpose experiment G1` and `groundpose experiment G2` make it again."]
    for experiment, store in stores.items():
        parts += [f"## {KNOWN[experiment]}", _state(store)]
        for boxes in BOXES:
            for scores in (False, True):
                how = f"{boxes.capitalize()}, {'with' if scores else 'without'} scores"
                parts += [f"### {how}", table_2(store, boxes, scores)]
        parts += [f"The paper, {PAPER[experiment]}."]
        lines = [line for s in SETTINGS for scores in (False, True) for line in reached(store, s, scores)]
        met = {m.name: sum(line[f"{m.name}, met"] for line in lines) for m in OWN}
        parts += ["### Our default against the best of the rows it has to reach"]
        parts += [
            f"Of {len(lines)} met: " + "; ".join(f"{name} {n}" for name, n in met.items()) + ".",
            report.table(lines) if lines else "",
        ]
    parts += ["## Groups", "Means of the two errors / median e_r / failures in %; scores are used."]
    for experiment, store in stores.items():
        for detector in GROUPED:
            setting = Setting(detector, BOXES[1])
            parts += [f"### {experiment}, {setting.key}", _grouped(store, setting)]
    parts += ["## Every method"]
    for experiment, store in stores.items():
        for setting in SETTINGS:
            parts += [f"### {experiment}: {setting.key}", _details(store, setting)]
    parts += _detector(agreement)
    return "\n\n".join(part for part in parts if part) + "\n"


def _introduction() -> str:
    detectors = "\n".join(f"  - {d.name}, quality {d.quality:g}: {d.note}" for d in DETECTORS)
    names = {
        "default": DEFAULT.name,
        "never": NEVER_REFUSES.name,
        "up2p": UP2P_NEVER_REFUSES.name,
        "slow": SLOW,
    }
    return INTRODUCTION.format(detectors=detectors, cut=CUT, weights=WEIGHTS, **names)


def _detector(agreement: dict[str, Any]) -> list[str]:
    """What the simulated detector was fitted to, and how well it agrees with it."""
    if not agreement:
        return []
    quantiles = ", ".join(str(q) for q in QUANTILES)
    parts = ["## The simulated detector", f"`{COMMAND}` makes it again; {DETECTOR}"]
    parts += [f"Quantiles ({quantiles} %), in % of the longer side of the box."]
    for what, lines in ((key, agreement[key]) for key in ("keypoints", "boxes")):
        shown = [{key: _listed(value) for key, value in line.items()} for line in lines]
        parts += [f"### {what.capitalize()}", report.table(shown)]
    return parts


def _listed(value: Any) -> Any:
    return ", ".join(f"{number:.3g}" for number in value) if isinstance(value, list) else value


def _state(store: Store) -> str:
    versions = ", ".join(f"{name} {number}" for name, number in store.environment.get("versions", {}).items())
    return f"{store.trials} vehicles, seed {store.seed}. {versions}. {store.environment.get('machine', '')}"


def write(folder: Path, page: Path = PAGE, agreement: Path = AGREEMENT) -> Path:
    """Render what is stored in a folder. FileNotFoundError when there is neither experiment."""
    paths = {name: folder / f"{name}.json" for name in EXPERIMENTS}
    stores = {name: Store.read(path) for name, path in paths.items() if path.exists()}
    if not stores:
        raise FileNotFoundError(f"{folder}: no results of G1 or G2 there")
    page.parent.mkdir(parents=True, exist_ok=True)
    write_text(page, render(stores, report.read_json(agreement)))
    return page


def write_stored(root: Path) -> Path | None:
    """The page from the results of the repository; None when there are none."""
    folder = root / "results" / "experiments"
    if not any((folder / f"{name}.json").exists() for name in EXPERIMENTS):
        return None
    return write(folder, root / PAGE, root / AGREEMENT)
