"""2D boxes of a picture, by a detector of the user's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np

from groundpose._checks import input_error, integer, number, type_error
from groundpose._core import InputError
from groundpose.detector.answers import Answer, Found
from groundpose.detector.layouts import COCO, COCO_WITH_GAPS, Layout, known, layout_of
from groundpose.detector.network import PictureNetwork
from groundpose.detector.preparation import Placed, Size
from groundpose.detector.suppression import suppressed
from groundpose.formats.boxes import Box, Boxes
from groundpose.keypoints.codec import ByteArray
from groundpose.keypoints.image import Picture, as_rgb
from groundpose.vehicles.words import numbered_name

OVERLAP = 0.65
"""Intersection over union from which two boxes of a class are of one object."""
_FIRST_NUMBER = {None: 0, COCO: 0, COCO_WITH_GAPS: 1}
"""The number of COCO's first class by how many classes there are; None: the network does not say."""


class Detector:
    """A detector that was exported to ONNX: YOLOX, YOLOv5 to YOLO26, RT-DETR, D-FINE, RF-DETR, DETR.

    What kind it is is recognised by what it answers to a grey picture. Classes have the names of the file
    (ultralytics writes them), else those of COCO where it answers 80 or 91 classes or does not say how many.

    >>> detector = gp.Detector("yolox_s.onnx")                     # doctest: +SKIP
    >>> poses = gp.Pipeline()(image, detector(image), view)        # doctest: +SKIP

    Attributes:
        path: the file. size: width and height of the network's input.
        layout: the detectors whose outputs are like these. min_score: boxes with a lower score are left out.
        names: of the classes by number, as far as they are known.
        metadata: all that the file says of itself, str to str.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        threads: int | None = None,
        *,
        min_score: float | None = None,
        names: Sequence[str] | Mapping[int, str] | None = None,
        size: Size | None = None,
    ) -> None:
        """Load the network for `threads` threads (None: all cores) and ask it once.

        Args:
            path: the ONNX file.
            threads: 1 or more.
            min_score: 0 to 1; None: 0.3 for the YOLO family, 0.5 for transformers, whose scores are higher.
            names: of the classes by number, instead of the file's.
            size: width and height of the input where the file leaves them open; None: what its metadata say,
                else 640 x 640.

        Raises:
            OSError: no such file. InputError: no ONNX network, or one whose outputs are of no known layout.
            TypeError: an argument of another type.
        """
        if not isinstance(path, (str, PathLike)):
            raise type_error("path", "a path", path)
        self._arguments = {"min_score": min_score, "names": names, "size": size}
        self._threads = threads
        self._network = PictureNetwork(path, threads, None if size is None else _checked_size(size))
        self.path, self.size, self.metadata = self._network.path, self._network.size, self._network.metadata
        self._names = self._network.names if names is None else _checked_names(names)
        self._layout = self._recognised()
        self.layout = self._layout.name
        self.min_score = (
            self._layout.family.min_score if min_score is None else number("min_score", min_score)
        )
        if not 0.0 <= self.min_score <= 1.0:
            raise input_error("min_score", "0 to 1", self.min_score)

    def _recognised(self) -> Layout:
        """The layout of the answer to a grey picture; the classes are counted in it too."""
        width, height = self.size
        answer = self._network.answer(np.full((1, 3, height, width), 0.5, dtype=np.float32))
        layout = layout_of(answer)
        if layout is None:
            raise input_error(str(self.path), f"outputs of a detector ({known()})", answer.shapes)
        self._count = self._read(layout, answer).count
        return layout

    def _read(self, layout: Layout, answer: Answer) -> Found:
        try:
            return layout.read(answer)
        except InputError as error:
            raise InputError(f"{self.path}: {error}") from None
        except (ValueError, IndexError, TypeError):
            expected = f"outputs {layout.outputs} as of {layout.name}"
            raise input_error(str(self.path), expected, answer.shapes) from None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled as the place of its file, which another process loads again."""
        return _loaded, (str(self.path.resolve()), self._threads, self._arguments)

    def __str__(self) -> str:
        """File, kind, size of the input, classes."""
        width, height = self.size
        return f"{self.path.name}: {self.layout}; {width} x {height}; {self._classes()}"

    def __repr__(self) -> str:
        """The same."""
        return f"Detector({self})"

    def _classes(self) -> str:
        if self._names:
            return f"{len(self._names)} classes"
        return "classes of COCO" if self._count in _FIRST_NUMBER else f"{self._count} classes without names"

    @property
    def names(self) -> dict[int, str]:
        """Of the classes by number, as far as they are known."""
        return {kind: self._name(kind) for kind in (self._names or range(self._count or COCO))}

    def _name(self, kind: int) -> str:
        if self._names or self._count not in _FIRST_NUMBER:
            return self._names.get(kind, f"class {kind}")
        return numbered_name(kind, _FIRST_NUMBER[self._count])

    def __call__(self, image: Picture) -> Boxes:
        """The boxes of everything that it finds in an image, the surest first.

        Args:
            image: see `groundpose.keypoints.image.as_rgb` for what is taken.

        Returns:
            Boxes with names, numbers of classes and scores; `Pipeline` takes them, and those that are no
            vehicles get the status "not_a_vehicle".

        Raises:
            OSError: no such file. InputError: no picture, or an answer that cannot be read. TypeError: an
            argument of another type.
        """
        pixels: ByteArray = as_rgb(image)
        picture, placed = self._layout.family.preparation.prepared(pixels, self.size)
        found = self._kept(self._read(self._layout, self._network.answer(picture)), placed)
        rows = zip(found.boxes.tolist(), found.scores.tolist(), found.classes.tolist(), strict=True)
        boxes = (
            Box((left, top, right, bottom), k, self._name(kind), score, class_id=kind)
            for k, ((left, top, right, bottom), score, kind) in enumerate(rows)
        )
        return Boxes(tuple(boxes), size=placed.image)

    def _kept(self, found: Found, placed: Placed) -> Found:
        """In pixels of the image, the surest first: those that are sure enough, no second of an object, and
        inside the image."""
        sure = np.flatnonzero((found.scores >= self.min_score) & np.isfinite(found.boxes).all(axis=1))
        overlap = OVERLAP if self._layout.family.overlapping else None
        once = sure[suppressed(found.boxes[sure], found.scores[sure], found.classes[sure], overlap)]
        boxes = placed.in_image(found.boxes[once])
        inside = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
        kept = once[inside]
        return Found(boxes[inside], found.scores[kept], found.classes[kept], found.count)


def _checked_size(size: object) -> Size:
    if not isinstance(size, (tuple, list)) or len(size) != 2:
        raise type_error("size", "(width, height)", size)
    width, height = (integer("size", side) for side in size)
    if min(width, height) < 1:
        raise input_error("size", "positive numbers", size)
    return width, height


def _checked_names(names: object) -> dict[int, str]:
    if isinstance(names, (list, tuple)):
        names = dict(enumerate(names))
    if not isinstance(names, Mapping):
        raise type_error("names", "names of classes by number", names)
    for kind, name in names.items():
        if not isinstance(name, str):
            raise type_error(f"names[{kind}]", "a str", name)
    return {integer("names", kind): name for kind, name in names.items()}


def _loaded(path: str, threads: int | None, arguments: dict[str, Any]) -> Detector:
    return Detector(path, threads, **arguments)
