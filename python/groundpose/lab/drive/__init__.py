"""The virtual drive: roads, traffic, light and a camera that tilts, with exact labels and pictures.

>>> from groundpose.lab.drive import labels, scene, scene_seed
>>> frame = scene(scene_seed(0, "train"), 3)
>>> frame.split, all(label.class_name == frame.vehicles[label.index].class_name for label in labels(frame))
('train', True)
"""

from groundpose.lab.drive.drive import scene
from groundpose.lab.drive.labels import HIDDEN, OUTSIDE, VISIBLE, Label, labels
from groundpose.lab.drive.rigs import CAMERA, RIGS
from groundpose.lab.drive.scene import Light, Prop, Scene, Vehicle
from groundpose.lab.drive.splits import SPLITS, scene_seed, split_of

__all__ = [
    "CAMERA",
    "HIDDEN",
    "OUTSIDE",
    "RIGS",
    "SPLITS",
    "VISIBLE",
    "Label",
    "Light",
    "Prop",
    "Scene",
    "Vehicle",
    "labels",
    "scene",
    "scene_seed",
    "split_of",
]
