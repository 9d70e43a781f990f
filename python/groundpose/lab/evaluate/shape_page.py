"""docs/vehicles.md: the keypoints and shape models, from the table and the stored results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from groundpose._writing import write_text
from groundpose.lab.bodies import STYLES, body
from groundpose.lab.evaluate import report
from groundpose.vehicles import CLASSES, KEYPOINTS, keypoint_indices

INTRODUCTION = """\
# Vehicles

All vehicles may be used freely, and are the same on every machine to 1e-15 m. They are procedural
(`groundpose.vehicles`), in any number, but for seven of the training pool that were drawn by hand: meshes
of the SMARTS simulator, in the public domain (CC0; `lab/bodies/assets/ATTRIBUTION.md`).
`groundpose.lab.bodies.body("car", seed=7)` is a closed mesh with materials and keypoints,
`groundpose.vehicles.shape_model("car")` the shape model that the estimator takes.

This page is written by `groundpose evaluate shapes` (a minute)."""
BODIES_TEXT = """\
## Bodies

Every component of a procedural body is closed and faces outward; windows are glass with seats behind
them; a body has at most 15,000 triangles, without people and roof rails where these would be too many.
It belongs to a region (Europe, North America, China, Japan, elsewhere), which decides what styles are
common and how large they are, and to an age between 1990 and today: old vehicles are shorter, lower and
narrower. Fractions and sizes are estimates in tables (`lab/bodies/regions.py`, `dimensions.py`). Means
over ten bodies per style. For comparison KITTI's labels, length / height / width: car 3.89 / 1.51 /
1.62, van 4.92 / 2.14 / 1.90, truck 9.35 / 3.32 / 2.53 m."""
KEYPOINTS_TEXT = """\
## Keypoints

53 in all, as in the paper: car 28, van_bus 26, pickup 26, box_truck 30. The number is the row in the table
and the channel of the network. Left and right are the driver's. In the drawings, filled points are visible
from there and the others hidden."""
MODELS_TEXT = """\
## Shape models

Principal components of {bodies} bodies per class, written by `python -m groundpose.lab.bodies.make_models`.
The bodies are aligned as they are made: one metric frame, origin on the ground under the middle. There is no
Procrustes alignment: it would take out size and position, which vary between vehicles and which a pose is
relative to. As many modes are kept as leave {left:g} cm (root mean square) to the keypoints of a body,
{fewest} to {most}. Vans and buses share one class: length fills its first mode, and a normal distribution
describes it badly, because nothing is 8 m long. Measured on {unseen} bodies per class that the models
were not made from:"""
REAL_TEXT = """\
## Against real cars

The {cars} models of ApolloCar3D (test input, not part of this package) share {keypoints} keypoints with our
car. Residuals are root mean square distances after rigid alignment without scaling. The two sets do not
define every keypoint alike: the mean offset of each keypoint is taken out, except where said. The real
labels are not symmetric (by {asymmetry:.1f} cm); symmetric bodies cannot follow that, so both are given."""
SHORT_TEXT = """\
Where the modes fall short: the fitted coefficients are larger than the prior expects, so our bodies vary
less than real cars do, and real cars have lines of their own that a few styles do not hold. Residuals of
lamps, bumpers and plates are partly definition: the real labels follow the outline of each lamp."""


def render(content: dict[str, Any]) -> str:
    """The whole page."""
    parts = [INTRODUCTION, BODIES_TEXT, report.table(_styles()), KEYPOINTS_TEXT]
    for class_name in CLASSES:
        parts.append(f"### {class_name}: {len(keypoint_indices(class_name))} keypoints")
        parts.append(f"![Keypoints of {class_name}](vehicles/keypoints_{class_name}.png)")
    parts += ["### All 53", report.table([_keypoint(i) for i in range(len(KEYPOINTS))])]
    parts += _models(content["models"])
    if "real cars" in content:
        parts += _real(content["real cars"])
    return "\n\n".join(parts) + "\n"


def write_page(content: dict[str, Any], path: Path) -> None:
    """Write the page."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, render(content))


def _styles() -> list[dict[str, Any]]:
    """One line per style: seeds 0 to 9."""
    lines = []
    for class_name, styles in STYLES.items():
        for style in styles:
            bodies = [body(class_name, seed, style) for seed in range(10)]
            sizes = np.array([b.size for b in bodies]).mean(axis=0)
            lines.append(
                {
                    "class": class_name,
                    "style": style,
                    "length / height / width, m": " / ".join(f"{size:.2f}" for size in sizes),
                    "triangles": str(round(float(np.mean([len(b.faces) for b in bodies])))),
                    "components": round(float(np.mean([int(b.parts.max()) + 1 for b in bodies]))),
                }
            )
    return lines


def _keypoint(row: int) -> dict[str, Any]:
    keypoint = KEYPOINTS[row]
    classes = {class_name: "x" if class_name in keypoint.classes else "" for class_name in CLASSES}
    return {"number": row, "name": f"`{keypoint.name}`", "where": keypoint.where, **classes}


def _models(models: dict[str, Any]) -> list[str]:
    from groundpose.lab.bodies.make_models import FEWEST, LEFT_M, MOST

    first = next(iter(models.values()))
    lines, sizes = [], []
    for class_name, model in models.items():
        percentages = [100.0 * fraction for fraction in model["variance of each mode"]]
        lines.append(
            {
                "class": class_name,
                "modes": model["modes"],
                "variance of each, %": ", ".join(f"{p:.2f}" for p in percentages),
                "of all, %": round(sum(percentages), 2),
                "residual, cm": model["residual, cm"],
            }
        )
        means, deviations = model["mean length, height, width, m"], model["standard deviation, m"]
        columns = zip(("length", "height", "width"), means, deviations, strict=True)
        sizes.append(
            {"class": class_name, **{f"{name}, m": f"{mean:.2f} ± {std:.2f}" for name, mean, std in columns}}
        )
    text = MODELS_TEXT.format(
        bodies=first["bodies of the model"],
        unseen=first["unseen bodies"],
        left=round(100 * LEFT_M, 1),
        fewest=FEWEST,
        most=MOST,
    )
    return [
        text,
        report.table(lines),
        "Sizes of the bodies, mean and standard deviation:",
        report.table(sizes),
    ]


def _real(real: dict[str, Any]) -> list[str]:
    plain, even = real["labels as they are"], real["labels made symmetric"]
    lines = [{"": key, "labels as they are": plain[key], "made symmetric": even[key]} for key in plain]
    text = REAL_TEXT.format(**real, asymmetry=real["asymmetry of the labels, cm"])
    by_keypoint = "By keypoint, labels made symmetric, free coefficients:"
    return [text, report.table(lines), by_keypoint, report.table(real["by keypoint"]), SHORT_TEXT]
