"""Shape models: mean keypoints, modes of variation, 3D box and footprint of a class of objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from groundpose import _core
from groundpose._checks import FloatArray, finite, input_error, integer, number, shaped, text, type_error
from groundpose._core import InputError
from groundpose._npz import read_arrays
from groundpose._value import Value
from groundpose._writing import whole_file

# Version of the .npz files; raised when a reader of the old version could not read the new one.
FILE_VERSION = 1

ARRAYS: dict[str, tuple[int | str, ...]] = {
    "keypoints_3d": ("P", 3),
    "bbox_3d": (2, 3),
    "basis": ("M", "P", 3),
    "eigenvalues": ("M",),
    "footprint": ("C", 2),
    "bbox_basis": ("M", 2, 3),
}
"""The arrays of a model and their shapes: what files of models hold, beside names."""
_ALWAYS = ("keypoints_3d", "bbox_3d", "basis", "eigenvalues")

_LENGTH_HEIGHT_WIDTH = [2, 1, 0]
"""Axes of the object frame in this order."""

# Modes whose standard deviation over the model's size is below this are rounding errors of equal models.
_NO_DEVIATION = 1e-12


@dataclass(frozen=True, eq=False, init=False, repr=False)
class ShapeModel(Value):
    """Keypoints of a class of objects, `X = keypoints_3d + sum_j shape_coefficients[j] * basis[j]`.

    The object frame has x to the right, y down and z forward, metres; its origin is free (paper,
    sec. 3.4, active shape model). All arrays are read-only copies.

    Args:
        keypoints_3d: (P, 3) metres, the mean.
        bbox_3d: (2, 3) metres, `[min, max]` corner; None: the extent of `keypoints_3d`.
        basis: (M, P, 3) metres, one mode of variation each; None: a rigid model.
        eigenvalues: (M,) m^2, variance of each mode's coefficient, positive.
        keypoint_names: P names or none.
        footprint: (C, 2) metres, `[x, z]` corners of the convex outline seen from above, in order;
            None: the rectangle of `bbox_3d`.
        name: of the class.
        bbox_basis: (M, 2, 3) metres, how the 3D box moves in each mode; None: it stays that of the mean.

    Raises:
        InputError: a shape or value that cannot be. TypeError: not numbers.
    """

    keypoints_3d: FloatArray
    bbox_3d: FloatArray
    basis: FloatArray
    eigenvalues: FloatArray
    keypoint_names: tuple[str, ...]
    footprint: FloatArray | None
    name: str
    bbox_basis: FloatArray | None
    _handle: _core.Model = field(init=False)

    def __init__(
        self,
        keypoints_3d: ArrayLike,
        bbox_3d: ArrayLike | None = None,
        basis: ArrayLike | None = None,
        eigenvalues: ArrayLike | None = None,
        keypoint_names: Sequence[str] = (),
        footprint: ArrayLike | None = None,
        name: str = "",
        bbox_basis: ArrayLike | None = None,
    ) -> None:
        """Check and copy the arrays."""
        mean = _checked("keypoints_3d", keypoints_3d, ("P", 3))
        count = len(mean)
        if count == 0:
            raise input_error("keypoints_3d", "at least one keypoint", "none")
        if (basis is None) != (eigenvalues is None):
            given, missing = ("eigenvalues", "basis") if basis is None else ("basis", "eigenvalues")
            raise input_error(missing, f"an array, because {given} is given", None)
        modes = _checked("basis", np.zeros((0, count, 3)) if basis is None else basis, ("M", count, 3))
        arrays = {
            "keypoints_3d": mean,
            "bbox_3d": _checked("bbox_3d", extent(mean) if bbox_3d is None else bbox_3d, (2, 3)),
            "basis": modes,
            "eigenvalues": _checked(
                "eigenvalues", np.zeros(0) if eigenvalues is None else eigenvalues, (len(modes),)
            ),
        }
        outline = None if footprint is None else _checked("footprint", footprint, ("C", 2))
        follows = None if bbox_basis is None else _checked("bbox_basis", bbox_basis, (len(modes), 2, 3))
        names = _names(keypoint_names, count)
        handle = _core.Model(**arrays, footprint=outline, bbox_basis=follows)
        self._set(**arrays, footprint=outline, bbox_basis=follows, keypoint_names=names)
        self._set(name=text("name", name), _handle=handle)

    def __repr__(self) -> str:
        """Name and sizes."""
        return f"ShapeModel(name={self.name!r}, keypoints={len(self.keypoints_3d)}, modes={self.modes})"

    @property
    def modes(self) -> int:
        """Number of modes of variation, M."""
        return len(self.eigenvalues)

    @property
    def size(self) -> tuple[float, float, float]:
        """`(length, height, width)` of the 3D box, metres."""
        width, height, length = (self.bbox_3d[1] - self.bbox_3d[0]).tolist()
        return length, height, width

    def keypoints(self, shape_coefficients: ArrayLike = ()) -> FloatArray:
        """Keypoints (P, 3), metres, of the shape with coefficients (M,); without any, the mean."""
        return _deformed(self.keypoints_3d, self._coefficients(shape_coefficients), self.basis)

    def bbox_3d_of(self, shape_coefficients: ArrayLike = ()) -> FloatArray:
        """3D box (2, 3), metres, of the shape with coefficients (M,); the mean's without `bbox_basis`."""
        coefficients = self._coefficients(shape_coefficients)
        if self.bbox_basis is None:
            return self.bbox_3d
        return _deformed(self.bbox_3d, coefficients, self.bbox_basis)

    def stretched_bbox_3d(self, shape_coefficients: FloatArray) -> FloatArray:
        """3D box (2, 3), metres, of an estimated shape: the mean's, stretched about its bottom centre as the
        extent of the keypoints is. Coefficients beyond the model's own M are not looked at."""
        return np.asarray(self.stretched_boxes_3d(shape_coefficients[None])[0])

    def stretched_boxes_3d(self, shape_coefficients: FloatArray) -> FloatArray:
        """`stretched_bbox_3d` of n shapes with coefficients (n, M or more): (n, 2, 3)."""
        return self._stretched(self._shapes(shape_coefficients))

    def stretched_size(self, shape_coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Length, height and width (3,) of `stretched_bbox_3d`, metres, and the derivatives (M, 3) of their
        logarithms by the coefficients."""
        sizes, slopes = self.stretched_sizes(shape_coefficients[None])
        return sizes[0], slopes[0]

    def stretched_sizes(self, shape_coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
        """`stretched_size` of n shapes with coefficients (n, M or more): (n, 3) and (n, M, 3)."""
        axes, points = np.arange(3), self._shapes(shape_coefficients)
        boxes, now = self._stretched(points), np.ptp(points, axis=1)
        moved = self.basis[:, points.argmax(axis=1), axes] - self.basis[:, points.argmin(axis=1), axes]
        slopes = np.divide(moved, now, out=np.zeros_like(moved), where=now > 0.0).transpose(1, 0, 2)
        sizes = boxes[:, 1] - boxes[:, 0]
        return sizes[:, _LENGTH_HEIGHT_WIDTH], slopes[:, :, _LENGTH_HEIGHT_WIDTH]

    def _shapes(self, shape_coefficients: FloatArray) -> FloatArray:
        """Keypoints (n, P, 3) of n shapes, summed as `_deformed` does."""
        points = np.repeat(self.keypoints_3d[None], len(shape_coefficients), axis=0)
        for coefficient, mode in zip(shape_coefficients.T, self.basis, strict=False):
            points += coefficient[:, None, None] * mode
        return points

    def _stretched(self, points: FloatArray) -> FloatArray:
        """The mean's 3D box for each of n shapes (n, P, 3): (n, 2, 3)."""
        if not self.modes:
            return np.repeat(self.bbox_3d[None], len(points), axis=0)
        before, fixed = self._mean_extent, self.bottom_centre
        factor = np.ones((len(points), 3))
        np.divide(points.max(axis=1) - points.min(axis=1), before, out=factor, where=before > 0.0)
        return np.asarray(fixed + factor[:, None] * (self.bbox_3d - fixed))

    @cached_property
    def _mean_extent(self) -> FloatArray:
        """Of the mean's keypoints along each axis (3,)."""
        return np.asarray(np.ptp(self.keypoints_3d, axis=0))

    @cached_property
    def bottom_centre(self) -> FloatArray:
        """Middle (3,), metres, of the bottom face of the 3D box; read-only."""
        low, high = self.bbox_3d
        middle = np.asarray(0.5 * (low + high))
        middle[1] = high[1]
        middle.setflags(write=False)
        return middle

    def _coefficients(self, given: ArrayLike) -> FloatArray:
        coefficients = given if np.size(given) else np.zeros(self.modes)
        return shaped("shape_coefficients", coefficients, (self.modes,))

    @classmethod
    def fit(
        cls,
        models: ArrayLike,
        modes: int = 5,
        *,
        bbox_3d: ArrayLike | None = None,
        keypoint_names: Sequence[str] = (),
        footprint: ArrayLike | None = None,
        name: str = "",
    ) -> ShapeModel:
        """The mean and principal components of aligned models of one class.

        Args:
            models: (S, P, 3) metres, keypoints of S models in one object frame (aligned already).
            modes: number of components kept, at most S - 1; components without variance (equal
                models) are left out.
            bbox_3d: (2, 3), or (S, 2, 3), the box of each model: the mean box, which follows the shape by
                least squares; None: extent of the mean.
            keypoint_names, footprint, name: as of the class.

        The modes are orthonormal over all coordinates and a coefficient's variance over the models
        is its eigenvalue (Cootes et al., 1995: active shape models).

        Raises:
            InputError: wrong shapes, numbers that are not finite, or more modes than models allow.
        """
        stack = finite("models", shaped("models", models, ("S", "P", 3)))
        count, modes = len(stack), integer("modes", modes)
        if count == 0:
            raise input_error("models", "at least one model", "none")
        limit = min(count - 1, stack[0].size)
        if not 0 <= modes <= limit:
            raise input_error("modes", f"0 to {limit} with {count} models", modes)
        mean = stack.mean(axis=0)
        _, s, components = np.linalg.svd((stack - mean).reshape(count, -1), full_matrices=False)
        variance = s[:modes] ** 2 / max(count - 1, 1)
        kept = variance > _NO_DEVIATION**2 * np.sum(mean**2)
        components = components[:modes][kept]
        bbox = None if bbox_3d is None else shaped("bbox_3d", bbox_3d, (2, 3), (count, 2, 3))
        bbox_basis = None
        if bbox is not None and bbox.ndim == 3:
            coefficients = (stack - mean).reshape(count, -1) @ components.T
            each, bbox = finite("bbox_3d", bbox), bbox.mean(axis=0)
            # Coefficients are uncorrelated: the regression is one mode at a time.
            moved = np.tensordot(coefficients.T, each - bbox, axes=1)
            bbox_basis = moved / np.square(coefficients).sum(axis=0)[:, None, None]
        basis = components.reshape(-1, *mean.shape)
        return cls(mean, bbox, basis, variance[kept], tuple(keypoint_names), footprint, name, bbox_basis)

    def scaled(self, length: float, height: float, width: float) -> ShapeModel:
        """The model stretched along its axes about the origin, so that its 3D box has this size (metres).

        The modes are stretched with it: a coefficient keeps its meaning and its variance.
        """
        wanted = [number("width", width), number("height", height), number("length", length)]
        for side, value in zip(("width", "height", "length"), wanted, strict=True):
            if not (np.isfinite(value) and value > 0.0):
                raise input_error(side, "a positive number of metres", value)
        factor = np.array(wanted) / (self.bbox_3d[1] - self.bbox_3d[0])
        footprint = None if self.footprint is None else self.footprint * factor[[0, 2]]
        bbox_basis = None if self.bbox_basis is None else self.bbox_basis * factor
        return ShapeModel(
            self.keypoints_3d * factor,
            self.bbox_3d * factor,
            self.basis * factor,
            self.eigenvalues,
            self.keypoint_names,
            footprint,
            self.name,
            bbox_basis,
        )

    def resized(self, factor: float) -> ShapeModel:
        """The model `factor` times as large, with the same proportions."""
        length, height, width = self.size
        return self.scaled(factor * length, factor * height, factor * width)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model to `path` (.npz, arrays and strings only)."""
        arrays = {key: array for key in ARRAYS if (array := getattr(self, key)) is not None}
        names = np.array(self.keypoint_names, dtype=np.str_)
        with whole_file(path, "wb") as file:  # np.savez would add a suffix to a bare path
            np.savez(file, version=FILE_VERSION, name=self.name, keypoint_names=names, **arrays)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> ShapeModel:
        """Read a model written by `save`. Raises OSError (no such file) or InputError (not a model)."""
        content = read_arrays(path, "a shape model (.npz)")
        version = content.get("version")
        if version is None or version.shape != () or version.dtype.kind != "i":
            raise input_error(str(path), "a shape model (.npz)", f"an .npz of {sorted(content)}")
        if version > FILE_VERSION:
            raise input_error(str(path), f"version {FILE_VERSION} or older", f"{version}; update groundpose")
        try:
            arrays = {key: content[key] for key in ARRAYS if key in _ALWAYS or key in content}
            listed, name = content["keypoint_names"].tolist(), str(content["name"])
        except KeyError as error:
            raise input_error(str(path), f"an array {error}", sorted(content)) from None
        try:
            return cls(**arrays, keypoint_names=listed, name=name)
        except (InputError, TypeError) as error:
            raise InputError(f"{path}: {error}") from None


def extent(points: FloatArray) -> FloatArray:
    """`[min, max]` corner (2, D) of points (N, D)."""
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _deformed(mean: FloatArray, coefficients: FloatArray, basis: FloatArray) -> FloatArray:
    """`mean + sum_j coefficients[j] * basis[j]`, one mode after the other: BLAS rounds as its kernel does."""
    total: FloatArray = mean.copy()
    for coefficient, mode in zip(coefficients, basis, strict=True):
        total += coefficient * mode
    return total


def _checked(name: str, value: object, shape: tuple[int | str, ...]) -> FloatArray:
    """A read-only copy of finite numbers of `shape`: the Rust side holds its own copy, checked once."""
    array: FloatArray = finite(name, shaped(name, value, shape)).copy()
    array.setflags(write=False)
    return array


def _names(value: object, count: int) -> tuple[str, ...]:
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise type_error("keypoint_names", "a sequence of str", value)
    names = tuple(value)
    if not all(isinstance(name, str) for name in names):
        raise type_error("keypoint_names", "a sequence of str", value)
    if len(names) not in (0, count):
        raise input_error("keypoint_names", f"{count} names, one per keypoint", len(names))
    return names
