"""`groundpose evaluate shapes`: what our shape models hold and which real cars they reach.

Writes results/shape_models.json and docs/vehicles.md (with the table and drawings of the keypoints). The real
cars are the 79 models of ApolloCar3D, test input found as in `real_data`; without them that part is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

import groundpose as gp
from groundpose.formats.apollo import OURS_FROM_APOLLO
from groundpose.lab.bodies import drawing
from groundpose.lab.bodies.make_models import BODIES, outlines
from groundpose.lab.contenders.objects import Array
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.shape_fit import Fit, fitted, mirrored, reached, rigidly_aligned
from groundpose.lab.evaluate.shape_page import write_page
from groundpose.vehicles import CLASSES, shape_model

RESULTS, PAGE = Path("results/shape_models.json"), Path("docs/vehicles.md")
UNSEEN = 500
"""Bodies a class that the shape models were not made from."""
LABEL_SIGMA_M = 0.03
"""Standard deviation of a coordinate where the prior of the coefficients is weighed against the data."""
APOLLO_POINTS: dict[str, tuple[int, ...]] = {
    "left_front_wheel": (7,),
    "right_front_wheel": (51,),
    "left_rear_wheel": (20,),
    "right_rear_wheel": (37,),
    "left_headlamp": (2, 3),
    "right_headlamp": (54, 55),
    "left_taillamp": (22, 23),
    "right_taillamp": (34, 35),
    "left_windscreen_top": (8,),
    "right_windscreen_top": (49,),
    "left_rear_bumper": (28,),
    "right_rear_bumper": (29,),
    "left_rear_window_top": (24,),
    "right_rear_window_top": (33,),
    "left_belt_b": (12,),
    "right_belt_b": (45,),
    "front_plate": (58, 59, 60, 61),
    "rear_plate": (62, 63, 64, 65),
}
"""Keypoints of ApolloCar3D whose mean is ours: outer corners of lamps, corners of plates. The others of our
28 (mirrors, lower corners of both windows, last side window, front bumper) have no counterpart there."""


def real_cars(folder: Path) -> Array | None:
    """The 18 common keypoints of the real cars (79, 18, 3) in our object frame (its origin free), or None."""
    path = folder / "apollo_models.npz"
    if not path.exists():
        return None
    with np.load(path) as file:
        points = file["keypoints_3d"] @ OURS_FROM_APOLLO
    return np.stack([points[:, rows].mean(axis=1) for rows in APOLLO_POINTS.values()], axis=1)


def common(model: gp.ShapeModel) -> tuple[Array, Array]:
    """Mean (18, 3) and basis (M, 18, 3) of the common keypoints."""
    rows = [model.keypoint_names.index(name) for name in APOLLO_POINTS]
    return model.keypoints_3d[rows], model.basis[:, rows]


def check_real(model: gp.ShapeModel, cars: Array) -> dict[str, Any]:
    """How well the car model's modes describe real cars (S, 18, 3)."""
    names = list(APOLLO_POINTS)
    aligned = rigidly_aligned(cars)
    even = 0.5 * (aligned + mirrored(aligned, np.array([names.index(_partner(name)) for name in names])))
    offsets, fit = _without_offsets(model, even)
    return {
        "cars": len(cars),
        "keypoints": len(names),
        "modes": model.modes,
        "labels as they are": _described(model, aligned),
        "labels made symmetric": _described(model, even),
        "asymmetry of the labels, cm": _cm(aligned - even),
        "by keypoint": [
            {
                "keypoint": name.removeprefix("left_"),
                "offset of the definition, cm": _cm(offsets[i]),
                "residual, cm": _cm(fit.residuals[:, i]),
            }
            for i, name in enumerate(names)
            if not name.startswith("right_")
        ],
    }


def _described(model: gp.ShapeModel, cars: Array) -> dict[str, float]:
    """Residuals of fitting the modes to cars (S, 18, 3), and the fraction of their variance reached."""
    mean, basis = common(model)
    offsets, fit = _without_offsets(model, cars)
    prior = fitted(cars, mean + offsets, basis, model.eigenvalues, LABEL_SIGMA_M)
    deviations = np.abs(prior.coefficients) / np.sqrt(model.eigenvalues)
    return {
        "residual of the mean car, cm": _cm(fitted(cars, mean + offsets, basis[:0]).residuals),
        "residual, free coefficients, cm": _cm(fit.residuals),
        "residual, coefficients with their prior, cm": _cm(prior.residuals),
        "the same without regard to offsets of definitions, cm": _cm(
            fitted(cars, mean, basis, model.eigenvalues, LABEL_SIGMA_M).residuals
        ),
        "variance reached, %": 100.0 * reached(cars, basis),
        "variance reached by as many modes of the real cars themselves, %": 100.0
        * reached(cars, None, model.modes),
        "largest coefficient of a car, median, standard deviations": float(np.median(deviations.max(axis=1))),
    }


def _without_offsets(model: gp.ShapeModel, cars: Array) -> tuple[Array, Fit]:
    """What the two sets' definitions of the keypoints differ by (18, 3), and the fit that allows for it."""
    mean, basis = common(model)
    offsets = fitted(cars, mean, basis).residuals.mean(axis=0)
    return offsets, fitted(cars, mean + offsets, basis)


def check_modes(class_name: str, advance: Callable[[], None]) -> dict[str, Any]:
    """How much of the variance of bodies the model has not seen each mode holds, and what all leave."""
    model, rows = shape_model(class_name), []
    for row in outlines(class_name, UNSEEN, first=BODIES):
        rows.append(row)
        advance()
    points, boxes = (np.stack(arrays) for arrays in zip(*rows, strict=True))
    off = (points - model.keypoints_3d).reshape(UNSEEN, -1)
    basis = model.basis.reshape(model.modes, -1)
    coefficients = off @ basis.T
    fraction = np.sum(coefficients**2, axis=0) / np.sum(off**2)
    sizes = (boxes[:, 1] - boxes[:, 0])[:, [2, 1, 0]]
    return {
        "bodies of the model": BODIES,
        "unseen bodies": UNSEEN,
        "modes": model.modes,
        "variance of each mode": fraction.tolist(),
        "variance of all modes": float(fraction.sum()),
        "standard deviation of each coefficient, m": np.sqrt(model.eigenvalues).tolist(),
        "residual, cm": _cm((off - coefficients @ basis).reshape(points.shape)),
        "mean length, height, width, m": sizes.mean(axis=0).tolist(),
        "standard deviation, m": sizes.std(axis=0).tolist(),
    }


def run(data: Path | None = None) -> dict[str, Any]:
    """All checks; a progress bar counts bodies."""
    with Progress() as progress:
        bar = progress.add_task("bodies", total=len(CLASSES) * UNSEEN)
        models = {
            class_name: check_modes(class_name, lambda: progress.advance(bar)) for class_name in CLASSES
        }
    content: dict[str, Any] = {"command": "groundpose evaluate shapes", "models": models}
    cars = real_cars(data_folder(data))
    if cars is not None:
        content["real cars"] = check_real(shape_model("car"), cars)
    return content


def _partner(name: str) -> str:
    side, _, rest = name.partition("_")
    return {"left": f"right_{rest}", "right": f"left_{rest}"}.get(side, name)


def _cm(vectors: Array) -> float:
    """Root of the mean squared length of vectors (..., 3), centimetres."""
    return 100.0 * float(np.sqrt(np.mean(np.sum(vectors**2, axis=-1))))


def measure(root: Path, data: Path | None = None) -> list[Path]:
    """Measure, store, write the page and the drawings; the files of numbers and text."""
    content = run(data)
    report.write_json(root / RESULTS, content)
    drawing.main()
    write_page(content, root / PAGE)
    return [root / RESULTS, root / PAGE]
