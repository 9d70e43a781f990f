"""Which faces of a mesh can show in a window, found on the CPU before its vertices are shaded.

Software spends most of its time for a vehicle on vertices, and half of them belong to faces turned away. Only
faces that OpenGL would drop are left out, so the picture is the same to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Faces = NDArray[np.int32]

# OpenGL decides which way a face is turned after it has rounded its corners: by this fraction of the
# largest coordinate (float32) and of a drawn pixel (llvmpipe keeps 1/256 of one), safety included.
_ROUNDED, _SNAPPED = 4e-6, 1.0 / 16.0
_MARGIN = 0.01  # metres around a face in the test of the window
_ALWAYS = 1e9


@dataclass(frozen=True, eq=False)
class Aim:
    """A window's view of one object: clip_from_object (4, 4), the eye (3,) in the object's frame, `doubt`: a
    face is left out when twice its area, times the eye's distance behind its plane, exceeds `doubt` times its
    longest edge (m^2)."""

    clip: NDArray[np.float64]
    eye: NDArray[np.float64]
    doubt: float

    @classmethod
    def at(
        cls,
        clip: NDArray[np.float64],
        pose: Floats,
        corners: NDArray[np.float64],
        eye: NDArray[np.float64],
        focal: float,
    ) -> Aim | None:
        """The aim of `clip` = clip_from_world at an object of rows `pose` (12,), box `corners` (8, 3).

        None for an object that reaches behind the near plane, where faces are cut.
        """
        rows = pose.reshape(3, 4).astype(float)
        z, w = (corners @ clip[2:, :3].T + clip[2:, 3]).T
        if (z <= -w).any():
            return None
        farthest = float(w.max())
        largest = float(np.abs(corners).max() + np.abs(eye).max())
        doubt = farthest * (_SNAPPED * farthest / focal + _ROUNDED * largest)
        return cls(clip @ np.vstack([rows, [0.0, 0.0, 0.0, 1.0]]), rows[:, :3].T @ (eye - rows[:, 3]), doubt)


class FaceTable:
    """The planes and bounds of faces (F, 3); `moving` (V,) vertices do not stay where the mesh has them."""

    def __init__(self, positions: Floats, faces: Faces, moving: NDArray[np.bool_]) -> None:
        """Compute the table."""
        self._faces = faces
        corners = positions[faces].astype(float)
        a, b, c = (corners[:, i] for i in range(3))
        normals = np.cross(b - a, c - a)
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
        middle = corners.mean(axis=1)
        reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1) + _MARGIN
        unknown = moving[faces].any(axis=1)
        edges[unknown] = reach[unknown] = _ALWAYS
        offsets = -np.einsum("ij,ij->i", normals, a)
        self._planes = np.column_stack([normals, offsets, edges]).astype(np.float32)
        bounds = np.column_stack([middle, np.ones(len(middle)), reach])
        self._bounds = np.ascontiguousarray(bounds.T, dtype=np.float32)

    def seen(self, aim: Aim) -> Faces:
        """The faces (N, 3), in their order, that may be turned to the eye and inside the window."""
        towards = np.array([*aim.eye, 1.0, aim.doubt], dtype=np.float32)
        # all numbers are finite, but BLAS may set the flag for what it reads beside a matrix of five columns
        with np.errstate(invalid="ignore"):
            kept = self._planes @ towards > 0.0
        sides = np.concatenate([aim.clip[3] + aim.clip[:2], aim.clip[3] - aim.clip[:2]])
        lengths = np.linalg.norm(sides[:, :3], axis=1, keepdims=True)
        inside = np.hstack([sides, lengths]).astype(np.float32) @ self._bounds
        kept &= (inside > 0.0).all(axis=0)
        return np.compress(kept, self._faces, axis=0)  # three times as fast as an index
