"""Results: the poses of one image."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from os import PathLike
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from groundpose import _core
from groundpose._checks import FloatArray, input_error, integer, number, type_error
from groundpose.plausibility import answer_remarks, box_remarks, camera_remarks
from groundpose.remarks import estimated_tilt_remarks, tilt_remarks
from groundpose.shape import ShapeModel
from groundpose.types import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from typing_extensions import Self


Text = TypeVar("Text")
Flag = TypeVar("Flag")
Number = TypeVar("Number")
Count = TypeVar("Count")


def spec(*shape: int | str, written: bool = True, unit: str = "") -> dict[str, Any]:
    """Of a result field: its shape for one object, whether `formats.records` writes it, and its unit.

    "P" and "M" are the numbers of an object's keypoints and modes. A batch is as wide as its largest model.
    """
    return {"shape": shape, "written": written, "unit": unit}


@dataclass(frozen=True, eq=False, kw_only=True)
class ResultFields(Generic[Text, Flag, Number, Count]):
    """The result for an object: the fields of `Pose` and, with N before each shape, of `PoseBatch`.

    `Text`, `Flag`, `Number` and `Count` are `str`, `bool`, `float` and `int` in a `Pose`, and arrays (N,) of
    them in a `PoseBatch`. This is the one list of result fields: the solver's core gives an array of each
    name, and all else that is done with every field follows from here.
    """

    status: Text = field(metadata=spec())
    """"ok", or why there is no pose."""
    ok: Flag = field(metadata=spec(written=False))
    """Whether there is a pose."""
    R: FloatArray = field(metadata=spec(3, 3))
    """(3, 3) rotation of the pose `X_camera = R @ X_object + t`."""
    t: FloatArray = field(metadata=spec(3, unit="m"))
    """(3,) metres, translation of the pose."""
    yaw: Number = field(metadata=spec(unit="rad"))
    """Radians about the ground's normal, 0 = facing away; KITTI's rotation_y + pi/2."""
    keypoints_2d: FloatArray = field(metadata=spec("P", 2, written=False, unit="px"))
    """(P, 2) pixels, a copy of what was given, NaN = not seen."""
    inlier_count: Count = field(metadata=spec())
    """Number of inliers."""
    inlier_mask: NDArray[np.bool_] = field(metadata=spec("P"))
    """(P,) which keypoints are inliers of the pose returned: `residuals <= inlier_threshold`."""
    inlier_threshold: Number = field(metadata=spec(unit="px"))
    """Pixels, the threshold used."""
    residuals: FloatArray = field(metadata=spec("P", unit="px"))
    """(P,) undistorted pixels between keypoint and projection, NaN = not seen; through a wide lens, pixels of
    the pinhole view that faces the object, which are those of the picture near its middle."""
    reprojection_rmse: Number = field(metadata=spec(unit="px"))
    """Pixels, root mean square of the inliers' residuals."""
    noise_sigma: Number = field(metadata=spec(unit="px"))
    """Pixels, estimated standard deviation of a coordinate of an inlier."""
    score: Number = field(metadata=spec())
    """Mean over the keypoints of `min(residual^2 / inlier_threshold^2, 1)`, weighed by their scores: 0 is
    perfect, 1 explains nothing."""
    log10_nfa: Number = field(metadata=spec())
    """Log10 of the number of poses as good as this to expect among random keypoints (number of false alarms):
    the lower, the less likely it is an accident."""
    ambiguity: Number = field(metadata=spec())
    """Of a network's keypoints: probability that the object faces the half of the directions turned away from
    this pose. Of the caller's: 0 to 1, how well a clearly different pose (front and back exchanged, say)
    explains the keypoints, compared with the pose returned. `alternatives` has that pose."""
    probability: Number = field(metadata=spec())
    """Probability that the answer is right: yaw within 15 degrees, distance within 15 %."""
    evidence: FloatArray = field(metadata=spec(_core.EVIDENCE, written=False))
    """(6,) what `probability` follows from, 0 = not known: logit of the mean score (without scores: of the
    fraction of inliers); log of the misfit between projected and given box against 2 % of its longer side;
    log of `noise_sigma` against 1 % of it; `log10_nfa` / 10; logit of the probability of a vehicle; logit of
    `ambiguity`."""
    confidence: Number = field(metadata=spec())
    """Probability of having drawn a good sample."""
    covariance: FloatArray = field(metadata=spec(6, 6, unit="rad, m"))
    """(6, 6) of `[rotation vector (radians, perturbs R from the left), t (metres)]`."""
    alternative_R: FloatArray = field(metadata=spec(3, 3))
    """(3, 3) rotation of the best pose that faces another way; NaN where it is less probable than 2 %."""
    alternative_t: FloatArray = field(metadata=spec(3, unit="m"))
    """(3,) metres, its translation."""
    alternative_yaw: Number = field(metadata=spec(unit="rad"))
    """Radians, its yaw."""
    alternative_covariance: FloatArray = field(metadata=spec(6, 6, written=False, unit="rad, m"))
    """(6, 6) its covariance."""
    alternative_probability: Number = field(metadata=spec())
    """Probability that it is right, and the answer is not."""
    shape_coefficients: FloatArray = field(metadata=spec("M", unit="m"))
    """(M,) coefficients of the model's modes."""
    shape_covariance: FloatArray = field(metadata=spec("M", "M", unit="m^2"))
    """(M, M) of the coefficients."""
    shape_pose_covariance: FloatArray = field(metadata=spec("M", 6, written=False, unit="m rad, m^2"))
    """(M, 6) of the coefficients with the pose."""
    solver: Text = field(metadata=spec())
    """The minimal solver that found the pose."""
    iterations: Count = field(metadata=spec())
    """Samples drawn."""
    hypotheses: Count = field(metadata=spec())
    """Poses scored."""
    stop_reason: Text = field(metadata=spec())
    """Why the search stopped."""
    stage_iterations: NDArray[np.int64] = field(metadata=spec(3, written=False))
    """(3,) iterations of the refinement's stages."""
    stage_costs: FloatArray = field(metadata=spec(3, written=False))
    """(3,) final costs of the refinement's stages."""


# The fields that a batch has, with `_OTHERS` what makes the others: `vars` of a batch makes them.
_kept: Callable[[object], dict[str, Any]] = vars(ResultFields)["__dict__"].__get__
_OTHERS = "_others"


class Others(Protocol):
    """Makes the other fields of a batch."""

    def __call__(self, name: str, kept: dict[str, Any]) -> Any:
        """The value of a field, which may put several into what is kept."""

    def fill(self, kept: dict[str, Any]) -> None:
        """Add all that are not there."""


SHAPES: dict[str, tuple[int | str, ...]] = {f.name: f.metadata["shape"] for f in fields(ResultFields)}
"""Of one object's value of each result field; "P" and "M" are its numbers of keypoints and modes."""
# Fields of an object that are one number or text, and of the arrays the axes that are cut to its own.
_SINGLE = tuple(name for name, shape in SHAPES.items() if not shape)
_SEVERAL = {name: tuple(n for n in shape if n in ("P", "M")) for name, shape in SHAPES.items() if shape}
WRITTEN = tuple(f.name for f in fields(ResultFields) if f.metadata["written"])
"""Names of the result fields that `formats.records` writes, in order."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pose(ResultFields[str, bool, float, int]):
    """The answer for one object: the fields of `ResultFields`, cut to its own P keypoints and M modes.

    Attributes:
        bbox: (4,) `left, top, right, bottom` pixels as given, NaN = not known.
        model: its shape model.
    """

    bbox: FloatArray
    model: ShapeModel

    @property
    def keypoints_3d(self) -> FloatArray:
        """(P, 3) metres in the object frame, the estimated shape applied; NaN without an answer."""
        return self.model.keypoints(self.shape_coefficients)


@dataclass(frozen=True, eq=False, kw_only=True)
class Alternatives:
    """The other reading of each of N objects: the best pose that faces another way; NaN where there is none.

    Attributes:
        R, t, yaw, covariance: (N, 3, 3), (N, 3), (N,), (N, 6, 6), as those of a `PoseBatch`.
        probability: (N,) that this pose is right, and the answer is not.
    """

    R: FloatArray
    t: FloatArray
    yaw: FloatArray
    covariance: FloatArray
    probability: FloatArray


def region_radius2(level: float, dimensions: int, dof: float = np.inf) -> float:
    """Squared Mahalanobis distance, in `dimensions`, that holds errors of Student's t with `dof` degrees of
    freedom with the probability `level`: `d F_{d, dof}(level) (dof - 2) / dof`, a chi-square quantile for an
    infinite `dof`.

    Raises:
        InputError: a level that is not between 0 and 1, no dimension, a `dof` of 2 or less.
    """
    if integer("dimensions", dimensions) < 1:
        raise input_error("dimensions", "1 or more", dimensions)
    return _core.region_radius2(number("level", level), int(dimensions), number("dof", dof))


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseBatch(ResultFields[NDArray[np.str_], NDArray[np.bool_], FloatArray, NDArray[np.int64]]):
    """The poses of the N objects of one image, in the order given: the fields of `ResultFields` as arrays.

    An object without an answer has a status other than "ok", NaN numbers and no inliers. P is the
    largest number of keypoints of a model here, M that of modes; beyond an object's own there is
    NaN for keypoints (False in the mask) and 0 for modes.

    Attributes:
        view: camera, tilt and height the poses belong to: nominal, or estimated from the whole frame; with
            `frame` an `EstimatedView`.
        nominal_view: the view as it was given.
        nominal_tilt_sigma: (2,) radians, of its pitch and roll; NaN when they are taken as true.
        tilt_covariance: (2, 2) radians^2 of the estimated pitch and roll; NaN when the tilt is nominal.
        bboxes: (N, 4) `left, top, right, bottom` pixels, a copy of what was given, NaN = not known.
        models: N shape models.
        scale_covariance: (N, M + 1) covariance of the logarithm of each model's scale with the coefficients,
            and its variance; 0 without `frame`.
        error_dof: degrees of freedom of Student's t of the errors, see `region`; infinite: Gaussian.
    """

    view: View
    nominal_view: View
    nominal_tilt_sigma: FloatArray
    tilt_covariance: FloatArray
    bboxes: FloatArray
    models: tuple[ShapeModel, ...]
    scale_covariance: FloatArray
    error_dof: float = np.inf

    @property
    def size(self) -> FloatArray:
        """(N, 3) metres, length, height, width of the estimated shapes' 3D boxes; NaN without an answer."""
        return self._sizes()[0]

    @property
    def size_sigma(self) -> FloatArray:
        """(N, 3) metres, standard deviations of `size`: of the shape, and with `frame` of the scale too."""
        return self.size_and_sigma()[1]

    def size_and_sigma(self) -> tuple[FloatArray, FloatArray]:
        """`size` and `size_sigma`, in the time of one of them."""
        size, variance = self._sizes()
        return size, np.asarray(size * np.sqrt(variance))

    def answered_by_model(self) -> list[tuple[ShapeModel, list[int]]]:
        """Each shape model with the numbers of its objects that have an answer."""
        alike: dict[int, list[int]] = {}
        for k in np.flatnonzero(self.ok).tolist():
            alike.setdefault(id(self.models[k]), []).append(k)
        return [(self.models[rows[0]], rows) for rows in alike.values()]

    def _sizes(self) -> tuple[FloatArray, FloatArray]:
        """Sizes (N, 3) and variances (N, 3) of their logarithms."""
        size, variance = np.full((2, len(self), 3), np.nan)
        for model, rows in self.answered_by_model():
            size[rows], slopes = model.stretched_sizes(self.shape_coefficients[rows])
            for k, slope in zip(rows, slopes, strict=True):
                own = self.shape_covariance[k, : model.modes, : model.modes]
                variance[k] = ((own @ slope) * slope).sum(axis=0)
                with_shape = self.scale_covariance[k, : model.modes] @ slope
                variance[k] += 2.0 * with_shape + self.scale_covariance[k, -1]
        return size, np.maximum(variance, 0.0)

    @property
    def position(self) -> FloatArray:
        """(N, 3) metres, the middle of each bottom face in the ground frame of `view`: right, down and
        forward of the camera; NaN without an answer."""
        middles = np.array([model.bottom_centre for model in self.models]).reshape(-1, 3, 1)
        places = (self.R @ middles)[..., 0] + self.t
        return np.asarray(places @ self.view.R_camera_from_ground)

    @property
    def heading(self) -> FloatArray:
        """(N,) radians, direction of each object in the ground frame of `view`: 0 = away from the camera,
        pi / 2 = to the right."""
        ahead = self.R[:, :, 2] @ self.view.R_camera_from_ground
        return np.asarray(np.arctan2(ahead[:, 0], ahead[:, 2]))

    @property
    def alternatives(self) -> Alternatives:
        """The poses of the other readings: NaN for objects that have none above 2 %."""
        return Alternatives(
            R=self.alternative_R,
            t=self.alternative_t,
            yaw=self.alternative_yaw,
            covariance=self.alternative_covariance,
            probability=self.alternative_probability,
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What looks wrong in the input, each as "kind: details", judged from camera, boxes and all poses:
        "nominal pitch: the vehicles disagree with it by 20 deg". Empty when nothing does. Computed when it is
        asked for."""
        size = self.view.camera.image_size
        said = [*camera_remarks(self.nominal_view), *box_remarks(self.bboxes, size)]
        said += [*answer_remarks(self.status.tolist()), *self.view.remarks]
        if np.isfinite(self.tilt_covariance).all():  # the tilt is that of the objects
            return (*said, *estimated_tilt_remarks(self.nominal_view, self.view, self.nominal_tilt_sigma))
        return (*said, *tilt_remarks(self.view, self.R, self.covariance))

    def region(self, level: float = 0.95, dimensions: int = 6) -> float:
        """Squared Mahalanobis distance within which the truth lies with the probability `level`.

        For `dimensions` of an error e, with their part C of `covariance`, the region is
        `e @ inv(C) @ e <= region`; of one number it is an interval of `sqrt(region)` standard deviations to
        either side.

        Raises:
            InputError: a level that is not between 0 and 1, no dimension.
        """
        return region_radius2(level, dimensions, self.error_dof)

    @classmethod
    def _of(cls, values: dict[str, Any]) -> Self:
        """From all fields by name, in a sixth of the time that a frozen dataclass takes to set thirty."""
        made = object.__new__(cls)
        _kept(made).update(values)
        return made

    @classmethod
    def _later(cls, values: dict[str, Any], others: Others) -> Self:
        """From some fields; the others are made when they are first asked for. `vars` has all of them."""
        made = cls._of(values)
        _kept(made)[_OTHERS] = others
        return made

    if not TYPE_CHECKING:  # which would take any name

        def __getattr__(self, name: str) -> Any:
            """A field that nobody has asked for yet."""
            kept = _kept(self)
            others = kept.get(_OTHERS)
            if name in self.__dataclass_fields__ and (others is not None or name in kept):
                return kept.setdefault(
                    name, others and others(name, kept)
                )  # another thread may have been faster
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

        @property
        def __dict__(self) -> dict[str, Any]:
            """All fields."""
            kept = _kept(self)
            others = kept.get(_OTHERS)
            if others is not None:
                others.fill(kept)
                kept.pop(_OTHERS, None)
            return kept

        def __getstate__(self) -> dict[str, Any]:
            """What is pickled and copied."""
            return vars(self)

    def __len__(self) -> int:
        """Number of objects, N."""
        return len(self.status)

    def __repr__(self) -> str:
        """How many have an answer."""
        return f"PoseBatch({int(self.ok.sum())} of {len(self)} ok)"

    def __iter__(self) -> Iterator[Pose]:
        """The answers one by one."""
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: int) -> Pose:
        """The answer for object `index`. Raises IndexError, TypeError (a slice: use the arrays)."""
        try:
            i = operator.index(index)
        except TypeError:
            raise type_error("index", "a whole number", index) from None
        if not -len(self) <= i < len(self):
            raise IndexError(f"index: expected {-len(self)} to {len(self) - 1}, got {i}")
        model = self.models[i]
        sizes = {"P": len(model.keypoints_3d), "M": model.modes}
        fields = vars(self)
        own: dict[str, Any] = {name: fields[name].item(i) for name in _SINGLE}
        for name, shape in _SEVERAL.items():
            place = (i, *(slice(sizes[n]) for n in shape))
            own[name] = fields[name][place]
        # in half the time that a frozen dataclass takes to set them
        pose = object.__new__(Pose)
        vars(pose).update({name: own[name] for name in SHAPES}, bbox=self.bboxes[i], model=model)
        return pose

    def keypoints_3d(self, index: int) -> FloatArray:
        """(P, 3) metres in the object frame of object `index`, its shape applied; NaN without an answer."""
        return self[index].keypoints_3d

    def to_kitti(self, names: Sequence[str] | None = None, scores: ArrayLike | None = None) -> str:
        """Lines of KITTI's object result format, one per object (`groundpose.formats.kitti.results`).

        Args:
            names: N class names; None: the models' names, "Car" for those without.
            scores: (N,) detection scores, higher is better; None: fraction of the seen keypoints
                that are inliers, 0 without an answer.
        """
        from groundpose.formats.kitti.results import format_results  # stands above this file

        return format_results(self, names, scores)

    def to_supervision(self) -> Any:
        """`supervision.Detections` for its annotators (`pip install groundpose[supervision]`).

        Of the objects whose 2D boxes are known: the box, `probability` as confidence (0 without a pose), the
        number of the class in `groundpose.vehicles.CLASSES` (-1: none of these), and as `data` `index` (in
        this batch), `class_name`, `status`, `yaw`, `centre` (3,) and `size` (3,) of the 3D box in metres
        (camera frame; length, height, width), `R` (3, 3) from axes x forward, y left, z up, and `cuboid`
        (8, 2), its corners in pixels in the order of `groundpose.formats.columns.CORNERS`; NaN without a
        pose.

        Raises:
            InputError: supervision is not installed.
        """
        from groundpose.formats.neighbours.supervision import to_supervision  # stands above this file

        return to_supervision(self)

    def to_arrow(self, frame: str = "") -> Any:
        """A `pyarrow.Table` with a row for each object: all fields, see `groundpose.formats.arrow_schema`.

        Args:
            frame: of the column `frame`.

        Raises:
            InputError: pyarrow is not installed (extra `parquet`).
        """
        from groundpose.formats.arrow_poses import to_arrow  # stands above this file

        return to_arrow(self, frame)

    def to_pandas(self, frame: str = "") -> Any:
        """`to_arrow` as a `pandas.DataFrame`. Raises InputError when pyarrow or pandas is not installed."""
        table = self.to_arrow(frame)
        try:
            found = table.to_pandas()
        except ModuleNotFoundError as error:
            raise input_error(
                "to_pandas", "pandas (pip install pandas)", f"no package {error.name}"
            ) from None
        # not every version of pandas and pyarrow takes them along
        found.attrs |= {key.decode(): text.decode() for key, text in table.schema.metadata.items()}
        return found

    def to_records(self, frame: str = "") -> list[dict[str, Any]]:
        """`to_arrow` as plain Python: a dictionary for each object. Raises InputError without pyarrow."""
        records: list[dict[str, Any]] = self.to_arrow(frame).to_pylist()
        return records

    @classmethod
    def from_arrow(cls, table: Any) -> Self:
        """The batch of what `to_arrow`, `to_pandas` or `to_records` gave, or of the rows of one frame of a
        larger table, bit for bit. Ids of objects are texts, and `VehiclePoses` lose their seconds.

        Raises:
            InputError: a schema of another version, missing columns or values, rows of several frames, a
                frame that could not be estimated; no row, and not the metadata of `to_arrow`.
            TypeError: something else.
        """
        from groundpose.formats.arrow_poses import from_arrow  # stands above this file

        return from_arrow(cls, table)

    def draw(
        self,
        image: ArrayLike | None = None,
        path: str | PathLike[str] | None = None,
        *,
        truth: tuple[ArrayLike, ...] | None = None,
        title: str = "",
    ) -> Figure:
        """Picture: overlay on the image at the left, bird's-eye view at the right.

        Args:
            image: (H, W, 3) uint8 or float 0 to 1, or (H, W); None: a blank one.
            path: where to write it (.png, .svg, .pdf), if anywhere.
            truth: `(R, t)` arrays (N, 3, 3) and (N, 3) to show beside the estimates, NaN = none; or
                `(R, t, bbox_3d)` with the true 3D boxes (N, 2, 3).
        """
        from groundpose.draw import draw_poses  # stands above this file

        return draw_poses(self, image, path, truth=truth, title=title)
