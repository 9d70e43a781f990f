"""`python -m groundpose.lab.drive.demo_street`: render the street of the demo again, with its labels."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from PIL import Image

from groundpose._writing import write_text
from groundpose.demo.street import IMAGE, LABELS
from groundpose.lab.drive import Label, labels, scene, scene_seed
from groundpose.lab.drive.record import frame_line
from groundpose.lab.drive.render import Renderer

# The frame; no network is trained on the split "test".
SPLIT, SEED, NUMBER = "test", 0, 350
# Boxes given to the pipeline: those of vehicles that a detector would find.
_LEAST_HEIGHT, _MOST_HIDDEN, _MOST_CUT = 24.0, 0.7, 0.6
# The highest of these qualities whose file is small enough to ship.
_QUALITIES, _MOST_BYTES = (90, 85, 80, 75, 70, 60), 240_000
_KEPT = ("id", "bbox", "truth", "_bbox_3d", "_truncation", "_occluded_share")


def main(
    image: Annotated[Path, typer.Option(help="Picture to write.")] = IMAGE,
    number: Annotated[int, typer.Option(min=0, help="Frame of the drive.")] = NUMBER,
) -> None:
    """Write the picture and, beside it, camera, boxes and truth as JSON."""
    frame = scene(scene_seed(SEED, SPLIT), number)
    picture = Image.fromarray(Renderer().frame(frame))
    for quality in _QUALITIES:
        picture.save(image, quality=quality, optimize=True)
        if image.stat().st_size <= _MOST_BYTES:
            break
    shown = [label for label in labels(frame) if _given(label)]
    record = json.loads(frame_line(frame, shown, number, image.name))
    record["objects"] = [
        {"class": item["model"], **{name: item[name] for name in _KEPT}} for item in record["objects"]
    ]
    del record["models"], record["_camera_from_world"]
    rows = ",\n  ".join(json.dumps(item) for item in record.pop("objects"))
    head = json.dumps(record)[:-1]
    text = f'{head},\n "objects": [\n  {rows}]}}\n'
    write_text(image.with_suffix(LABELS.suffix), text)
    print(f"{image}: {image.stat().st_size / 1000:.0f} kB, {len(shown)} vehicles")


def _given(label: Label) -> bool:
    height = float(label.bbox[3] - label.bbox[1])
    seen = label.occluded_share <= _MOST_HIDDEN and label.truncation <= _MOST_CUT
    return height >= _LEAST_HEIGHT and seen


if __name__ == "__main__":
    typer.run(main)
