"""Does the size that a network states beat the mean size of the class, on real cars?

`python -m groundpose.lab.training.sizes RUN --crops FOLDER --data FOLDER`. The size is not part of exported
networks as long as it does not. The prior is the mean of the training crops' vehicles of the class.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.formats.kitti.labels import CLASS_OF, read_labels
from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.image import as_rgb
from groundpose.lab.data import data_folder
from groundpose.lab.training.crops import Crops
from groundpose.lab.training.networks import KeypointNetwork
from groundpose.lab.training.streets import is_judged
from groundpose.lab.training.trained import trained
from groundpose.vehicles.classes import CLASSES

_NAMES = ("length", "height", "width")


def stated(network: KeypointNetwork, crops: ByteArray) -> tuple[FloatArray, FloatArray]:
    """Log length, height, width (N, 3) that a network states for crops, and their standard deviations."""
    network.eval()
    with torch.no_grad():
        pictures = torch.from_numpy(crops).permute(0, 3, 1, 2).float()
        answers = [network(x).size.double().numpy() for x in (pictures, pictures.flip(3))]
    size = 0.5 * (answers[0] + answers[1])
    return size[:, :3], np.exp(size[:, 3:])


def compared(said: FloatArray, sigma: FloatArray, prior: FloatArray, truth: FloatArray) -> dict[str, float]:
    """Errors of stated and prior log sizes (N, 3) against true ones, in percent, and their correlation."""
    numbers: dict[str, float] = {"vehicles": len(truth)}
    for i, name in enumerate(_NAMES):
        own, mean = said[:, i] - truth[:, i], prior[:, i] - truth[:, i]
        numbers |= {
            f"{name}: stated, rms %": 100 * float(np.sqrt(np.mean(own**2))),
            f"{name}: stated, bias %": 100 * float(own.mean()),
            f"{name}: stated sigma %": 100 * float(np.sqrt(np.mean(sigma[:, i] ** 2))),
            f"{name}: class, rms %": 100 * float(np.sqrt(np.mean(mean**2))),
            f"{name}: class, bias %": 100 * float(mean.mean()),
            f"{name}: correlation": float(np.corrcoef(own - mean, -mean)[0, 1]),
        }
    return numbers


def prior(crops: Crops) -> FloatArray:
    """Mean log size (C, 3) of the crops' vehicles of each class."""
    log_size = np.log(crops.labels["size"].astype(np.float64))
    known = np.isfinite(log_size).all(axis=1)
    kinds: NDArray[np.uint8] = crops.labels["kind"]
    return np.array([log_size[known & (kinds == i)].mean(axis=0) for i in range(len(CLASSES))])


def kitti_vehicles(folder: Path, codec: Codec) -> tuple[ByteArray, list[str], FloatArray]:
    """Crops of the vehicles that are evaluated, their classes and log sizes (N, 3)."""
    crops, classes, sizes = [], [], []
    for path in sorted((folder / "label_2").glob("*.txt")):
        image = as_rgb(folder / "image_2" / f"{path.stem}.png")
        for label in read_labels(path):
            if label.type in CLASS_OF and is_judged(label):
                crops.append(codec.crop(image, np.array(label.bbox)))
                classes.append(CLASS_OF[label.type])
                sizes.append((label.length, label.height, label.width))
    return np.stack(crops), classes, np.log(np.array(sizes))


def main(
    run: Path,
    crops: Annotated[Path, typer.Option(help="Folder of the training crops.")] = Path("data/crops"),
    data: Annotated[Path | None, typer.Option(help="Folder in KITTI's object layout.")] = None,
) -> None:
    """Print the comparison for held-out renders and for real cars."""
    network, _, _ = trained(run)
    codec = Codec(network.config.width, network.config.height)
    means = prior(Crops(crops, "train"))
    folder = data_folder() / "kitti" / "training" if data is None else data
    pictures, classes, truth = kitti_vehicles(folder, codec)
    cars = np.array([name == "car" for name in classes])
    said, sigma = stated(network, pictures)
    mean = means[[CLASSES.index(name) for name in classes]]
    print(json.dumps(compared(said[cars], sigma[cars], mean[cars], truth[cars]), indent=1))


if __name__ == "__main__":
    typer.run(main)
