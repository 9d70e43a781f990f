"""How far apart is what docs/reproducibility.md does not promise bit for bit.

python tests/python/apart.py                  compares other BLAS kernels and vector units of NumPy with these
python tests/python/apart.py OUT.npz          writes what this processor gives
python tests/python/apart.py ONE.npz TWO.npz  compares what two processors gave
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import groundpose as gp
import numpy as np
from groundpose import demo
from groundpose.formats.conversions import to_quaternions
from groundpose.lab.drive import labels, scene, scene_seed
from groundpose.vehicles import CLASSES, body
from kernels import run, variants

BODIES = range(20)
FRAMES = range(20)


def values() -> dict[str, np.ndarray]:
    """By what they are and their unit."""
    bodies = [body(class_name, seed) for class_name in CLASSES for seed in BODIES]
    cars = [each.keypoints_3d for each in bodies if each.class_name == CLASSES[0]]
    fitted = gp.ShapeModel.fit(cars, modes=5)
    signs = np.sign(fitted.basis.reshape(5, -1)[:, 0])[:, None, None]  # of a mode: open
    seen = [label for number in FRAMES for label in labels(scene(scene_seed(9, "validation"), number))]
    street = demo.example()
    network = gp.Pipeline(threads=1).detect(street.image, street.bboxes)
    return {
        "ShapeModel.fit, modes": signs * fitted.basis,
        "bodies, vertices, m": np.concatenate([each.vertices for each in bodies]),
        "labels, poses, m": np.array([label.t for label in seen]),
        "labels, boxes, px": np.array([label.bbox for label in seen]),
        "labels, keypoints, px": np.concatenate([label.keypoints_2d for label in seen]),
        "quaternions": to_quaternions([label.R for label in seen]),
        "network, keypoints, px": np.concatenate(network.keypoints),
        "network, scores": np.concatenate(network.scores),
    }


def write(path: Path) -> None:
    np.savez(path, **values())


def compare(one: Path, two: Path, name: str) -> None:
    """Prints the largest differences."""
    a, b = np.load(one), np.load(two)
    print(name)
    for key in a.files:
        same = a[key].shape == b[key].shape
        print(f"  {key:24}", f"{np.nanmax(np.abs(a[key] - b[key])):.1e}" if same else "other numbers of them")


def main(paths: list[Path]) -> None:
    """See the top of the file."""
    if len(paths) == 1:
        return write(paths[0])
    if len(paths) == 2:
        return compare(*paths, "difference")
    with tempfile.TemporaryDirectory() as folder:
        here, there = Path(folder) / "here.npz", Path(folder) / "there.npz"
        write(here)
        for name, changes in variants().items():
            run([sys.executable, __file__, str(there)], changes).check_returncode()
            compare(here, there, name)
    return None


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]])
