"""A keypoint network in an ONNX file, run by onnxruntime."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import input_error, type_error
from groundpose._checks import threads as checked_threads
from groundpose._core import InputError
from groundpose.keypoints.certainty import Certainty
from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.decode import VIEWING_ANGLES, Calibration, Detections
from groundpose.keypoints.onnx import OnnxFile
from groundpose.options import Options
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS

FORMAT = "groundpose_keypoints"
"""Metadata key of our files; its value is a version of `OUTPUTS`."""
FORMAT_VERSION = "2"
_FIRST_OUTPUTS = ("keypoints", "spread", "peak", "kind_probabilities")
OUTPUTS = {"1": _FIRST_OUTPUTS, FORMAT_VERSION: (*_FIRST_OUTPUTS, "vehicle", "viewing_angle")}
"""Names of a file's outputs by its version, in the order of the fields of `Detections`."""
_LENGTHS: dict[str, tuple[int, ...]] = {
    "keypoints": (len(KEYPOINTS), 2),
    "spread": (len(KEYPOINTS),),
    "peak": (len(KEYPOINTS),),
    "kind_probabilities": (len(CLASSES),),
    "vehicle": (),
    "viewing_angle": (VIEWING_ANGLES,),
}
"""Lengths of an output's row."""
CERTAINTY = "certainty"
"""Metadata key of `Certainty.numbers`, as JSON."""
_MOST_PIXELS, _WIDEST_MARGIN = 2048, 4.0
"""Bounds of a crop's sides and margin: a damaged file must not ask for gigabytes."""
MOST_AT_ONCE = 8
"""Crops of a call of onnxruntime on the CPU, during which Ctrl-C waits: more take hardly less time each."""
_ROWS = 4
"""Crops that its kernels take together: calls cut elsewhere, or of one alone, may round otherwise."""
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
        threads, providers: as given.
        metadata: all that the file says of itself, str to str (how it was trained, on what, how good).
    """

    def __init__(
        self,
        path: str | PathLike[str] | None = None,
        threads: int | None = None,
        providers: Sequence[str] | None = None,
    ) -> None:
        """Load a network for `threads` threads (None: all cores).

        Args:
            path: a file, or the name of a bundled network: "default" (also None), the most accurate; "int8",
                more than twice as fast; "float32", as good as "int8", for processors that are slow in 8 bits.
            threads: 1 or more, at most one for each core.
            providers: what runs it, in order, by onnxruntime's names or their beginning: "cuda", "tensorrt",
                "coreml", "openvino", "cpu"; the CPU runs what the others cannot. None: the CPU alone.

        Raises:
            OSError: no such file; the bundled one is not part of this installation.
            InputError: not a network of ours, one with other keypoints, a damaged one, a provider that this
                installation of onnxruntime does not have.
        """
        if path is not None and not isinstance(path, (str, PathLike)):
            raise type_error("path", "a path", path)
        name = "default" if path is None else fspath(path)
        self.path = bundled(name) if name in BUNDLED else Path(name)
        if not self.path.exists():
            raise FileNotFoundError(2, _NOT_BUNDLED if name in BUNDLED else _no_file(name), str(self.path))
        self._file = OnnxFile(self.path, threads, providers)
        self.threads, self.providers = (
            checked_threads(threads),
            None if providers is None else tuple(providers),
        )
        self.metadata = self._file.metadata
        self.version = self.metadata.get(FORMAT, "")
        if self.version not in OUTPUTS:
            versions = " or ".join(OUTPUTS)
            self._file.fail(f"a keypoint network of version {versions}", "another ONNX file")
        for name, wanted in (("keypoints", [k.name for k in KEYPOINTS]), ("kinds", list(CLASSES))):
            if self._file.json(name) != wanted:
                self._file.fail(f"the {name} of this version", "others")
        width, height = (self._file.whole(side, 1, _MOST_PIXELS) for side in ("width", "height"))
        self.codec = Codec(width, height, self._file.number("margin", 0.0, _WIDEST_MARGIN))
        self.calibration = Calibration.of(self._file.numbers("score_calibration", (3, 5)))
        self.certainty = self._certainty()
        self.vehicle_threshold = VEHICLE_THRESHOLD
        if "vehicle_threshold" in self.metadata:
            self.vehicle_threshold = self._file.number("vehicle_threshold", 0.0, 1.0)
        self._file.shaped("crops", "input", (None, height, width, 3))
        for name in OUTPUTS[self.version]:
            self._file.shaped(name, "output", (None, *_LENGTHS[name]))

    def _certainty(self) -> Certainty:
        """That of the file. Raises InputError where the options of the solver would not take it."""
        stored = self._file.json(CERTAINTY) if CERTAINTY in self.metadata else {}
        try:
            certainty = Certainty.of(stored)
            certainty.applied(Options())
        except (InputError, TypeError, ValueError, AttributeError) as error:
            self._file.fail("numbers of `Certainty`", error, f"metadata {CERTAINTY!r}")
        return certainty

    def __reduce__(self) -> tuple[type[Network], tuple[str, int | None, tuple[str, ...] | None]]:
        """Pickled as the place of its file, which another process loads again."""
        return Network, (str(self.path.resolve()), self.threads, self.providers)

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
        names = OUTPUTS[self.version]
        if len(crops) == 0:
            return Detections.of(*(np.zeros((0, *_LENGTHS[name])) for name in _FIRST_OUTPUTS))
        if self.providers is not None or len(crops) <= MOST_AT_ONCE:
            return Detections.of(*self._answers(names, crops))
        parts = [self._answers(names, part) for part in np.split(crops, cuts(len(crops)))]
        return Detections.of(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def _answers(self, names: Sequence[str], crops: ByteArray) -> list[NDArray[Any]]:
        """The outputs of one call. Raises InputError where they are not as the file says."""
        answers = self._file.run(names, crops=crops)
        for name, answer in zip(names, answers, strict=True):
            if answer.shape != (len(crops), *_LENGTHS[name]):
                self._file.fail(f"{len(crops)} rows {_LENGTHS[name]} of {name}", answer.shape)
        return answers


def cuts(crops: int) -> list[int]:
    """Where so many crops are cut, such that no call has one alone."""
    places = list(range(MOST_AT_ONCE, crops, MOST_AT_ONCE))
    if places and crops - places[-1] == 1:
        places[-1] -= _ROWS
    return places
