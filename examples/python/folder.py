"""All images of a folder with one pipeline; a CSV file with one line per vehicle.

    python examples/python/folder.py IMAGES --boxes BOXES --calibration CAMERA --out poses.csv

BOXES is one file for all images (COCO, nuScenes, JSON lines) or a folder with a file per image (KITTI,
JSON). CAMERA is KITTI, OpenCV, ROS or JSON; leave it out where the boxes' file has the camera. The command
`groundpose estimate IMAGES` does the same without a program, and writes every field.
"""

import argparse
import csv
from dataclasses import replace
from pathlib import Path

import groundpose as gp
import numpy as np
from groundpose.formats.boxes import Boxes, read_boxes
from groundpose.formats.calibrations import read_calibration

PICTURES = {".png", ".jpg", ".jpeg"}
COLUMNS = ("image", "object", "class", "status", "x", "y", "z", "z_sigma", "yaw_deg")


def boxes_of(image: Path, boxes: Path) -> Boxes:
    """The boxes of one image, from the file of all images or from its own file in a folder."""
    if boxes.is_dir():
        boxes = next(path for path in sorted(boxes.glob(f"{image.stem}.*")) if path.suffix not in PICTURES)
    return read_boxes(boxes).of(image.name)


def main() -> None:
    """Image after image; nothing is kept in memory."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("images", type=Path)
    parser.add_argument("--boxes", type=Path, required=True)
    parser.add_argument("--calibration", type=Path)
    parser.add_argument("--out", type=Path, default=Path("poses.csv"))
    given = parser.parse_args()

    pipeline = gp.Pipeline()
    calibrated = read_calibration(given.calibration) if given.calibration else None
    with given.out.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        for image in sorted(path for path in given.images.iterdir() if path.suffix.lower() in PICTURES):
            found = boxes_of(image, given.boxes)
            vehicles = [box for box in found.boxes if box.is_vehicle]
            view = calibrated or found.view
            if view is None:
                parser.error(f"{given.boxes}: no camera in it; give --calibration")
            poses = pipeline(image, replace(found, boxes=tuple(vehicles)), view)
            for box, pose in zip(vehicles, poses, strict=True):
                numbers = [*pose.t, pose.covariance[5, 5] ** 0.5, np.degrees(pose.yaw)]
                table.writerow([image.name, box.id, pose.model.name, pose.status, *np.round(numbers, 3)])
            print(f"{image.name}: {int(poses.ok.sum())} of {len(poses)} vehicles")


if __name__ == "__main__":
    main()
