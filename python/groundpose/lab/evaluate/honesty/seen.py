"""What a network says of boxes whose truth is known, one record per box, kept on disk: the slow part."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose._writing import whole_file
from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.decode import VIEWING_ANGLES
from groundpose.keypoints.network import Network
from groundpose.lab.training.crops import NOTHING
from groundpose.types import Camera, View
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS

_K = len(KEYPOINTS)
GIVEN = [
    ("kind", "<U24"),  # of place: the class of a vehicle, or what is there instead
    ("class", "u1"),  # index into CLASSES, or NOTHING
    ("R", "<f8", (3, 3)),  # true pose, camera_from_object; NaN = nothing there
    ("t", "<f8", (3,)),
    ("box", "<f8", (4,)),  # as given to network and solver
    ("view", "<f8", (8,)),  # fx, fy, cx, cy, image width and height, pitch, roll
    ("hidden", "<f8"),  # fraction hidden by others, 0 to 1
    ("cut", "<f8"),  # fraction outside the image, 0 to 1
]
"""What is known of a box: a source's part of a record."""
SEEN = np.dtype([
    *GIVEN,
    ("keypoints", "<f8", (_K, 2)),  # image pixels
    ("scores", "<f8", (_K,)),
    ("classes", "<f8", (len(CLASSES),)),  # their probabilities
    ("vehicle", "<f8"),  # probability that there is one
    ("viewing_angle", "<f8", (VIEWING_ANGLES,)),
])  # fmt: skip
_GIVEN = np.dtype(GIVEN)

Records = NDArray[np.void]
Source = Callable[[Codec], Iterator[tuple[ByteArray, Records]]]
"""From a network's codec to batches of its crops (n, height, width, 3) and their records of `GIVEN`."""


def given(count: int, kind: str, view: View, boxes: FloatArray) -> Records:
    """Records of `count` boxes of one view in which nothing is."""
    made = np.zeros(count, dtype=_GIVEN)
    made["kind"], made["class"], made["box"], made["view"] = kind, NOTHING, boxes, numbers_of(view)
    for name in ("R", "t"):
        made[name] = np.nan
    return made


def numbers_of(view: View) -> tuple[float, ...]:
    """A view of a camera without distortion as the field `view`, without height: few users know it."""
    camera = view.camera
    assert camera.image_size is not None
    return (camera.fx, camera.fy, camera.cx, camera.cy, *camera.image_size, view.pitch, view.roll)


def view_of(numbers: FloatArray) -> View:
    """The view of such a field."""
    fx, fy, cx, cy, width, height, pitch, roll = numbers.tolist()
    return View(Camera(fx, fy, cx, cy, image_size=(int(width), int(height))), pitch, roll)


def by_view(records: Records) -> Iterator[NDArray[np.intp]]:
    """Rows of the records of each view; those of one view follow each other."""
    rows = range(len(records))
    for _, members in itertools.groupby(rows, key=lambda i: records["view"][i].tobytes()):
        yield np.array(list(members))


def see(network: Network, source: Source) -> Records:
    """Run the network on all crops of a source."""
    parts = [_said(network, crops, known) for crops, known in source(network.codec) if len(known)]
    return np.concatenate(parts) if parts else np.zeros(0, dtype=SEEN)


def _said(network: Network, crops: ByteArray, known: Records) -> Records:
    codec, found = network.codec, network.detect(crops)
    windows, sides = codec.windows(known["box"]), known["box"][:, 2:] - known["box"][:, :2]
    pixel = (windows[:, 2] - windows[:, 0]) / codec.width
    made = np.zeros(len(known), dtype=SEEN)
    for name in _GIVEN.names or ():
        made[name] = known[name]
    made["keypoints"] = codec.image_from_crop(found.keypoints, windows)
    made["scores"] = network.calibration.scores(found, sides.max(axis=1) / pixel)
    made["classes"], made["viewing_angle"] = found.class_probabilities, found.viewing_angle
    made["vehicle"] = found.vehicle
    return made


def kept(folder: Path, name: str, network: Network, source: Source, tell: Callable[[str], None]) -> Records:
    """What the network says of a source, from the folder or, the first time, from the network.

    `name` tells the source from others. A file is of one network, whatever its metadata.
    """
    path = folder / f"{fingerprint(network)}-{''.join(c if c.isalnum() else '-' for c in name)}.npy"
    if not path.exists():
        tell(f"{name}: running the network")
        folder.mkdir(parents=True, exist_ok=True)
        with whole_file(path, "wb") as file:
            np.save(file, see(network, source))
    found: Records = np.load(path)
    return found


def fingerprint(network: Network) -> str:
    """16 hex digits of a network's graph, weights and calibration; certainty written into its file changes
    none of them."""
    import onnx

    model = onnx.load(str(network.path))
    del model.metadata_props[:]
    told = repr((network.calibration, network.codec))
    return hashlib.sha256(model.SerializeToString(deterministic=True) + told.encode()).hexdigest()[:16]
