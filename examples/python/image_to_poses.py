"""From one photograph and 2D boxes to 6-DoF poses and a picture of them.

    python examples/python/image_to_poses.py
    python examples/python/image_to_poses.py --image my.jpg --boxes my.json --out my_poses.png

The file of boxes also has the camera and its tilt, as street/street.json beside this program.
"""

import argparse
from pathlib import Path

import groundpose as gp
import numpy as np
from groundpose.formats.boxes import read_boxes
from PIL import Image

STREET = Path(__file__).parent / "street"


def main() -> None:
    """Estimate, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--image", type=Path, default=STREET / "street.jpg")
    parser.add_argument("--boxes", type=Path, default=STREET / "street.json")
    parser.add_argument("--out", type=Path, default=Path("street_poses.png"))
    given = parser.parse_args()

    found = read_boxes(given.boxes).of(given.image.name)
    if found.view is None:
        parser.error(f"{given.boxes}: no camera; make a gp.View(gp.Camera(fx, fy, cx, cy), pitch=...) here")
    image = np.asarray(Image.open(given.image).convert("RGB"))

    pipeline = gp.Pipeline()  # loads the network once
    poses = pipeline(image, found, found.view)

    for number, pose in enumerate(poses):
        if not pose.ok:
            print(f"{number}: no answer ({pose.status})")
            continue
        x, _, z = pose.t
        sigma = pose.covariance[5, 5] ** 0.5
        print(
            f"{number}: {pose.model.name}, {x:+.1f} m to the right, {z:.1f} m ahead (standard deviation "
            f"{sigma:.1f} m), yaw {np.degrees(pose.yaw):+.0f} deg, {pose.inlier_count} keypoints agree"
        )
    steps = ", ".join(f"{name} {1e3 * seconds:.2f} ms" for name, seconds in poses.seconds.items())
    print(f"time of all {len(poses)}: {steps}")
    poses.draw(image, given.out)
    print(f"picture: {given.out}")


if __name__ == "__main__":
    main()
