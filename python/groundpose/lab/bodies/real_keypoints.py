"""Keypoints of vehicles drawn by hand, by rules on their parts; for the left, mirror the parts first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from groundpose._checks import FloatArray
from groundpose.lab.bodies.geometry.mesh import Component, cross, unit


@dataclass(frozen=True, eq=False)
class Parts:
    """The parts of a vehicle by name, in the object frame."""

    whole: Mapping[str, Component]

    def pieces(self, name: str) -> list[FloatArray]:
        """Vertices (N, 3) of each connected piece of a part."""
        part = self.whole[name]
        points, rows = np.unique(
            part.vertices[part.faces].reshape(-1, 3).round(3), axis=0, return_inverse=True
        )
        faces = rows.reshape(-1, 3)
        label = np.arange(len(points))
        for _ in range(len(points)):
            least = label[faces].min(axis=1)
            before = label.copy()
            for corner in range(3):
                np.minimum.at(label, faces[:, corner], least)
            if np.array_equal(before, label):
                break
        return [points[label == i] for i in np.unique(label)]

    def right(self, name: str) -> list[FloatArray]:
        """The pieces on the right, front ones first."""
        found = [piece for piece in self.pieces(name) if _middle(piece)[0] > 0.02]
        return sorted(found, key=lambda piece: -float(_middle(piece)[2]))

    @cached_property
    def body(self) -> FloatArray:
        """Vertices of the body."""
        part = self.whole["body"]
        return part.vertices[np.unique(part.faces)]

    @cached_property
    def side_panes(self) -> list[FloatArray]:
        """Panes of the right side, front ones first."""
        return [pane for pane in self.right("windows") if np.ptp(pane[:, 0]) < 0.3]

    def pane_ends(self, facing: float) -> tuple[FloatArray, FloatArray]:
        """Outer top and bottom corner on the right of the windscreen (1) or the rear window (-1)."""
        panes = [pane for pane in self.pieces("windows") if np.ptp(pane[:, 0]) >= 0.3]
        middle = [facing * float(_middle(pane)[2]) for pane in panes]
        points = np.concatenate([p for p, m in zip(panes, middle, strict=True) if m > max(middle) - 0.1])
        return _most(points, (0.5, -1.0, 0.0)), _most(points, (0.5, 1.0, 0.0))

    def hubs(self) -> list[FloatArray]:
        """Outer faces of the wheels of the right side, the front one first."""
        return [piece for piece in self.right("metal") if np.ptp(piece[:, 0]) < 0.05]

    def mirror_foot(self) -> FloatArray:
        """Lower front corner of the first side window."""
        return _most(self.side_panes[0], (0.0, 1.0, 1.0))

    def lamp_end(self, names: Sequence[str], facing: float) -> FloatArray:
        """Outer end of the lamps on the right at the front (1) or rear (-1), half their height."""
        points = np.concatenate(
            [piece for name in names for piece in self.right(name) if facing * _middle(piece)[2] > 0.0]
        )
        low, high = points[:, 1].min(), points[:, 1].max()
        outer = points[points[:, 0] > points[:, 0].max() - 0.01]
        return np.array([outer[:, 0].max(), 0.5 * (low + high), facing * (facing * outer[:, 2]).max()])

    def plate_place(self, facing: float) -> FloatArray:
        """The place of the front (1) or rear (-1) plate on the body's middle line, above its lower edge."""
        y = float(self.body[:, 1].max()) - 0.16
        return np.array([0.0, y, facing * self._reach(y, facing)])

    def _reach(self, y: float, facing: float) -> float:
        """Farthest `facing * z` of the body's middle line at height y."""
        part = self.whole["body"]
        corners = part.vertices[part.faces] * [1.0, 1.0, facing]
        lines = np.concatenate([corners[:, [i, (i + 1) % 3]] for i in range(3)])
        a, b = lines[:, 0], lines[:, 1]
        meets = (a[:, 1] - y) * (b[:, 1] - y) <= 0.0
        a, b = a[meets], b[meets]
        w = ((y - a[:, 1]) / np.where(np.abs(b[:, 1] - a[:, 1]) < 1e-9, 1.0, b[:, 1] - a[:, 1])).clip(
            0.0, 1.0
        )
        return float((a[:, 2] + w * (b[:, 2] - a[:, 2])).max())

    def wheels(self, left: Parts) -> FloatArray:
        """Centres and radius (4, 4): front right, front left, rear right, rear left."""
        rows = []
        for right_tyre, left_tyre in zip(self.right("tires"), left.right("tires"), strict=True):
            for tyre, side in ((right_tyre, 1.0), (left_tyre, -1.0)):
                x, _, z = _middle(tyre)
                radius = 0.5 * float(np.ptp(tyre[:, 1]))
                rows.append([side * x, -radius, z, radius])
        return np.array(rows)


def right_keypoints(parts: Parts, class_name: str) -> dict[str, FloatArray]:
    """Keypoints of the right side without mirror and plates, and of the middle; names without "right_"."""
    hubs = parts.hubs()
    found = {"front_wheel": _middle(hubs[0]), "rear_wheel": _middle(hubs[-1])}
    found["headlamp"] = parts.lamp_end(["lights"], 1.0)
    found["taillamp"] = parts.lamp_end(["lights.red", "lights.orange"], -1.0)
    found["windscreen_top"], found["windscreen_bottom"] = parts.pane_ends(1.0)
    low = parts.body[parts.body[:, 1] > parts.body[:, 1].max() - 0.12]
    found["front_bumper"], found["rear_bumper"] = _most(low, (1.0, 0.3, 1.0)), _most(low, (1.0, 0.3, -1.0))
    first, last = parts.side_panes[0], parts.side_panes[-1]
    if class_name == "pickup":
        return found | _bed(parts)
    found["rear_window_top"], found["rear_window_bottom"] = parts.pane_ends(-1.0)
    found["belt_b"], found["belt_c"] = _most(first, (0.0, 1.0, -1.0)), _most(last, (0.0, 1.0, -1.0))
    found["side_window_top"] = _most(first, (0.0, -1.0, -0.5))
    found["roof_rear"] = _most(parts.body, (0.6, -1.0, -1.0))
    return found


def _bed(parts: Parts) -> dict[str, FloatArray]:
    """Cab's rear corner, bed and tailgate of a pickup."""
    _, bottom = parts.pane_ends(-1.0)
    body = parts.body
    roof = body[body[:, 1] < parts.pane_ends(-1.0)[0][1] + 0.02]
    behind = body[body[:, 2] < bottom[2] + 0.02]
    rear = behind[behind[:, 2] < body[:, 2].min() + 0.15]
    rail = rear[:, 1].min()
    top = behind[np.abs(behind[:, 1] - rail) < 0.06]
    low = body[body[:, 1] > body[:, 1].max() - 0.12]
    corner = _most(top, (1.0, -0.3, -1.0))
    return {
        "cab_roof_rear": _most(roof, (0.6, 0.0, -1.0)),
        "bed_front": _most(top, (0.6, 0.0, 1.0)),
        "bed_rear_top": corner,
        "bed_rear_bottom": _most(low, (1.0, 0.3, -1.0)),
        "tailgate": corner * [0.0, 1.0, 1.0],
    }


def largest_distance(components: Sequence[Component], points: FloatArray) -> tuple[float, FloatArray]:
    """Largest distance of points from the surface, and the nearest points (N, 3) on it."""
    triangles = np.concatenate([part.vertices[part.faces] for part in components])
    nearest = np.array([_nearest(triangles, point) for point in points])
    return float(np.linalg.norm(nearest - points, axis=1).max()), nearest


def _nearest(triangles: FloatArray, point: FloatArray) -> FloatArray:
    """The point of triangles (F, 3, 3) nearest to a point."""
    a, b, c = (triangles[:, i] for i in range(3))
    flat = unit(cross(b - a, c - a))
    onto = point - np.einsum("ij,ij->i", point - a, flat)[:, None] * flat
    sides = [np.einsum("ij,ij->i", cross(q - p, onto - p), flat) for p, q in ((a, b), (b, c), (c, a))]
    within = (np.min(sides, axis=0) >= 0.0) & (np.abs(flat).sum(axis=1) > 0.0)
    candidates = [onto[within]]
    for p, q in ((a, b), (b, c), (c, a)):
        along = q - p
        w = np.einsum("ij,ij->i", point - p, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-12)
        candidates.append(p + w.clip(0.0, 1.0)[:, None] * along)
    points = np.concatenate(candidates)
    return np.asarray(points[np.linalg.norm(points - point, axis=1).argmin()])


def _middle(points: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def _most(points: FloatArray, direction: tuple[float, float, float]) -> FloatArray:
    """The point farthest in a direction."""
    return np.asarray(points[np.argmax(points @ np.array(direction))])
