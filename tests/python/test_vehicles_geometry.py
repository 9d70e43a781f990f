"""The mesh tools under the vehicles: closed and outward bodies, normals and creases, walls and slabs."""

import numpy as np
import pytest
from groundpose.lab.bodies.geometry import loft, primitives, slab
from groundpose.lab.bodies.geometry.mesh import Component, Mesh, assemble, both_sides, rotation
from groundpose.lab.bodies.geometry.wall import Wall, quadratic_spline
from groundpose.lab.bodies.parts.wheels import CAR_RIMS, STEEL_RIMS, hub_x, place_wheels, wheel

OUTLINE = np.array([[0.0, 2.0], [0.5, 2.0], [0.9, 1.9], [0.9, 0.0], [0.9, -1.9], [0.5, -2.0], [0.0, -2.0]])
WALL = Wall(OUTLINE, ([0.0, 1.0], [0.1, 0.0]), ([0.0, 1.0], [0.05, 0.0]), ([0.0, 1.0], [0.0, 0.1]))

angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
ring = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
station = np.linspace(0.0, np.pi, 9)
sphere = np.stack(
    [
        np.outer(np.sin(station), np.sin(station)),
        np.tile(-(1.0 - np.cos(station)), (9, 1)) + 1.0,
        np.outer(np.cos(station), np.sin(station)),
    ],
    axis=-1,
)

BODIES: dict[str, tuple[Component, float | None]] = {
    "sharp box": (primitives.rounded_box(1.0, 0.5, 0.3, 0.0, 0), 0.15),
    "rounded box": (primitives.rounded_box(1.0, 0.5, 0.3, 0.05, 0), None),
    "ellipsoid": (primitives.ellipsoid(2.0, 2.0, 2.0, 0, 40, 21), 4.1),
    "disc": (primitives.disc(0.5, 0.1, 0, 32), 0.078),
    "pipe": (primitives.pipe(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.5]]), 0.1, 0), None),
    "loop": (primitives.pipe(ring, 0.1, 0, 16, closed=True), 0.18),
    "ring": (
        loft.lathe(np.array([[-0.1, 0.2], [-0.1, 0.3], [0.1, 0.3], [0.1, 0.2]]), 24, 0, closed=True),
        None,
    ),
    "half shell": (loft.half_shell(sphere, 0), 3.8),
    "slab": (slab.slab(WALL, np.linspace(1.0, 1.6, 5), 0.4, 0.6, 0), None),
    "slab over the front": (slab.slab(WALL, np.linspace(-0.4, 0.4, 7), 0.4, 0.6, 0), None),
    "slab over the rear": (slab.slab(WALL, WALL.length + np.linspace(-0.4, 0.4, 7), 0.4, 0.6, 0), None),
    "ribbon": (slab.ribbon(ring[:8] * 2.0, ring[:8], 0.01, 0), None),
    "mirrored": (primitives.rounded_box(1.0, 0.5, 0.3, 0.05, 0).moved(2.0).mirrored(), None),
    "turned": (primitives.rounded_box(1.0, 0.5, 0.3, 0.05, 0).turned("y", 0.4).scaled(1.0, -2.0, 1.0), None),
}
for number, rim in enumerate(CAR_RIMS + STEEL_RIMS):
    for name, part in zip(("tyre", "rim"), wheel(0.32, 0.21, 0.21, rim, 0.3), strict=True):
        BODIES[f"{name} {number}"] = (part, None)


def volume(mesh: Mesh) -> float:
    return float(np.linalg.det(mesh.vertices[mesh.faces]).sum() / 6.0)


@pytest.mark.parametrize("name", BODIES)
def test_bodies_are_closed_and_outward(name: str) -> None:
    part, expected = BODIES[name]
    mesh = assemble([part])
    _, welded = np.unique(mesh.vertices.round(6), axis=0, return_inverse=True)
    faces = welded.reshape(-1)[mesh.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = edges @ [1 << 20, 1], edges @ [1, 1 << 20]
    assert len(np.unique(there)) == len(there)
    np.testing.assert_array_equal(np.sort(there), np.sort(back))
    assert volume(mesh) > 0.0
    if expected is not None:
        assert volume(mesh) == pytest.approx(expected, rel=0.05)


def test_normals_are_smooth_on_a_ball_and_sharp_on_a_box() -> None:
    ball = assemble([primitives.ellipsoid(2.0, 2.0, 2.0, 0, 40, 21)])
    np.testing.assert_allclose(ball.normals, ball.vertices, atol=0.05)
    assert len(ball.vertices) == 40 * 21 + 2  # nothing doubled
    box = assemble([primitives.rounded_box(1.0, 2.0, 3.0, 0.0, 0)])
    assert len(np.unique(box.vertices.round(6), axis=0)) == 8 + 2  # two caps with a middle point
    np.testing.assert_allclose(np.abs(box.normals).max(axis=1), 1.0, atol=1e-9)


def test_assemble_keeps_components_and_materials_apart() -> None:
    one = primitives.rounded_box(1.0, 1.0, 1.0, 0.0, 3)
    mesh = assemble([one, one.moved(1.0).painted(5)])  # touching: equal positions of different components
    np.testing.assert_array_equal(np.unique(mesh.parts), [0, 1])
    np.testing.assert_array_equal(mesh.materials[mesh.parts == 1], 5)
    assert set(mesh.faces[mesh.parts == 0].ravel()).isdisjoint(mesh.faces[mesh.parts == 1].ravel())
    assert volume(mesh) == pytest.approx(2.0)


def test_both_sides_is_a_mirror_image() -> None:
    right, left = both_sides([primitives.rounded_box(1.0, 0.5, 0.3, 0.05, 0).moved(2.0, 0.1)])
    np.testing.assert_allclose(left.vertices, right.vertices * [-1.0, 1.0, 1.0])
    assert volume(assemble([left])) == pytest.approx(volume(assemble([right])))


@pytest.mark.parametrize("axis", "xyz")
def test_rotation_is_right_handed(axis: str) -> None:
    start = {"x": [0, 1, 0], "y": [0, 0, 1], "z": [1, 0, 0]}[axis]
    end = {"x": [0, 0, 1], "y": [1, 0, 0], "z": [0, 1, 0]}[axis]
    np.testing.assert_allclose(rotation(axis, np.pi / 2) @ start, end, atol=1e-12)


def test_along_passes_the_points_and_does_not_overshoot() -> None:
    x, y = np.array([0.0, 1.0, 1.2, 3.0]), np.array([0.0, 0.0, 1.0, 1.1])
    np.testing.assert_allclose(loft.along(y, x, x), y, atol=1e-12)
    fine = loft.along(y, x, np.linspace(-1.0, 4.0, 500))
    assert fine.min() >= 0.0
    assert fine.max() <= 1.1
    assert np.all(np.diff(fine) >= -1e-12)


def test_spline_starts_and_ends_on_its_control_points() -> None:
    curve = quadratic_spline(OUTLINE, 50)
    np.testing.assert_allclose(curve[[0, -1]], OUTLINE[[0, -1]])
    assert np.all(np.diff(curve[:, 1]) <= 1e-12)


def test_wall_is_drawn_in_and_mirrors_itself() -> None:
    # The front is at z = 2 where its inset is 0 (1 m up), 5 cm behind at half height.
    np.testing.assert_allclose(WALL.points(0.0, [1.0, 0.5]), [[0.0, -1.0, 2.0], [0.0, -0.5, 1.95]], atol=1e-6)
    u = np.array([0.3, 1.0, 2.5, 4.0])
    right, left = WALL.points(u, 0.7), WALL.points(-u, 0.7)
    np.testing.assert_allclose(left, right * [-1.0, 1.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(
        WALL.points(WALL.length + u, 0.7), WALL.points(WALL.length - u, 0.7) * [-1, 1, 1], atol=1e-12
    )
    np.testing.assert_allclose(WALL.z_at_u(WALL.u_at_z([1.5, 0.0, -1.2])), [1.5, 0.0, -1.2], atol=1e-9)
    normals = WALL.normals(np.array([0.0, float(WALL.u_at_z(0.0)), WALL.length]), 0.9)
    np.testing.assert_allclose(normals, [[0, 0.1, 1], [1, 0.05, 0], [0, -0.1, -1]], atol=0.02)


def test_slab_stands_out_by_its_thickness() -> None:
    u = np.linspace(-0.2, 0.2, 5)
    plate = slab.slab(WALL, u, 0.4, 0.6, 0, thickness=0.01, bevel=0.005, sink=0.004)
    middle = WALL.points(0.0, 0.5) + 0.01 * WALL.normals(0.0, 0.5)
    assert np.linalg.norm(plate.vertices - middle, axis=1).min() < 1e-9
    border = WALL.points(-0.2, 0.4) - 0.004 * WALL.normals(-0.2, 0.4)
    assert np.linalg.norm(plate.vertices - border, axis=1).min() < 1e-9


def test_wheels_stand_where_they_belong() -> None:
    parts = wheel(0.32, 0.21, 0.21, CAR_RIMS[0])
    radius = np.hypot(parts[0].vertices[:, 1], parts[0].vertices[:, 2])
    assert radius.max() == pytest.approx(0.32)
    assert parts[1].vertices[:, 0].max() == pytest.approx(max(hub_x(0.21, CAR_RIMS[0]), 0.47 * 0.21))
    centres = np.array([[0.8, -0.32, 1.3, 0.32], [-0.8, -0.32, 1.3, 0.32]])
    right, left = (assemble(place_wheels(centres[i : i + 1], parts)) for i in (0, 1))
    np.testing.assert_allclose(np.sort(-left.vertices[:, 0]), np.sort(right.vertices[:, 0]), atol=1e-9)
    assert right.vertices[:, 1].max() == pytest.approx(0.0, abs=1e-9)  # on the ground
