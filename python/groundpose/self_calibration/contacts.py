"""Where vehicles touch the road: points in the camera frame and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray
from groundpose.shape import ShapeModel
from groundpose.sizes import SizePrior


@dataclass(frozen=True, eq=False)
class Contacts:
    """N contacts of vehicles that are as large as their classes are supposed to be.

    Args:
        points: (N, 3) metres, camera frame, the middle of each bottom face.
        covariances: (N, 3, 3) of the points.
        classes: (N,) row of `names`.
        vehicles: (N,) row of the vehicle, 0 to V - 1.
        names: the classes.
        class_sigmas: (C,) standard deviation of the logarithm of a class' mean size.
        own_sigmas: (C,) of a vehicle's size about it.
    """

    points: FloatArray
    covariances: FloatArray
    classes: NDArray[np.int64]
    vehicles: NDArray[np.int64]
    names: tuple[str, ...]
    class_sigmas: FloatArray
    own_sigmas: FloatArray

    @classmethod
    def of(
        cls,
        R: FloatArray,
        t: FloatArray,
        covariance: FloatArray,
        models: Sequence[ShapeModel],
        vehicles: NDArray[np.int64],
        sizes: SizePrior,
    ) -> Contacts:
        """From poses (N, 3, 3), (N, 3), (N, 6, 6) of vehicles with these models."""
        names = tuple(sorted({model.name for model in models}))
        scales = np.array([sizes.scale(name) for name in names]).reshape(-1, 3)
        arms = np.einsum("nij,nj->ni", R, np.array([m.bottom_centre for m in models]).reshape(-1, 3))
        by_pose = np.zeros((len(t), 3, 6))
        x, y, z = arms.T
        by_pose[:, 0, 1], by_pose[:, 0, 2] = z, -y
        by_pose[:, 1, 0], by_pose[:, 1, 2] = -z, x
        by_pose[:, 2, 0], by_pose[:, 2, 1] = y, -x
        by_pose[:, range(3), range(3, 6)] = 1.0
        index = {name: k for k, name in enumerate(names)}
        return cls(
            points=t + arms,
            covariances=by_pose @ covariance @ by_pose.transpose(0, 2, 1),
            classes=np.array([index[m.name] for m in models], np.int64),
            vehicles=np.unique(vehicles, return_inverse=True)[1].astype(np.int64),
            names=names,
            class_sigmas=scales[:, 1],
            own_sigmas=scales[:, 2],
        )

    def __len__(self) -> int:
        """N."""
        return len(self.points)

    def __getitem__(self, rows: NDArray[Any]) -> Contacts:
        """Some of them, by a mask."""
        return Contacts(
            self.points[rows],
            self.covariances[rows],
            self.classes[rows],
            np.unique(self.vehicles[rows], return_inverse=True)[1].astype(np.int64),
            self.names,
            self.class_sigmas,
            self.own_sigmas,
        )

    @property
    def vehicle_count(self) -> int:
        """How many vehicles."""
        return len(np.unique(self.vehicles))
