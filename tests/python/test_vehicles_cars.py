"""Cars: proportions of each style, glass, lamps and wheel arches where a car has them."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from groundpose.lab.bodies.body import MATERIALS, Body
from groundpose.lab.bodies.car import body as car
from groundpose.lab.bodies.catalogue import STYLES
from groundpose.vehicles.keypoints import keypoint_names

CARS = STYLES["car"]
SEEDS = range(24)
row = {name: i for i, name in enumerate(keypoint_names("car"))}


@cache
def outlines(style: str) -> tuple[np.ndarray, np.ndarray]:
    """Keypoints (S, 28, 3) and boxes (S, 2, 3) of many cars."""
    drawn = [car.keypoints(style, seed) for seed in SEEDS]
    return np.stack([k for k, _ in drawn]), np.stack([b for _, b in drawn])


@cache
def made(style: str) -> Body:
    return car.build(style, 2)


def area(b: Body, material: str, where: np.ndarray | None = None) -> float:
    """m^2 of a material, of the faces in a mask."""
    mask = b.materials == MATERIALS.index(material)
    corners = b.vertices[b.faces[mask if where is None else mask & where]]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.linalg.norm(cross, axis=1).sum() / 2.0)


@pytest.mark.parametrize(
    ("style", "length", "height", "width"),
    [
        ("sedan", (3.7, 5.4), (1.36, 1.60), (1.54, 2.02)),
        ("hatchback", (3.35, 4.6), (1.36, 1.80), (1.53, 1.94)),
        ("estate", (4.1, 5.2), (1.40, 1.80), (1.62, 2.02)),
        ("suv", (3.85, 5.25), (1.50, 1.93), (1.67, 2.10)),
        ("coupe", (3.8, 5.1), (1.24, 1.46), (1.62, 2.06)),
        ("city_car", (3.2, 3.95), (1.38, 1.70), (1.44, 1.78)),
        ("kei_car", (3.2, 3.50), (1.42, 1.92), (1.40, 1.53)),
        ("mpv", (3.7, 5.6), (1.50, 1.92), (1.55, 2.12)),
    ],
)
def test_measures_of_a_style(
    style: str, length: tuple[float, float], height: tuple[float, float], width: tuple[float, float]
) -> None:
    _, boxes = outlines(style)
    size = boxes[:, 1] - boxes[:, 0]
    for values, (low, high) in zip(size.T, (width, height, length), strict=True):
        assert low < values.min()
        assert values.max() < high
        # not all alike; a law limits the length and width of kei cars, which all makers use up
        assert values.std() > (0.01 if style == "kei_car" else 0.02)


def test_widths_and_lengths_go_together() -> None:
    sizes = np.concatenate([np.diff(outlines(style)[1], axis=1)[:, 0] for style in CARS])
    assert np.corrcoef(sizes[:, 0], sizes[:, 2])[0, 1] > 0.5


@pytest.mark.parametrize("style", CARS)
def test_keypoints_are_in_the_order_of_a_car(style: str) -> None:
    """From front to rear and from the ground up, for every car."""
    points, _ = outlines(style)

    def z(name: str) -> np.ndarray:
        return points[:, row[name], 2]

    def height(name: str) -> np.ndarray:
        return -points[:, row[name], 1]

    order = [
        *("front_plate", "right_windscreen_bottom", "right_windscreen_top", "right_belt_b"),
        *("right_rear_window_top", "right_rear_window_bottom", "rear_plate"),
    ]
    for ahead, behind in pairwise(order):
        assert np.all(z(ahead) > z(behind)), (ahead, behind)
    assert np.all(z("front_plate") > z("right_headlamp"))
    assert np.all(z("right_headlamp") > z("right_front_wheel"))
    assert np.all(z("right_rear_wheel") > z("right_taillamp"))
    assert np.all(height("right_windscreen_top") > height("right_windscreen_bottom") + 0.25)
    assert np.all(height("right_belt_b") > height("right_headlamp"))
    assert np.all(points[:, row["right_mirror"], 0] > points[:, row["right_belt_b"], 0] + 0.1)
    notchback = style in ("sedan", "coupe")
    boot = z("right_rear_window_bottom") - outlines(style)[1][:, 0, 2]
    assert np.all(boot > 0.3) if notchback else np.all(boot < 0.4)


@pytest.mark.parametrize("style", CARS)
def test_sides_are_mirror_images(style: str) -> None:
    points, _ = outlines(style)
    for name, index in row.items():
        if name.startswith("left_"):
            other = points[:, row["right_" + name[5:]]]
            np.testing.assert_array_equal(points[:, index], other * [-1.0, 1.0, 1.0])
    b = made(style)
    for material in ("paint", "glass", "headlamp", "taillamp", "tyre", "mirror"):
        x = b.vertices[b.faces[b.materials == MATERIALS.index(material)]].mean(axis=1)[:, 0]
        assert area(b, material) > 0.01
        whole = b.faces[b.materials == MATERIALS.index(material)]
        right, left = (np.count_nonzero(s * b.vertices[whole].mean(axis=1)[:, 0] > 1e-6) for s in (1, -1))
        assert right == left, material
        assert abs(x.mean()) < 1e-3


@pytest.mark.parametrize("style", CARS)
def test_front_and_rear_are_told_apart_by_their_lamps(style: str) -> None:
    b = made(style)
    z = b.vertices[b.faces].mean(axis=1)[:, 2]
    half = 0.5 * b.size[0]
    assert area(b, "headlamp", z > 0.5 * half) > 0.05
    assert area(b, "headlamp", z < 0.5 * half) == 0.0
    assert area(b, "taillamp", z < -0.5 * half) > 0.03
    assert area(b, "taillamp", z > -0.5 * half) == 0.0


@pytest.mark.parametrize("style", CARS)
def test_windows_are_glass_and_let_the_seats_be_seen(style: str) -> None:
    b = made(style)
    assert 2.0 < area(b, "glass") / 2.0 < 6.0  # inner and outer face
    seats = b.vertices[b.faces[b.materials == MATERIALS.index("seat")]].reshape(-1, 3)
    belt = b.keypoints_3d[row["right_belt_b"], 1]
    assert seats[:, 1].min() < belt - 0.10  # headrests above the belt line
    assert seats[:, 1].min() > b.bbox_3d[0, 1] + 0.05  # and below the roof
    assert np.abs(seats[:, 0]).max() < 0.5 * b.size[2] - 0.08


@pytest.mark.parametrize("style", CARS)
def test_wheels_stand_free_in_their_arches(style: str) -> None:
    """Seen from the side no painted face of the body covers the wheel's lower three quarters."""
    b = made(style)
    corners = b.vertices[b.faces]
    painted = b.materials == MATERIALS.index("paint")
    for x, y, z, radius in b.wheels:
        if x < 0.0:
            continue
        middle = corners[painted].mean(axis=1)
        outside = middle[:, 0] > x - 0.05
        inside = np.hypot(middle[:, 1] - y, middle[:, 2] - z) < 0.97 * radius
        assert not np.any(outside & inside)
        assert x + 0.1 < 0.5 * b.size[2]


def test_styles_differ_and_seeds_differ() -> None:
    means = np.stack([outlines(style)[0].mean(axis=0) for style in CARS])
    for i in range(len(CARS)):
        for j in range(i):
            assert np.abs(means[i] - means[j]).max() > 0.08
    assert all(outlines(style)[0].std(axis=0).max() > 0.08 for style in CARS)
