"""The whole way: an image, boxes and a view in, poses and shapes out."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, input_error, integer, number, shaped, type_error
from groundpose._checks import threads as checked_threads
from groundpose.camera_state import CameraState
from groundpose.estimate import estimate_poses
from groundpose.formats.boxes import Boxes
from groundpose.formats.detections import boxes_of
from groundpose.frame import FramePriors
from groundpose.keypoints.codec import ByteArray, usable
from groundpose.keypoints.decode import Detections
from groundpose.keypoints.image import Picture, as_rgb
from groundpose.keypoints.network import Network
from groundpose.keypoints.vehicle_poses import NOT_A_VEHICLE, VehiclePoses
from groundpose.options import Options
from groundpose.shape import ShapeModel
from groundpose.types import View
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import keypoint_indices
from groundpose.vehicles.shape_models import shape_model
from groundpose.vehicles.words import class_names

LARGEST_BATCH = 64
_ROWS = {class_name: keypoint_indices(class_name) for class_name in CLASSES}


@dataclass(frozen=True, eq=False)
class Found:
    """Keypoints of N boxes in image pixels; a row is as long as its class has keypoints.

    An unusable box and one in `no_vehicle` have no class ("") and no keypoints (NaN, scores 0). `seconds` are
    those of the steps "crop", "network" and "decode".
    """

    keypoints: list[FloatArray]
    scores: list[FloatArray]
    classes: list[str]
    class_probabilities: FloatArray
    vehicle_probability: FloatArray
    viewing_angle_probabilities: FloatArray
    no_vehicle: NDArray[np.bool_]
    seconds: dict[str, float]


@dataclass(frozen=True, eq=False)
class Look:
    """What `Pipeline.look` saw in an image: its view, the boxes as given and as (N, 4) pixels, keypoints."""

    view: View
    given: Boxes
    bboxes: FloatArray
    found: Found


class Pipeline:
    """From images to poses.

    >>> pipeline = gp.Pipeline()                          # doctest: +SKIP
    >>> poses = pipeline("street.jpg", bboxes, view)      # doctest: +SKIP
    """

    def __init__(
        self,
        network: Network | str | PathLike[str] | None = None,
        *,
        models: Mapping[str, ShapeModel] | None = None,
        options: Options | None = None,
        threads: int | None = None,
        batch_size: int = 16,
        vehicle_threshold: float | None = None,
        classes: Mapping[str, str] | None = None,
        providers: Sequence[str] | None = None,
        camera_state: CameraState | None = None,
    ) -> None:
        """Load everything once.

        Args:
            network: a `Network`, the path of one, the name of a bundled one, or None for the best of these.
            models: a shape model for each class, with that class's keypoints; None: those that ship. Classes
                left out keep theirs.
            options: of the solver; what they leave open of the certainty is the network's
                (`Network.certainty`).
            threads: of network, crops and solver, 1 or more; None: all cores. A `Network` given keeps its
                own, for the crops too.
            batch_size: most crops that the network sees at a time, at most 64: that bounds memory and how
                long Ctrl-C waits.
            vehicle_threshold: objects whose probability to be a vehicle is lower get the status
                "not_a_vehicle" and no pose; 0 to 1, None: the network's own, 0: every box is taken to hold
                a vehicle.
            classes: names (or numbers, as text) of a detector's classes that are vehicles, `{"Kombi":
                "car"}`, or none, `{"bus": "none"}`, beside the usual words (`groundpose.vehicles.words`).
            providers: what runs the network, see `Network`; not beside a `Network`, which has its own.
            camera_state: what is known of the one camera of all images; it is the `frame` of every call and
                grows with each, in the order of the calls, so that calls must not overlap.

        Raises:
            OSError: no such file. InputError: a file that is not ours, an unknown class, a model with
                another number of keypoints, a provider that is not there. TypeError: an argument of another
                type.
        """
        if isinstance(network, Network) and providers is not None:
            raise input_error("providers", "None beside a Network, which has its own", providers)
        self.network = network if isinstance(network, Network) else Network(network, threads, providers)
        if options is not None and not isinstance(options, Options):
            raise type_error("options", "Options", options)
        self.options = self.network.certainty.applied(options or Options())
        self.threads = checked_threads(threads)
        if integer("batch_size", batch_size) < 1:
            raise input_error("batch_size", "1 or more", batch_size)
        self.batch_size = min(batch_size, LARGEST_BATCH)
        self.vehicle_threshold = _threshold(vehicle_threshold, self.network)
        self.classes = class_names(classes or {})
        if camera_state is not None and not isinstance(camera_state, CameraState):
            raise type_error("camera_state", "a CameraState", camera_state)
        self.camera_state = camera_state
        self.models = {class_name: shape_model(class_name) for class_name in CLASSES} | dict(models or {})
        for class_name, model in self.models.items():
            if class_name not in CLASSES:
                raise input_error("models", f"classes of {', '.join(CLASSES)}", repr(class_name))
            if len(model.keypoints_3d) != len(_ROWS[class_name]):
                raise input_error(
                    f"models[{class_name!r}]", f"{len(_ROWS[class_name])} keypoints", len(model.keypoints_3d)
                )

    def __call__(
        self,
        image: Picture,
        bboxes: object,
        view: View,
        frame_tilt_sigma: float | None = None,
        frame: FramePriors | CameraState | None = None,
    ) -> VehiclePoses:
        """Poses of the vehicles in boxes of an image.

        Args:
            image: RGB; see `groundpose.keypoints.image.as_rgb` for what is taken.
            bboxes: (N, 4) left, top, right, bottom pixels, around whole vehicles as far as they are in the
                image, N may be 0; or the boxes of a detector as it gives them, see
                `groundpose.formats.detections`; one of another class than a vehicle's is "not_a_vehicle". A
                box without area, outside the image or not finite, or without a vehicle gives an object
                without an answer, and nothing of the others is lost.
            view: camera and tilt. A camera without `image_size` is taken to have the image's.
            frame_tilt_sigma, frame: see `estimate_poses`; `frame` is None where the pipeline has a
                `camera_state`.

        Raises:
            InputError: an image or boxes that cannot be, an image of another size than the camera's, `frame`
                beside `camera_state`.
            OSError: no such file. TypeError: an argument of another type.
        """
        return self.solve(self.look(image, bboxes, view), frame_tilt_sigma, frame)

    def look(self, image: Picture, bboxes: object, view: View) -> Look:
        """The first half of a call: what the network sees, without poses. It changes nothing here, so that
        several threads may look at several images at once. Arguments and errors as of a call."""
        if not isinstance(view, View):
            raise type_error("view", "a View", view)
        pixels = as_rgb(image)
        size = (pixels.shape[1], pixels.shape[0])
        if view.camera.image_size not in (None, size):
            raise input_error("image", f"the camera's size {view.camera.image_size}", f"{size}")
        view = replace(view, camera=replace(view.camera, image_size=size))
        given = _boxes(bboxes, size)
        boxes = np.array([box.bbox for box in given.boxes], dtype=float).reshape(-1, 4)
        others = np.array([not box.means_vehicle(self.classes) for box in given.boxes], dtype=bool)
        found = self.detect(pixels, np.where(others[:, None], np.nan, boxes))
        found.no_vehicle[others] = True
        return Look(view, given, boxes, found)

    def solve(
        self,
        look: Look,
        frame_tilt_sigma: float | None = None,
        frame: FramePriors | CameraState | None = None,
    ) -> VehiclePoses:
        """The second half: the poses of what was seen. Arguments and errors as of a call."""
        if frame is not None and self.camera_state is not None:
            raise input_error("frame", "None where the pipeline has a camera_state", type(frame).__name__)
        found = look.found
        watch = _Stopwatch(found.seconds)
        poses = estimate_poses(
            *(look.view, found.keypoints, look.bboxes, self._models(found), found.scores),
            *(self.options, self.threads),
            frame_tilt_sigma=frame_tilt_sigma,
            vehicle_probability=found.vehicle_probability,
            viewing_angle_probabilities=found.viewing_angle_probabilities,
            frame=self.camera_state if frame is None else frame,
        )
        watch.lap("solve")
        scores = np.full(poses.keypoints_2d.shape[:2], np.nan)
        for row, own in zip(scores, found.scores, strict=True):
            row[: len(own)] = own
        status = np.where(found.no_vehicle, NOT_A_VEHICLE, poses.status)
        return VehiclePoses(
            **vars(poses) | {"status": status},
            classes=np.array(found.classes, dtype=np.str_),
            class_probabilities=found.class_probabilities,
            vehicle_probability=found.vehicle_probability,
            viewing_angle_probabilities=found.viewing_angle_probabilities,
            keypoint_scores=scores,
            seconds=found.seconds,
            ids=_objects([box.id for box in look.given.boxes]),
            box_remarks=look.given.remarks,
        )

    def _models(self, found: Found) -> list[ShapeModel]:
        return [self.models[class_name or CLASSES[0]] for class_name in found.classes]

    def detect(self, image: ByteArray, bboxes: FloatArray) -> Found:
        """Keypoints of boxes (N, 4) of an image (H, W, 3) uint8, without poses."""
        seconds: dict[str, float] = {}
        watch = _Stopwatch(seconds)
        good = np.flatnonzero(usable(bboxes, image.shape[1], image.shape[0]))
        codec = self.network.codec
        windows, count = codec.windows(bboxes[good]), len(bboxes)
        detections = self._seen(image, bboxes[good], watch)
        points = codec.image_from_crop(detections.keypoints, windows)
        pixel = (windows[:, 2] - windows[:, 0]) / codec.width
        sides = (bboxes[good, 2:] - bboxes[good, :2]).max(axis=1, initial=0.0) / pixel
        scores = self.network.calibration.scores(detections, sides)
        nothing = len(_ROWS[CLASSES[0]])
        keypoints = [np.full((nothing, 2), np.nan) for _ in range(count)]
        each = [np.zeros(nothing) for _ in range(count)]
        classes, is_vehicle = [""] * count, detections.vehicle >= self.vehicle_threshold
        for i in np.flatnonzero(is_vehicle).tolist():
            row, class_name = int(good[i]), CLASSES[int(detections.class_probabilities[i].argmax())]
            own = _ROWS[class_name]
            classes[row], keypoints[row], each[row] = class_name, points[i, own], scores[i, own]
        no_vehicle = np.zeros(count, dtype=bool)
        no_vehicle[good] = ~is_vehicle
        said = {
            "class_probabilities": _of_boxes(count, good, detections.class_probabilities),
            "vehicle_probability": _of_boxes(count, good, detections.vehicle),
            "viewing_angle_probabilities": _of_boxes(count, good, detections.viewing_angle),
        }
        watch.lap("decode")
        return Found(keypoints, each, classes, **said, no_vehicle=no_vehicle, seconds=seconds)

    def _seen(self, image: ByteArray, bboxes: FloatArray, watch: _Stopwatch) -> Detections:
        """What the network says of boxes, in batches of similar size: their crops are made one batch after
        the other."""
        answers = []
        for part in np.array_split(bboxes, max(1, -(-len(bboxes) // self.batch_size))):
            crops = self.network.codec.crops(image, part, self.network.threads or 0)
            watch.lap("crop")
            answers.append(self.network.detect(crops))
            watch.lap("network")
        if len(answers) == 1:
            return answers[0]
        names = Detections.__dataclass_fields__
        return Detections(*(np.concatenate([getattr(answer, name) for answer in answers]) for name in names))


def _threshold(value: float | None, network: Network) -> float:
    threshold = network.vehicle_threshold if value is None else number("vehicle_threshold", value)
    if not 0.0 <= threshold <= 1.0:
        raise input_error("vehicle_threshold", "0 to 1, or None for the network's own", threshold)
    return threshold


def _of_boxes(count: int, good: NDArray[np.intp], said: FloatArray) -> FloatArray:
    """What is said of the usable boxes `good`, as rows of all `count` boxes; NaN for the others."""
    rows = np.full((count, *said.shape[1:]), np.nan)
    rows[good] = said
    return rows


def _objects(values: Sequence[object]) -> NDArray[np.object_]:
    """(N,) of whatever they are."""
    made = np.empty(len(values), dtype=object)
    made[:] = values
    return made


class _Stopwatch:
    """Adds up what each step took."""

    def __init__(self, seconds: dict[str, float]) -> None:
        self._seconds, self._last = seconds, time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self._seconds[name] = self._seconds.get(name, 0.0) + now - self._last
        self._last = now


def _boxes(value: object, size: tuple[int, int]) -> Boxes:
    """Boxes of an array, of rows of numbers, or as a detector gives them."""
    rows = isinstance(value, (list, tuple)) and all(isinstance(r, (list, tuple, np.ndarray)) for r in value)
    if isinstance(value, np.ndarray) or rows:
        shaped("bboxes", value, ("N", 4), ("N", 5), ("N", 6), (0,))
    return boxes_of(value, size=size).in_pixels(*size)
