"""True poses of the vehicles in a folder of crops: their scenes are made again, once, and the poses kept."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundpose._writing import whole_file
from groundpose.lab.drive import labels, scene, scene_seed
from groundpose.lab.drive.rigs import RIGS, Rigs
from groundpose.lab.evaluate.honesty.seen import Records
from groundpose.lab.evaluate.networks.renders import labelled
from groundpose.lab.training.crops import NOTHING, Crops

BOX_TOLERANCE = 2.0
"""Pixels by which a box may differ: a pose outlasts small changes of how boxes are cut."""
POSE = np.dtype([("box", "<f4", (4,)), ("R", "<f8", (3, 3)), ("t", "<f8", (3,))])


def folder_of(crops: Path) -> Path:
    """Where everything of this measurement is kept."""
    return crops / "evaluated" / "honesty"


def poses(folder: Path, split: str, crops: Crops) -> Records:
    """(N,) of the crops of a split, NaN where nothing is; from the folder when they are of the same boxes.

    Raises:
        InputError: another version of the drive drew the crops.
    """
    path = folder_of(folder) / f"poses-{split}.npy"
    if path.exists():
        found: Records = np.load(path)
        if np.array_equal(found["box"], crops.labels["box"]):
            return found
    found = _simulated(split, crops)
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path, "wb") as file:
        np.save(file, found)
    return found


def _simulated(split: str, crops: Crops) -> Records:
    made = np.zeros(len(crops), dtype=POSE)
    made["box"], made["R"], made["t"] = crops.labels["box"], np.nan, np.nan
    vehicles = np.flatnonzero(crops.labels["kind"] != NOTHING)
    rigs, seed = _rigs(crops.index["source"]), scene_seed(crops.index["seed"], split)
    for rows in _by_frame(crops.labels["frame"], vehicles):
        frame = scene(seed, int(crops.labels["frame"][rows[0]]), rigs=rigs)
        seen = {label.index: label for label in labels(frame)}
        for i in rows:
            label = labelled(seen, crops.labels[i], BOX_TOLERANCE)
            made["R"][i], made["t"][i] = label.R, label.t
    return made


def _rigs(source: str) -> Rigs:
    """The rigs that the index of a folder names; "mixed" where it names none."""
    named = re.search(r"rigs='(\w+)'", source)
    return RIGS[named[1] if named else "mixed"]


def _by_frame(frames: NDArray[np.int64], rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    if len(rows) == 0:
        return []
    order = rows[np.argsort(frames[rows], kind="stable")]
    return np.split(order, np.flatnonzero(np.diff(frames[order])) + 1)
