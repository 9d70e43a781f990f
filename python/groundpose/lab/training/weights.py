"""Trained weights as files: float16 arrays with the account of their training, at most 16 MB a file.

A run keeps its checkpoint for going on; these files are for exporting a network, starting another run
from it, and keeping it. Checkpoints and weights say the same: `configuration`, `data`, steps, seconds and
`network`, the state of a `KeypointNetwork`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from groundpose._checks import input_error
from groundpose._writing import whole_file
from groundpose.keypoints.network import BUNDLED
from groundpose.lab.training.networks import KeypointNetwork

CHECKPOINT = "checkpoint.pt"
RELEASED = "weights"
"""Folder of the repository with the weights of bundled networks."""
_LARGEST = 15_000_000  # bytes of arrays in a file
_ABOUT = "about"
_NEW = "extras."
"""Parts of the network that another network's weights may lack."""
_NOTHING_BEFORE = {"steps": 0, "seconds": 0.0}


def initial_folder(name: str) -> Path:
    """The folder of a run or of kept weights; or of the weights of a bundled network, by its name.

    The weights of releases are not part of the installed package: they lie in `weights/NAME` of the
    repository, and beside the files of each release.

    Raises:
        InputError: a bundled network whose weights are not here.
    """
    if name not in BUNDLED:
        return Path(name)
    places = [folder / RELEASED / name for folder in (Path(), *Path(__file__).resolve().parents)]
    for place in places:
        if place.is_dir():
            return place
    raise input_error(
        f"initial {name!r}", f"the release's weights in {RELEASED}/{name} of the current folder", "none"
    )


def write_weights(folder: Path, content: dict[str, Any]) -> list[Path]:
    """Write a checkpoint's network and account into `weights-0.npz`, `weights-1.npz` ... of a folder."""
    about = {k: content[k] for k in ("config", "data", "step", "steps", "seconds", "before")}
    parts: list[dict[str, Any]] = [{_ABOUT: np.array(json.dumps(about))}]
    room = _LARGEST
    for name, value in content["network"].items():
        array = value.cpu().numpy()
        array = array.astype(np.float16) if array.dtype == np.float32 and array.ndim > 1 else array
        if array.nbytes > room:
            parts.append({})
            room = _LARGEST
        parts[-1][name], room = array, room - array.nbytes
    paths = [folder / f"weights-{i}.npz" for i in range(len(parts))]
    for path, part in zip(paths, parts, strict=True):
        with whole_file(path, "wb") as file:
            np.savez(file, **part)
    for old in set(folder.glob("weights-*.npz")) - set(paths):
        old.unlink()
    return paths


def read_weights(folder: Path) -> dict[str, Any]:
    """A run's checkpoint, or the weights kept in a folder.

    Raises:
        InputError: there are none.
    """
    checkpoint, kept = folder / CHECKPOINT, sorted(folder.glob("weights-*.npz"))
    if checkpoint.exists():
        content: dict[str, Any] = torch.load(checkpoint, map_location="cpu", weights_only=True)
        # older checkpoints lack this entry
        return {"before": dict(_NOTHING_BEFORE)} | content
    if not kept:
        raise input_error(str(folder), f"a training run ({CHECKPOINT}) or weights (weights-*.npz)", "none")
    arrays: dict[str, Any] = {}
    for path in kept:
        with np.load(path, allow_pickle=False) as file:
            arrays |= dict(file)
    about: dict[str, Any] = json.loads(str(arrays.pop(_ABOUT)))
    return about | {"network": {name: _tensor(array) for name, array in arrays.items()}}


def _tensor(array: Any) -> Tensor:
    value = torch.from_numpy(np.ascontiguousarray(array).reshape(array.shape))
    return value.float() if value.dtype == torch.float16 else value


def load_into(network: KeypointNetwork, state: dict[str, Tensor]) -> None:
    """Give a network the weights of a state; one from before the additional heads leaves these as they are.

    Raises:
        InputError: the state is of another network.
    """
    own = network.state_dict()
    fitting = {name: value for name, value in state.items() if name in own and value.shape == own[name].shape}
    missing = [name for name in own if name not in fitting and not name.startswith(_NEW)]
    if missing:
        raise input_error("weights", f"{len(own)} arrays of {network.config}", f"none for {missing[0]}")
    network.load_state_dict(own | fitting)
