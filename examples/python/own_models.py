"""The solver alone, with keypoints and 3D models of your own: containers of unknown length in a yard.

    python examples/python/own_models.py

Anything that stands on the ground will do: pallets, boats on trailers, aircraft. A model needs keypoints in
metres (x right, y down, z forward); examples of other sizes give it modes, and the solver then finds the size
as well. Printed is the estimate, then the truth in brackets.
"""

import groundpose as gp
import numpy as np

VIEW = gp.View(gp.Camera(1000.0, 1000.0, 640.0, 360.0, image_size=(1280, 720)), pitch=-0.05, height=4.0)
WIDTH, HEIGHT = 2.44, 2.59


def container(length: float) -> np.ndarray:
    """Keypoints (20, 3) in metres: bottom and top of each side at its ends, quarters and middle."""
    along = length * np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
    return np.array([(x, y, z) for x in (-WIDTH / 2, WIDTH / 2) for y in (0.0, -HEIGHT) for z in along])


def seen(length: float, t: np.ndarray, yaw: float, rng: np.random.Generator) -> np.ndarray:
    """What a detector would find: pixels (20, 2) with noise of 1 px, six of them wrong."""
    c, s = np.cos(yaw), np.sin(yaw)
    R = VIEW.R_camera_from_ground @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    pixels = VIEW.project(container(length) @ R.T + VIEW.R_camera_from_ground @ t)
    pixels += rng.normal(0.0, 1.0, pixels.shape)
    wrong = rng.permutation(len(pixels))[:6]
    pixels[wrong] = rng.uniform(pixels.min(axis=0), pixels.max(axis=0), (6, 2))
    return pixels


def main() -> None:
    """Three containers, one model."""
    rng = np.random.default_rng(1)
    lengths = np.linspace(6.06, 13.72, 12)  # 20 to 45 feet
    model = gp.ShapeModel.fit(np.stack([container(length) for length in lengths]), modes=1, name="container")

    truth = [(6.06, (-6.0, 4.0, 22.0), 0.4), (12.19, (5.0, 4.0, 30.0), -1.2), (13.72, (0.0, 4.0, 45.0), 2.0)]
    keypoints = np.stack([seen(length, np.array(t), yaw, rng) for length, t, yaw in truth])
    poses = gp.estimate_poses(VIEW, keypoints, None, model)  # no 2D boxes: None

    for pose, (length, t, yaw) in zip(poses, truth, strict=True):
        found = np.ptp(pose.keypoints_3d[:, 2])
        x, _, z = VIEW.R_camera_from_ground.T @ pose.t
        print(
            f"{pose.status}: x {x:6.2f} ({t[0]:.2f}), z {z:6.2f} ({t[2]:.2f}) m, yaw {pose.yaw:.2f} ({yaw}), "
            f"length {found:5.2f} ({length}) m, {pose.inlier_count} of {len(pose.residuals)} keypoints agree"
        )


if __name__ == "__main__":
    main()
