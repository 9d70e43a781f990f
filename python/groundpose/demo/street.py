"""The street of the demo: a frame of the virtual drive that training never sees, its boxes and the truth.

`street.jpg` and `street.json` are made by `python -m groundpose.lab.drive.demo_street`.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.boxes import read_boxes
from groundpose.keypoints.codec import ByteArray
from groundpose.keypoints.image import as_rgb
from groundpose.types import View

IMAGE, LABELS = (Path(__file__).parent / name for name in ("street.jpg", "street.json"))
"""The picture, and beside it camera, boxes and truth as `groundpose estimate --boxes` reads them."""


@dataclass(frozen=True, eq=False)
class Street:
    """What the pipeline is given and what is true, N vehicles.

    Attributes:
        path: of the picture. image: it, (H, W, 3) uint8.
        bboxes: (N, 4) left, top, right, bottom pixels.
        view: the camera, nominally level. true_view: with its real tilt and height.
        classes: N classes. R, t: true poses (N, 3, 3) and (N, 3) metres.
        bbox_3d: (N, 2, 3) metres, the bodies' true 3D boxes.
    """

    path: Path
    image: ByteArray
    bboxes: FloatArray
    view: View
    true_view: View
    classes: tuple[str, ...]
    R: FloatArray
    t: FloatArray
    bbox_3d: FloatArray


def example() -> Street:
    """The bundled street."""
    found = read_boxes(LABELS).of(IMAGE.name)
    notes = json.loads(LABELS.read_text(encoding="utf-8"))
    assert found.view is not None
    tilt, poses = notes["_tilt"], [box.truth for box in found.boxes if box.truth is not None]
    pitch, roll = math.radians(tilt["pitch_deg"]), math.radians(tilt["roll_deg"])
    return Street(
        path=IMAGE,
        image=as_rgb(IMAGE),
        bboxes=np.array([box.bbox for box in found.boxes]),
        view=found.view,
        true_view=View(found.view.camera, pitch, roll, tilt["camera_height"]),
        classes=tuple(box.name for box in found.boxes),
        R=np.stack([R for R, _ in poses]),
        t=np.stack([t for _, t in poses]),
        bbox_3d=np.array([o["_bbox_3d"] for o in notes["objects"]]),
    )
