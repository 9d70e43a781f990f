"""`python -m groundpose.lab.bodies.make_models`: shape models from the principal components of many bodies.

Bodies are built in alignment: in metres, in one frame, standing on the ground with the origin under the
middle of the box. There is no Procrustes alignment, because it would remove size, which varies between
vehicles, and position, to which a pose is relative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from rich.progress import Progress

from groundpose._checks import FloatArray
from groundpose.lab.bodies.catalogue import outline
from groundpose.shape import ShapeModel
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import keypoint_names
from groundpose.vehicles.shape_models import FOLDER

BODIES = 4000
"""Bodies of each class: seeds 0 to `BODIES - 1`."""
LEFT_M = 0.035
"""Modes are kept until the root mean square distance to the keypoints of a body falls to this, metres: below
the noise of a detector's keypoints, which is 1 to 3 % of the vehicle."""
FEWEST, MOST = 5, 10
"""Smallest and largest number of modes; the core takes at most 10."""


def outlines(class_name: str, count: int, first: int = 0) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Keypoints (P, 3) and 3D box (2, 3) of the bodies with seeds `first` to `first + count - 1`."""
    return (outline(class_name, seed) for seed in range(first, first + count))


def variances(stack: FloatArray) -> FloatArray:
    """Variance (3 P,) of aligned keypoints (S, P, 3) along each principal component, decreasing, m^2."""
    flat = (stack - stack.mean(axis=0)).reshape(len(stack), -1)
    return np.clip(np.linalg.eigvalsh(flat.T @ flat / (len(stack) - 1))[::-1], 0.0, None)


def modes_needed(stack: FloatArray) -> int:
    """Number of modes that leave less than `LEFT_M`."""
    variance = variances(stack)
    left = np.sqrt((variance.sum() - np.cumsum(variance)).clip(0.0) / stack.shape[1])
    return int(np.clip(np.count_nonzero(left > LEFT_M) + 1, FEWEST, MOST))


def fit(class_name: str, stack: FloatArray, boxes: FloatArray) -> ShapeModel:
    """The shape model of keypoints (S, P, 3) and boxes (S, 2, 3); its box follows the shape."""
    modes = modes_needed(stack)
    model = ShapeModel.fit(
        stack, modes, bbox_3d=boxes, keypoint_names=keypoint_names(class_name), name=class_name
    )
    # The sign of a mode is arbitrary; it is fixed here so that every machine writes the same file.
    flat = model.basis.reshape(modes, -1)
    largest = flat[np.arange(modes), np.abs(flat.round(6)).argmax(axis=1)]
    sign = np.sign(largest)[:, None, None]
    assert model.bbox_basis is not None
    return ShapeModel(
        model.keypoints_3d.round(6),
        model.bbox_3d.round(6),
        (sign * model.basis).round(6),
        model.eigenvalues.round(6),
        model.keypoint_names,
        name=class_name,
        bbox_basis=(sign * model.bbox_basis).round(6),
    )


def make(
    folder: Path = FOLDER, count: int = BODIES, advance: Callable[[str], None] = lambda class_name: None
) -> None:
    """Write `CLASS.npz` of every class into `folder`; `advance` is called after every body."""
    folder.mkdir(parents=True, exist_ok=True)
    for class_name in CLASSES:
        rows = []
        for row in outlines(class_name, count):
            rows.append(row)
            advance(class_name)
        points, boxes = (np.stack(arrays) for arrays in zip(*rows, strict=True))
        fit(class_name, points, boxes).save(folder / f"{class_name}.npz")


def main() -> None:
    """Write the models that ship."""
    with Progress() as progress:
        bars = {class_name: progress.add_task(class_name, total=BODIES) for class_name in CLASSES}
        make(advance=lambda class_name: progress.advance(bars[class_name]))


if __name__ == "__main__":
    main()
