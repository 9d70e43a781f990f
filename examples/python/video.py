"""Frame after frame of a video: the nearest vehicle of each frame.

    python examples/python/video.py drive.webp --boxes boxes.jsonl   # animated WebP, GIF, PNG, TIFF
    python examples/python/video.py drive.mp4 --boxes boxes.jsonl    # needs: pip install "imageio[pyav]"

BOXES has the boxes of frame 0, 1, 2 ... under these numbers, as COCO's results or as JSON lines
`{"id": 0, "camera": {...}, "pitch_deg": 1.7, "objects": [{"bbox": [left, top, right, bottom]}]}`.
With a detector of your own, call it in the loop: `pipeline(frame, detector(frame), view)`.
"""

import argparse
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import groundpose as gp
import numpy as np
from groundpose.formats.boxes import read_boxes
from groundpose.formats.calibrations import read_calibration
from PIL import Image, ImageSequence, UnidentifiedImageError


def frames(path: Path) -> Iterator[np.ndarray]:
    """The frames (H, W, 3), RGB, one at a time."""
    try:
        film = Image.open(path)
    except UnidentifiedImageError:  # no format of Pillow: a video
        imageio = import_module("imageio.v3")
        return (yield from imageio.imiter(path))
    with film:
        for frame in ImageSequence.Iterator(film):
            yield np.asarray(frame.convert("RGB"))


def main() -> None:
    """Frame after frame; nothing is kept in memory."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("video", type=Path)
    parser.add_argument("--boxes", type=Path, required=True)
    parser.add_argument("--calibration", type=Path)
    given = parser.parse_args()

    boxes = read_boxes(given.boxes)
    calibrated = read_calibration(given.calibration) if given.calibration else None
    pipeline = gp.Pipeline()
    for number, frame in enumerate(frames(given.video)):
        found = boxes.frame(number)
        poses = pipeline(frame, found, calibrated or found.view)
        if not poses.ok.any():
            print(f"frame {number}: no vehicle")
            continue
        nearest = poses[int(np.nanargmin(np.linalg.norm(poses.t, axis=1)))]
        where = f"{np.linalg.norm(nearest.t):.1f} m, yaw {np.degrees(nearest.yaw):+.0f} deg"
        took = 1e3 * sum(poses.seconds.values())
        print(f"frame {number}: {nearest.model.name} at {where} ({took:.0f} ms for {len(poses)})")


if __name__ == "__main__":
    main()
