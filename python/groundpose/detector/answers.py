"""What a detector's network answers, and how each layout of its outputs is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, input_error, shape_text
from groundpose.detector.preparation import Size

STRIDES = ((8, 16, 32), (8, 16, 32, 64), (4, 8, 16, 32), (16, 32))
"""Pixels between the cells of the grids whose boxes stand one after the other."""
_FARTHEST, _LONGEST = 32.0, 8.0
"""A box that YOLOX has not decoded yet is not so many cells off its own, nor is the logarithm of its size."""
_MOST_CLASSES = 1e6
_SOME_OBJECT = 0.05
"""Objectness of boxes that may be kept."""
_SLACK = 1e-3
"""Of a probability in half precision."""


@dataclass(frozen=True)
class Found:
    """Boxes (N, 4) left, top, right, bottom pixels of the input, their scores and classes (N,), of `count`
    classes; None: the answer does not say how many there are."""

    boxes: FloatArray
    scores: FloatArray
    classes: NDArray[np.int64]
    count: int | None = None


@dataclass(frozen=True)
class Answer:
    """The outputs of a network for one picture.

    Attributes:
        outputs: by name, each with the batch axis it has.
        size: of the input. classes: how many the file names; None: it names none.
    """

    outputs: Mapping[str, NDArray[Any]]
    size: Size
    classes: int | None = None

    @cached_property
    def shapes(self) -> str:
        """In words."""
        return ", ".join(f"{name} {shape_text(out.shape)}" for name, out in self.outputs.items())

    @cached_property
    def tables(self) -> dict[str, FloatArray]:
        """Outputs with three axes, of the first picture; what is infinite is not known."""
        return {name: _finite(out[0]) for name, out in self.outputs.items() if out.ndim == 3 and len(out)}

    @property
    def table(self) -> FloatArray:
        """The only one of `tables`; empty if there are none or several."""
        return next(iter(self.tables.values())) if len(self.tables) == 1 else np.empty((0, 0))

    @cached_property
    def pair(self) -> tuple[FloatArray, FloatArray] | None:
        """Boxes (N, 4) and logits (N, C) of a transformer's queries, by their names, else by their shapes."""
        tables = self.tables
        boxes = [name for name in tables if name in ("dets", "pred_boxes", "boxes")]
        logits = [name for name in tables if name in ("labels", "logits", "pred_logits", "scores")]
        if not boxes or not logits:
            boxes = [name for name, table in tables.items() if table.shape[1] == 4]
            logits = [name for name in tables if name not in boxes]
        if len(boxes) != 1 or len(logits) != 1 or len(tables[boxes[0]]) != len(tables[logits[0]]):
            return None
        return tables[boxes[0]], tables[logits[0]]

    def strides(self, count: int) -> tuple[int, ...]:
        """Of the grids that have together so many cells; () if none have."""
        return next((each for each in STRIDES if _cells(self.size, each) == count), ())


def _finite(table: NDArray[Any]) -> FloatArray:
    numbers = np.asarray(table, dtype=float)
    return np.where(np.isfinite(numbers), numbers, np.nan)


def _cells(size: Size, strides: tuple[int, ...]) -> int:
    return sum((size[0] // stride) * (size[1] // stride) for stride in strides)


def columns_of_boxes(answer: Answer) -> Found:
    """(4 + C, N): centre and size in pixels, scores of the classes."""
    return _best(_corners(answer.table.T[:, :4]), _class_scores(answer, answer.table.T[:, 4:]))


def rows_with_objectness(answer: Answer) -> Found:
    """(N, 5 + C): centre and size in pixels, that there is an object, scores of the classes."""
    rows = answer.table
    return _best(_corners(rows[:, :4]), _objectness(rows) * _class_scores(answer, rows[:, 5:]))


def yolox_rows(answer: Answer) -> Found:
    """(N, 5 + C), in pixels or, exported without `--decode_in_inference`, against the cells of the grids."""
    rows = answer.table
    boxes = rows[:, :4]
    if _are_against_cells(rows):
        cells, stride = _grid(answer.size, answer.strides(len(rows)))
        with np.errstate(over="ignore"):  # where there is nothing
            sides = np.exp(boxes[:, 2:]) * stride
        boxes = np.concatenate([(boxes[:, :2] + cells) * stride, sides], axis=1)
    return _best(_corners(boxes), _objectness(rows) * _class_scores(answer, rows[:, 5:]))


def _are_against_cells(rows: FloatArray) -> bool:
    """Whether boxes (N, 5 + C) are still offsets: those of objects all are small, and most of all."""
    near = (np.abs(rows[:, :2]).max(axis=1) <= _FARTHEST) & (rows[:, 2:4].max(axis=1) <= _LONGEST)
    return bool(near[rows[:, 4] >= _SOME_OBJECT].all() and np.median(near) == 1.0)


def _grid(size: Size, strides: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """(N, 2) column and row of the cells of all grids, and (N, 1) their strides."""
    cells = [np.indices((size[1] // s, size[0] // s)).reshape(2, -1)[::-1].T for s in strides]
    return np.concatenate(cells).astype(float), np.repeat(strides, [len(c) for c in cells])[:, None]


def final_rows(answer: Answer) -> Found:
    """(N, 6): corners in pixels, score, class."""
    rows = answer.table
    return Found(rows[:, :4], _probabilities(rows[:, 4]), _kinds(rows[:, 5]))


def final_fractions(answer: Answer) -> Found:
    """(N, 6): centre and size as fractions of the input, score, class."""
    found = final_rows(answer)
    return replace(found, boxes=_corners(found.boxes * (*answer.size, *answer.size)))


def numbered_rows(answer: Answer) -> Found:
    """(N, 7): picture, corners in pixels, class, score."""
    rows = _finite(next(iter(answer.outputs.values())))
    rows = rows[rows[:, 0] == 0.0]
    return Found(rows[:, 1:5], _probabilities(rows[:, 6]), _kinds(rows[:, 5]))


def fractions(answer: Answer) -> Found:
    """(N, 4 + C): centre and size as fractions of the input, scores of the classes."""
    rows = answer.table
    return _best(_corners(rows[:, :4] * (*answer.size, *answer.size)), _class_scores(answer, rows[:, 4:]))


def labelled(answer: Answer) -> Found:
    """`labels` (1, N), `boxes` (1, N, 4) corners in pixels, `scores` (1, N)."""
    labels, boxes, scores = (_finite(answer.outputs[name][0]) for name in ("labels", "boxes", "scores"))
    if not (len(labels),) == labels.shape == scores.shape or boxes.shape != (len(labels), 4):
        raise input_error("outputs", "as many labels, boxes of four numbers and scores", answer.shapes)
    return Found(boxes, _probabilities(scores), _kinds(labels))


def each_class_apart(answer: Answer) -> Found:
    """Boxes as fractions, and logits of classes that do not exclude each other."""
    boxes, logits = _pair(answer)
    scores = 1.0 / (1.0 + np.exp(-np.clip(logits, -80.0, 80.0)))
    return _best(boxes, logits if _are_probabilities(logits) else scores)


def one_class_or_none(answer: Answer) -> Found:
    """Boxes as fractions, and logits of classes the last of which is that there is nothing."""
    boxes, logits = _pair(answer)
    odds = np.exp(logits - logits.max(axis=1, keepdims=True, initial=-np.inf))
    scores = logits if _are_probabilities(logits) else odds / odds.sum(axis=1, keepdims=True)
    return _best(boxes, scores[:, :-1])


def _pair(answer: Answer) -> tuple[FloatArray, FloatArray]:
    assert answer.pair is not None
    boxes, logits = answer.pair
    return _corners(boxes * (*answer.size, *answer.size)), logits


def _corners(boxes: FloatArray) -> FloatArray:
    """Left, top, right, bottom of centre, width and height."""
    middle, half = boxes[:, :2], 0.5 * boxes[:, 2:]
    return np.concatenate([middle - half, middle + half], axis=1)


def _objectness(rows: FloatArray) -> FloatArray:
    return _probabilities(rows[:, 4:5])


def _class_scores(answer: Answer, columns: FloatArray) -> FloatArray:
    """Those of the classes that the file names: masks and keypoints may stand behind them."""
    count = columns.shape[1] if answer.classes is None else answer.classes
    if not 1 <= count <= columns.shape[1]:
        raise input_error("names", f"{columns.shape[1]} classes as in {answer.shapes}", count)
    return _probabilities(columns[:, :count])


def _best(boxes: FloatArray, scores: FloatArray) -> Found:
    """Each box with its likeliest class."""
    classes = scores.argmax(axis=1)
    best = np.take_along_axis(scores, classes[:, None], axis=1)[:, 0]
    return Found(boxes, best, classes, scores.shape[1])


def _kinds(numbers: FloatArray) -> NDArray[np.int64]:
    """Numbers of classes; -1 for what is none."""
    return np.where(np.abs(numbers) < _MOST_CLASSES, numbers, -1.0).astype(np.int64)


def _probabilities(scores: FloatArray) -> FloatArray:
    if not _are_probabilities(scores):
        raise input_error("scores", "0 to 1", f"{np.nanmin(scores):g} to {np.nanmax(scores):g}")
    return scores


def _are_probabilities(scores: FloatArray) -> bool:
    """Nothing is said of NaN, which no box is kept for."""
    return not bool(((scores < -_SLACK) | (scores > 1.0 + _SLACK)).any())
