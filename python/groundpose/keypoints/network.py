"""A keypoint network in an ONNX file, run by onnxruntime."""

from __future__ import annotations

import json
from difflib import get_close_matches
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import input_error, integer, type_error
from groundpose.keypoints.certainty import Certainty
from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.decode import Calibration, Detections
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS

FORMAT = "groundpose_keypoints"
"""Metadata key of our files; its value is a version of `OUTPUTS`."""
FORMAT_VERSION = "2"
_FIRST_OUTPUTS = ("keypoints", "spread", "peak", "kind_probabilities")
OUTPUTS = {"1": _FIRST_OUTPUTS, FORMAT_VERSION: (*_FIRST_OUTPUTS, "vehicle", "viewing_angle")}
"""Names of a file's outputs by its version, in the order of the fields of `Detections`."""
CERTAINTY = "certainty"
"""Metadata key of `Certainty.numbers`, as JSON."""
VEHICLE_THRESHOLD = 0.5
"""For files without the metadata key `vehicle_threshold`."""
MODELS = Path(__file__).parent / "models"
BUNDLED = {"default": "default.onnx", "int8": "int8.onnx", "float32": "float32.onnx"}
"""Files that come with the package, by name: "default" asks two networks in 8-bit arithmetic, "int8" the
smaller of them alone, "float32" the same without quantising."""
_NOT_BUNDLED = (
    "the bundled network is not part of this installation; give the file of one "
    "or make one with `groundpose train`"
)


def bundled(name: str = "default") -> Path:
    """The file of a network of `BUNDLED`, whether it is there or not."""
    return MODELS / BUNDLED[name]


def _no_file(name: str) -> str:
    """What is said of a name that is neither a file nor one of ours, though it may be meant to be."""
    meant = get_close_matches(name.lower(), BUNDLED, 1)
    ours = "" if Path(name).suffix else f"; networks of the package: {', '.join(BUNDLED)}"
    return "No such file or directory" + (f"; did you mean {meant[0]}?" if meant else ours)


class Network:
    """A trained network: crops in; out come keypoints with spread, probabilities of the classes, of the 16
    viewing angles, and that there is a vehicle at all. Files of version "1" lack the last two: to them every
    crop shows a vehicle (probability 1), seen from an unknown side (NaN).

    Attributes:
        path: the file. codec: its crops' size and margin. calibration: of its scores. version: of its format.
        certainty: how sure poses of its keypoints are (metadata key `certainty`).
        vehicle_threshold: the probability below which a crop is taken to show no vehicle.
        metadata: all that the file says of itself, str to str (how it was trained, on what, how good).
    """

    def __init__(self, path: str | PathLike[str] | None = None, threads: int | None = None) -> None:
        """Load a network for `threads` threads (None: all cores).

        Args:
            path: a file, or the name of a bundled network: "default" (also None), the most accurate; "int8",
                more than twice as fast; "float32", as good as "int8", for processors that are slow in 8 bits.
            threads: 1 or more.

        Raises:
            OSError: no such file; the bundled one is not part of this installation.
            InputError: not a network of ours, or one with other keypoints.
        """
        if path is not None and not isinstance(path, (str, PathLike)):
            raise type_error("path", "a path", path)
        name = "default" if path is None else fspath(path)
        self.path = bundled(name) if name in BUNDLED else Path(name)
        if not self.path.exists():
            raise FileNotFoundError(2, _NOT_BUNDLED if name in BUNDLED else _no_file(name), str(self.path))
        self._session = _session(self.path, threads)
        self._threads = threads
        self.metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        self.version = self.metadata.get(FORMAT, "")
        if self.version not in OUTPUTS:
            versions = " or ".join(OUTPUTS)
            raise input_error(
                str(self.path), f"a keypoint network of version {versions}", "another ONNX file"
            )
        missing = set(OUTPUTS[self.version]) - {output.name for output in self._session.get_outputs()}
        if missing:
            raise input_error(str(self.path), f"the outputs of version {self.version}", f"no {min(missing)}")
        for name, wanted in (("keypoints", [k.name for k in KEYPOINTS]), ("kinds", list(CLASSES))):
            if json.loads(self.metadata[name]) != wanted:
                raise input_error(str(self.path), f"the {name} of this version", "others")
        size = (int(self.metadata["width"]), int(self.metadata["height"]))
        self.codec = Codec(*size, float(self.metadata["margin"]))
        self.calibration = Calibration.of(json.loads(self.metadata["score_calibration"]))
        self.certainty = Certainty.of(json.loads(self.metadata.get(CERTAINTY, "{}")))
        self.vehicle_threshold = float(self.metadata.get("vehicle_threshold", VEHICLE_THRESHOLD))

    def __reduce__(self) -> tuple[type[Network], tuple[str, int | None]]:
        """Pickled as the place of its file, which another process loads again."""
        return Network, (str(self.path.resolve()), self._threads)

    def __repr__(self) -> str:
        """File and size of a crop."""
        return f"Network({self.path.name!r}, {self.codec.width} x {self.codec.height})"

    def detect(self, crops: ByteArray) -> Detections:
        """The answer for crops (N, height, width, 3) uint8, RGB. Raises InputError for another shape."""
        wanted = (self.codec.height, self.codec.width, 3)
        if crops.dtype != np.uint8 or crops.ndim != 4 or crops.shape[1:] != wanted:
            raise input_error(
                "crops", f"uint8 of shape (N, {wanted[0]}, {wanted[1]}, 3)", f"{crops.dtype} {crops.shape}"
            )
        if len(crops) == 0:
            shapes = ((0, len(KEYPOINTS), 2), (0, len(KEYPOINTS)), (0, len(KEYPOINTS)), (0, len(CLASSES)))
            return Detections.of(*(np.zeros(shape) for shape in shapes))
        return Detections.of(*self._session.run(list(OUTPUTS[self.version]), {"crops": crops}))


def _session(path: Path, threads: int | None) -> Any:
    import onnxruntime

    path.open("rb").close()  # OSError in Python's own words
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    if threads is not None:
        if integer("threads", threads) < 1:
            raise input_error("threads", "1 or more, or None for all cores", threads)
        options.intra_op_num_threads = threads
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has its own class for each of a dozen kinds of damage
        raise input_error(str(path), "an ONNX network", str(error).splitlines()[0][:120]) from None
