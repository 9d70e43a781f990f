"""Contact sheets for judging the pictures: `python -m groundpose.lab.drive.sheets FOLDER`.

64 crops of each class and 8 frames, drawn from the validation split.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from groundpose._checks import FloatArray
from groundpose.lab.drive.drive import scene
from groundpose.lab.drive.labels import labels
from groundpose.lab.drive.render import Renderer
from groundpose.lab.drive.splits import scene_seed
from groundpose.vehicles import CLASSES

CROP, COLUMNS, CROPS = (128, 96), 8, 64
FRAMES, FRAME = 8, (760, 429)
# Vehicles shown: least height in the image, largest fraction cut off and hidden.
_LEAST_HEIGHT, _MOST_CUT, _MOST_HIDDEN = 25.0, 0.3, 0.5
_A_SCENE = 4  # crops per scene
_MARGIN = 1.2
_LEAST_LABELS = 6  # in a frame shown


def crop_box(bbox: FloatArray, size: tuple[int, int], margin: float = _MARGIN) -> FloatArray:
    """Left, top, right, bottom (4,) around a bbox, with a margin and the proportions of `size`."""
    middle, half = 0.5 * (bbox[:2] + bbox[2:]), 0.5 * margin * (bbox[2:] - bbox[:2])
    aspect = size[0] / size[1]
    wide = max(half[0], half[1] * aspect)
    reach = np.array([wide, wide / aspect])
    return np.concatenate([middle - reach, middle + reach])


def crops(renderer: Renderer, class_name: str, count: int) -> list[NDArray[np.uint8]]:
    """Crops of vehicles of one class from successive scenes."""
    fractions = {k: 0.7 if k == class_name else 0.1 for k in CLASSES}
    out: list[NDArray[np.uint8]] = []
    drive = 0
    while len(out) < count:
        made = scene(scene_seed(1000 * CLASSES.index(class_name) + drive, "validation"), 10, fractions)
        drive += 1
        shown = [
            x for x in labels(made)
            if x.class_name == class_name and x.bbox[3] - x.bbox[1] >= _LEAST_HEIGHT
            and x.truncation <= _MOST_CUT and x.occluded_share <= _MOST_HIDDEN
        ]  # fmt: skip
        for label in shown[:: max(1, len(shown) // _A_SCENE)][:_A_SCENE]:
            out.append(renderer.crop(made, label.index, crop_box(label.bbox, CROP), CROP))
    return out[:count]


def frames(renderer: Renderer, count: int) -> list[NDArray[np.uint8]]:
    """Frames of drives with some traffic, reduced."""
    out: list[NDArray[np.uint8]] = []
    drive = 0
    while len(out) < count:
        made = scene(scene_seed(drive, "validation"), 20)
        drive += 1
        if len(labels(made)) >= _LEAST_LABELS:
            picture = Image.fromarray(renderer.frame(made))
            out.append(np.asarray(picture.resize(FRAME, Image.Resampling.LANCZOS)))
    return out


def tiled(pictures: list[NDArray[np.uint8]], columns: int) -> Image.Image:
    """Pictures of equal size in a grid."""
    rows = [np.concatenate(pictures[i : i + columns], axis=1) for i in range(0, len(pictures), columns)]
    return Image.fromarray(np.concatenate(rows))


def main(folder: Path) -> None:
    """Write `crops_<class_name>.jpg` and `frames.jpg`."""
    folder.mkdir(parents=True, exist_ok=True)
    renderer = Renderer()
    for class_name in CLASSES:
        tiled(crops(renderer, class_name, CROPS), COLUMNS).save(
            folder / f"crops_{class_name}.jpg", quality=85
        )
    pictures = frames(renderer, FRAMES)
    tiled(pictures, 2).save(folder / "frames.jpg", quality=80)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/simulation"))
