"""The street of the demo: a frame of the virtual drive that training never sees, its boxes and the truth.

`street.jpg` and `street.json` are made by `python -m groundpose.lab.drive.demo_street`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from groundpose._checks import FloatArray
from groundpose.formats.fields import parse
from groundpose.formats.frames import read_truth, read_view
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
    root = parse(LABELS.read_text(encoding="utf-8"), str(LABELS))
    view, objects = read_view(root), root.need("objects").items()
    poses = [read_truth(each.need("truth")) for each in objects]
    tilt = root.value["_tilt"]
    pitch, roll = math.radians(tilt["pitch_deg"]), math.radians(tilt["roll_deg"])
    return Street(
        path=IMAGE,
        image=as_rgb(IMAGE),
        bboxes=np.array([each.need("bbox").numbers(4) for each in objects]),
        view=view,
        true_view=View(view.camera, pitch, roll, tilt["camera_height"]),
        classes=tuple(each.need("class").text() for each in objects),
        R=np.stack([R for R, _ in poses]),
        t=np.stack([t for _, t in poses]),
        bbox_3d=np.array([each.value["_bbox_3d"] for each in objects]),
    )
