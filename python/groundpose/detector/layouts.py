"""The layouts of detectors' outputs: one table says how each is recognised, prepared for and read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from groundpose.detector import answers
from groundpose.detector.answers import Answer, Found
from groundpose.detector.preparation import (
    CORNER_BGR,
    LETTERBOX,
    STRETCHED,
    STRETCHED_IMAGENET,
    Preparation,
)

ANCHORS = 3
"""Boxes that YOLOv5 answers for each cell of its grids."""
CELLS = ((8, 16, 32), (8, 16, 32, 64))
"""Strides of YOLOX's grids."""
MOST_QUERIES = 1000
"""Boxes of a transformer; grids have more."""
COCO, COCO_WITH_GAPS = 80, 91
"""Classes of COCO as detectors number them from 0, and as COCO itself does, of which 0 is none."""


@dataclass(frozen=True)
class Family:
    """What layouts have in common.

    Attributes:
        preparation: of pictures.
        min_score: what the detectors' own programs leave out is below it.
        overlapping: whether an object may have several boxes.
    """

    preparation: Preparation
    min_score: float
    overlapping: bool


@dataclass(frozen=True)
class Layout:
    """One layout of outputs.

    Attributes:
        name: the detectors that have it. outputs: their shapes, in words; N boxes, C classes.
        suits: whether an answer to a grey picture has it; asked in the order of `LAYOUTS`.
        read: the answer's boxes. family: the rest.
    """

    name: str
    outputs: str
    suits: Callable[[Answer], bool]
    read: Callable[[Answer], Found]
    family: Family


def _has_columns(answer: Answer) -> bool:
    count, cells = answer.table.shape
    return count >= 5 and bool(answer.strides(cells)) and cells != 5 + COCO


def _has_anchors(answer: Answer) -> bool:
    count = len(answer.table)
    return _are_rows(answer) and count % ANCHORS == 0 and bool(answer.strides(count // ANCHORS))


def _has_cells(answer: Answer) -> bool:
    return bool(_are_rows(answer) and answer.strides(len(answer.table)) in CELLS)


def _are_rows(answer: Answer) -> bool:
    """Of small inputs there may be as many cells as there are columns for COCO."""
    count, columns = answer.table.shape
    return bool(columns == 5 + COCO or (columns >= 6 and count != 4 + COCO))


def _is_sure_everywhere(answer: Answer) -> bool:
    """YOLOv6 has kept YOLOv5's column for "there is an object", and writes 1 into it."""
    return _has_cells(answer) and bool((answer.table[:, 4] == 1.0).all())


def _is_final(answer: Answer) -> bool:
    return answer.table.shape[1] == 6 and not _has_fractions(answer)


def _is_numbered(answer: Answer) -> bool:
    shapes = [out.shape for out in answer.outputs.values()]
    return len(shapes) == 1 and len(shapes[0]) == 2 and shapes[0][1] == 7


def _is_labelled(answer: Answer) -> bool:
    wanted = {"labels": 2, "boxes": 3, "scores": 2}
    return all(name in answer.outputs and answer.outputs[name].ndim == n for name, n in wanted.items())


def _has_queries(answer: Answer) -> bool:
    return answer.pair is not None and len(answer.pair[0]) <= MOST_QUERIES and answer.pair[0].shape[1] == 4


def _has_coco_numbers(answer: Answer) -> bool:
    named = {"dets", "labels"} <= set(answer.outputs)
    return _has_queries(answer) and (named or _logits(answer) == COCO_WITH_GAPS)


def _has_nothing(answer: Answer) -> bool:
    """A network with a class for "nothing" says it of most queries for a grey picture."""
    if not _has_queries(answer):
        return False
    assert answer.pair is not None
    logits = answer.pair[1]
    nothing = bool(len(logits)) and np.mean(logits.argmax(axis=1) == logits.shape[1] - 1) > 0.5
    return _logits(answer) == COCO_WITH_GAPS + 1 or bool(nothing and logits.shape[1] > 1)


def _logits(answer: Answer) -> int:
    assert answer.pair is not None
    return int(answer.pair[1].shape[1])


def _has_fractions(answer: Answer) -> bool:
    """Boxes of a transformer, all of which say something: within the picture, and not all zero."""
    count, columns = answer.table.shape
    if not 0 < count <= MOST_QUERIES or columns < 5:
        return False
    boxes = answer.table[:, :4]
    return bool((np.abs(boxes) <= 2.0).all() and boxes.any())


def _has_final_fractions(answer: Answer) -> bool:
    """The last of six columns counts classes."""
    rows = answer.table
    return rows.shape[1] == 6 and _has_fractions(answer) and bool((rows[:, 5] == np.round(rows[:, 5])).all())


def _looks_like_columns(answer: Answer) -> bool:
    count, boxes = answer.table.shape
    return bool(count == 4 + COCO or (count >= 5 and (boxes > count or boxes < 5) and boxes != 5 + COCO))


def _looks_like_rows(answer: Answer) -> bool:
    boxes, columns = answer.table.shape
    return bool(columns == 5 + COCO or boxes > columns >= 6)


_YOLO = Family(LETTERBOX, min_score=0.3, overlapping=True)
_YOLOX = Family(CORNER_BGR, min_score=0.3, overlapping=True)
_FINAL = Family(LETTERBOX, min_score=0.3, overlapping=False)
_RT_DETR = Family(STRETCHED, min_score=0.5, overlapping=False)
_DETR = Family(STRETCHED_IMAGENET, min_score=0.5, overlapping=False)
_V8 = ("YOLOv8, YOLO11", "(1, 4 + C, N)")
_V5 = ("YOLOv5, YOLOv7", "(1, N, 5 + C)")
_V6 = ("YOLOv6", "(1, N, 5 + C) with a column of ones")
_X = ("YOLOX", "(1, N, 5 + C) with one box per cell, decoded or not")
_V10 = ("YOLOv10, YOLO26, exports with NMS", "(1, N, 6)")
_V7 = ("YOLOv7 with NMS", "(N, 7)")
_LABELLED = ("RT-DETR, D-FINE", "labels (1, N), boxes (1, N, 4), scores (1, N)")
_DETS = ("RF-DETR", "dets (1, N, 4) and labels (1, N, C), or 91 logits")
_NOTHING = ("DETR", 'boxes (1, N, 4) and logits (1, N, C + 1) with "nothing" last')
_QUERIES = ("RT-DETR of transformers", "boxes (1, N, 4) and logits (1, N, C)")
_FRACTIONS = ("RT-DETR of ultralytics", "(1, N, 4 + C), fractions")
_FINAL_FRACTIONS = ("RT-DETR of ultralytics", "(1, N, 6), fractions")

LAYOUTS: tuple[Layout, ...] = (
    Layout(*_V8, _has_columns, answers.columns_of_boxes, _YOLO),
    Layout(*_V5, _has_anchors, answers.rows_with_objectness, _YOLO),
    Layout(*_V6, _is_sure_everywhere, answers.rows_with_objectness, _YOLO),
    Layout(*_X, _has_cells, answers.yolox_rows, _YOLOX),
    Layout(*_V10, _is_final, answers.final_rows, _FINAL),
    Layout(*_V7, _is_numbered, answers.numbered_rows, _FINAL),
    Layout(*_LABELLED, _is_labelled, answers.labelled, _RT_DETR),
    Layout(*_DETS, _has_coco_numbers, answers.each_class_apart, _DETR),
    Layout(*_NOTHING, _has_nothing, answers.one_class_or_none, _DETR),
    Layout(*_QUERIES, _has_queries, answers.each_class_apart, _RT_DETR),
    Layout(*_FINAL_FRACTIONS, _has_final_fractions, answers.final_fractions, _RT_DETR),
    Layout(*_FRACTIONS, _has_fractions, answers.fractions, _RT_DETR),
    # of other grids
    Layout(*_V8, _looks_like_columns, answers.columns_of_boxes, _YOLO),
    Layout(*_V5, _looks_like_rows, answers.rows_with_objectness, _YOLO),
)
"""The layouts, asked in this order."""


def layout_of(answer: Answer) -> Layout | None:
    """The first that suits."""
    return next((layout for layout in LAYOUTS if layout.suits(answer)), None)


def known() -> str:
    """All layouts in words."""
    return "; ".join(dict.fromkeys(f"{layout.name} {layout.outputs}" for layout in LAYOUTS))
