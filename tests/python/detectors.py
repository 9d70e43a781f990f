"""Detectors in ONNX files without training: they find the red rectangle in their input and answer it in the
layout of a family. Skips without onnx."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

onnx = pytest.importorskip("onnx", reason="onnx is not installed (extra [train])")
FLOAT, FLOAT16, INT64 = onnx.TensorProto.FLOAT, onnx.TensorProto.FLOAT16, onnx.TensorProto.INT64

SIZE = (96, 64)
"""Width and height of the input."""
CLASSES = 3
SCORE, KIND = 0.9, 2
ROW = 5
"""Where in its table a detector answers what it has found; the other rows are empty."""


class Graph:
    """Nodes and constants as they come, each under a name of its own."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.weights: list[onnx.TensorProto] = []

    def constant(self, value: object, dtype: type = np.float32) -> str:
        name = f"c{len(self.weights)}"
        self.weights.append(onnx.numpy_helper.from_array(np.array(value, dtype=dtype), name))
        return name

    def __call__(self, kind: str, *inputs: str, **attributes: object) -> str:
        name = f"n{len(self.nodes)}"
        self.nodes.append(onnx.helper.make_node(kind, inputs, [name], **attributes))
        return name

    def call(self, kind: str, x: str, value: object) -> str:
        """An operator of x and a constant."""
        return self(kind, x, self.constant(value))

    def ends(self, levels: str, axis: int, length: int) -> tuple[str, str]:
        """First and last + 1 index along the other axis of (H, W) where something is red, (1,) each."""
        line = self("ReduceMax", levels, self.constant([axis], np.int64), keepdims=0)
        first = self("ArgMax", line, axis=0, keepdims=1)
        far = self.constant([-length - 1], np.int64)
        back = [
            self.constant([-1], np.int64),
            far,
            self.constant([0], np.int64),
            self.constant([-1], np.int64),
        ]
        last = self("ArgMax", self("Slice", line, *back), axis=0, keepdims=1)
        return self("Cast", first, to=FLOAT), self(
            "Sub", self.constant([length]), self("Cast", last, to=FLOAT)
        )

    def corners(self, picture: str, red: int, threshold: float, size: tuple[int, int]) -> str:
        """(4,) left, top, right, bottom of what is red in `picture` (B, 3, H, W)."""
        first = self("Gather", picture, self.constant(0, np.int64), axis=0)
        channel = self("Gather", first, self.constant(red, np.int64), axis=0)
        levels = self("Cast", self.call("Greater", channel, threshold), to=FLOAT)
        left, right = self.ends(levels, 0, size[0])
        top, bottom = self.ends(levels, 1, size[1])
        return self("Concat", left, top, right, bottom, axis=0)

    def centred(self, corners: str) -> str:
        """(4,) centre, width, height."""
        middle = self.constant([[0.5, 0, -1, 0], [0, 0.5, 0, -1], [0.5, 0, 1, 0], [0, 0.5, 0, 1]])
        return self("MatMul", corners, middle)

    def table(self, row: str, rows: int, empty: object) -> str:
        """(1, rows, K): `row` (K,) at ROW among empty ones."""
        blank = np.asarray(empty, dtype=np.float32)
        parts = [self.constant(np.tile(blank, (n, 1))) for n in (ROW, rows - ROW - 1)]
        one = self("Unsqueeze", row, self.constant([0], np.int64))
        whole = self("Concat", parts[0], one, parts[1], axis=0)
        return self("Unsqueeze", whole, self.constant([0], np.int64))

    def answer(self, box: str, rows: int, tail: object, empty: object = 0.0) -> str:
        """A table whose row is the box (4,) and `tail`; empty rows have `empty` behind a box of zeros."""
        behind = np.broadcast_to(np.asarray(empty, dtype=np.float32), np.shape(tail))
        return self.table(
            self("Concat", box, self.constant(tail), axis=0), rows, [0, 0, 0, 0, *np.ravel(behind)]
        )


def cells(size: tuple[int, int] = SIZE) -> int:
    return sum((size[0] // s) * (size[1] // s) for s in (8, 16, 32))


def scores(count: int = CLASSES, score: float = SCORE, kind: int = KIND, other: float = 0.0) -> list[float]:
    return [score if k == kind else other for k in range(count)]


def _v8(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    return {"output0": g("Transpose", g.answer(g.centred(box), cells(size), scores()), perm=[0, 2, 1])}


def _v5(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    return {"output0": g.answer(g.centred(box), 3 * cells(size), [0.95, *scores()])}


def _v6(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    tail = [1.0, *scores()]
    return {"outputs": g.answer(g.centred(box), cells(size), tail, [1.0, 0, 0, 0])}


def _yolox(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    return {"output": g.answer(g.centred(box), cells(size), [0.95, *scores()])}


def _yolox_raw(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    """Against cell ROW of the first grid, whose cells are 8 pixels wide."""
    wide = g.call("Div", g.centred(box), 8.0)
    middle = g("Slice", wide, g.constant([0], np.int64), g.constant([2], np.int64))
    sides = g("Slice", wide, g.constant([2], np.int64), g.constant([4], np.int64))
    off = g.call("Sub", middle, [ROW % (size[0] // 8), ROW // (size[0] // 8)])
    return {"output": g.answer(g("Concat", off, g("Log", sides), axis=0), cells(size), [0.95, *scores()])}


def _final(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    return {"output0": g.answer(box, 20, [SCORE, KIND])}


def _numbered(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    row = g("Concat", g.constant([0]), box, g.constant([KIND, SCORE]), axis=0)
    return {"output": g("Unsqueeze", row, g.constant([0], np.int64))}


def _fractions(g: Graph, box: str, size: tuple[int, int]) -> str:
    return g.call("Div", g.centred(box), [*size, *size])


def _queries(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    return {"output0": g.answer(_fractions(g, box, size), 30, scores())}


def _final_queries(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    return {"output0": g.answer(_fractions(g, box, size), 30, [SCORE, KIND])}


def _labelled(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    """In the size that is asked for."""
    sizes = g("Cast", "orig_target_sizes", to=FLOAT)
    both = g("Squeeze", g("Concat", sizes, sizes, axis=1), g.constant([0], np.int64))
    there = g("Mul", g.call("Div", box, [*size, *size]), both)
    labels = np.zeros((1, 30), np.int64)
    labels[0, ROW] = KIND
    certain = np.zeros((1, 30))
    certain[0, ROW] = SCORE
    return {
        "labels": g("Identity", g.constant(labels, np.int64)),
        "boxes": g.table(there, 30, [0] * 4),
        "scores": g("Identity", g.constant(certain)),
    }


def _logit(probability: float) -> float:
    return float(np.log(probability / (1.0 - probability)))


def _pair(
    g: Graph, box: str, size: tuple[int, int], names: tuple[str, str], row: list[float], empty: list[float]
) -> dict[str, str]:
    boxes = g.table(_fractions(g, box, size), 30, [0.5, 0.5, 0.1, 0.1])
    return {names[0]: boxes, names[1]: g.table(g.constant(row), 30, empty)}


def _dets(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    row = scores(CLASSES + 1, _logit(SCORE), other=-6.0)
    return _pair(g, box, size, ("dets", "labels"), row, [-6.0] * (CLASSES + 1))


def _coco_numbers(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    return _pair(g, box, size, ("pred_boxes", "logits"), scores(91, _logit(SCORE), 3, -6.0), [-6.0] * 91)


def _detr(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    """One class or nothing: the odds of the class are 9 to 1."""
    row, empty = scores(92, float(np.log(9.0 * 91)), 3), [0.0] * 91 + [20.0]
    return _pair(g, box, size, ("pred_boxes", "logits"), row, empty)


def _transformers(g: Graph, box: str, size: tuple[int, int]) -> dict[str, str]:
    return _pair(g, box, size, ("pred_boxes", "logits"), scores(80, _logit(SCORE), 2, -6.0), [-6.0] * 80)


RGB, BGR, NORMALISED = (0, 0.7), (2, 180.0), (0, 1.0)
"""Which channel is red, and the level above which it is, as a family prepares pictures."""
WAYS: dict[str, tuple[Callable[..., dict[str, str]], tuple[int, float], str]] = {
    "YOLOv8": (_v8, RGB, "YOLOv8, YOLO11"),
    "YOLOv5": (_v5, RGB, "YOLOv5, YOLOv7"),
    "YOLOv6": (_v6, RGB, "YOLOv6"),
    "YOLOX": (_yolox, BGR, "YOLOX"),
    "YOLOX raw": (_yolox_raw, BGR, "YOLOX"),
    "end to end": (_final, RGB, "YOLOv10, YOLO26, exports with NMS"),
    "YOLOv7 end to end": (_numbered, RGB, "YOLOv7 with NMS"),
    "RT-DETR": (_labelled, RGB, "RT-DETR, D-FINE"),
    "RF-DETR": (_dets, NORMALISED, "RF-DETR"),
    "RF-DETR of COCO": (_coco_numbers, NORMALISED, "RF-DETR"),
    "DETR": (_detr, NORMALISED, "DETR"),
    "RT-DETR of transformers": (_transformers, RGB, "RT-DETR of transformers"),
    "RT-DETR of ultralytics": (_queries, RGB, "RT-DETR of ultralytics"),
    "RT-DETR of ultralytics, newer": (_final_queries, RGB, "RT-DETR of ultralytics"),
}
"""How the rectangle is answered, seen, and what the layout is called."""


def write(
    path: Path,
    way: str | Callable[..., dict[str, str]] = "YOLOv8",
    size: tuple[int, int] = SIZE,
    shape: list[int | str] | None = None,
    dtype: int = FLOAT,
    metadata: Mapping[str, str] | None = None,
    seen: tuple[int, float] = RGB,
    others: Mapping[str, tuple[int, list[int]]] | None = None,
) -> Path:
    """A detector that answers in a way of `WAYS`, or in one of the caller's.

    `shape` and `dtype` are those that the file states of its input, `others` are the types and shapes of
    inputs beside it.
    """
    answer, seen, _ = WAYS[way] if isinstance(way, str) else (way, seen, "")
    g = Graph()
    picture = g("Cast", "images", to=FLOAT)
    outputs = answer(g, g.corners(picture, *seen, size), size)
    for name, node in outputs.items():
        g.nodes.append(onnx.helper.make_node("Identity", [node], [name]))
    others = {"orig_target_sizes": (INT64, [1, 2])} if way == "RT-DETR" else others or {}
    inputs = [onnx.helper.make_tensor_value_info("images", dtype, shape or [1, 3, size[1], size[0]])]
    inputs += [onnx.helper.make_tensor_value_info(name, *other) for name, other in others.items()]
    kinds = {"labels": INT64} if way == "RT-DETR" else {}
    answered = [onnx.helper.make_tensor_value_info(name, kinds.get(name, FLOAT), None) for name in outputs]
    graph = onnx.helper.make_graph(g.nodes, "detector", inputs, answered, g.weights)
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 18)], ir_version=9)
    onnx.helper.set_model_props(model, dict(metadata or {}))
    onnx.save(model, str(path))
    return path
