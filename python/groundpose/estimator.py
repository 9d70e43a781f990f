"""`Estimator`: what is the same for many images, checked once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from groundpose import _core
from groundpose._checks import number, type_error
from groundpose._checks import threads as checked_threads
from groundpose._given import Boxes, Given, Keypoints, Models, checked_models
from groundpose._value import Value
from groundpose.options import Options
from groundpose.poses import PoseBatch
from groundpose.shape import ShapeModel
from groundpose.types import View

if TYPE_CHECKING:
    from groundpose.camera_state import CameraState
    from groundpose.frame import FramePriors

DEFAULT_OPTIONS = Options()
_SEVERAL = 4
"""Fields that most callers ask for at most."""
_FEW = 100
"""Objects whose fields all together take a few microseconds."""


@dataclass(frozen=True, eq=False)
class Estimator(Value):
    """Estimates the poses of one image after the other with the same view, models and options.

    It gives the answers of `estimate_poses`, to the bit, and keeps between its calls what those of
    `estimate_poses` make anew: checked options, models, memory of the solver. It may be called from several
    threads at once, copied and pickled.

    Args:
        view: camera and its tilt against the ground.
        models: one model for all objects, or several: one for each object in order, or those that
            `model_indices` of a call chooses from.
        options: see `Options`.
        threads, frame_tilt_sigma, frame: see `estimate_poses`. A `CameraState` goes on learning; a deep copy
            of the estimator has its own.

    Raises:
        InputError: a number that cannot be. TypeError: an argument of the wrong type.

    >>> view = View(Camera(fx=1000, fy=1000, cx=640, cy=360), pitch=0.01)
    >>> model = ShapeModel([[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2], [0.9, -0.7, 2.2]])
    >>> estimator = Estimator(view, model)
    >>> len(estimator([], None))
    0
    """

    view: View
    models: Models
    options: Options = DEFAULT_OPTIONS
    threads: int | None = None
    frame_tilt_sigma: float | None = None
    frame: FramePriors | CameraState | None = None
    _core: _core.Estimator = field(init=False, repr=False)
    _alone: Estimator | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check what is kept."""
        if not isinstance(self.view, View):
            raise type_error("view", "a View", self.view)
        if not isinstance(self.options, Options):
            raise type_error("options", "Options", self.options)
        alone, frame, several = None, self.frame, checked_models(self.models)
        if frame is not None:
            from groundpose import road  # which most programs do not need

            road.check_frame(frame, self.frame_tilt_sigma, self.options.covariance)
            alone = Estimator(self.view, road.sized(frame, self.models), self.options, self.threads)
        models: Models = self.models if isinstance(self.models, ShapeModel) else several
        sigma = self.frame_tilt_sigma
        sigma = None if sigma is None else number("frame_tilt_sigma", sigma)
        threads = checked_threads(self.threads) or 0
        made = _core.Estimator(
            self.view._handle,
            _core.Models.of(models),
            self.options._handle,
            self.options._thresholds,
            threads,
            sigma,
        )
        self._set(models=models, frame_tilt_sigma=sigma, _core=made, _alone=alone)

    def __call__(
        self,
        keypoints_2d: Keypoints,
        bboxes: Boxes = None,
        keypoint_scores: ArrayLike | Sequence[ArrayLike] | None = None,
        model_indices: ArrayLike | None = None,
        vehicle_probability: ArrayLike | None = None,
        viewing_angle_probabilities: ArrayLike | None = None,
    ) -> PoseBatch:
        """The pose (and shape) of every object of one image.

        Args:
            keypoints_2d: (N, P, 2) pixels, or a list; see `estimate_poses`, as for all that is not here.
            bboxes: (N, 4) pixels, or a list; None: no boxes at all.
            keypoint_scores: (N, P), or a list.
            model_indices: (N,) which of `models` each object has; an array `keypoints_2d` is then as wide as
                the largest of `models`. None: the only one, or each object the one of its place.
            vehicle_probability: (N,).
            viewing_angle_probabilities: (N, 16).

        Raises:
            InputError: an argument of the wrong shape or length. TypeError: of the wrong type.
        """
        given = Given(
            keypoints_2d,
            bboxes,
            keypoint_scores,
            model_indices,
            vehicle_probability,
            viewing_angle_probabilities,
        )
        alone = self._alone
        if alone is not None and self.frame is not None:
            from groundpose import road  # which most programs do not need

            return road.estimate_frame(self.view, self.frame, lambda seen: replace(alone, view=seen)(*given))
        answers = self._core.estimate(*given)
        if answers is None:
            given = given.converted(self.models, self.options._thresholds).with_what_is_said()
            answers = self._core.estimate(*given)
            assert answers is not None, "what was converted can be read"
        return _batch(self, answers)


def _batch(estimator: Estimator, answers: _core.Answers) -> PoseBatch:
    """The result, whose arrays are made when they are asked for."""
    view, dof = estimator.view, estimator.options.keypoint_error_dof
    known = {"nominal_view": view, "error_dof": np.inf if dof is None else dof}
    tilt = answers.tilt
    if tilt is not None:
        pitch, roll, known["tilt_covariance"] = tilt
        view = replace(view, pitch=pitch, roll=roll)
    known["view"] = view
    return PoseBatch._later(known, _Fields(answers, estimator.models))


class _Fields:
    """Makes the other fields of a `PoseBatch`."""

    __slots__ = ("_answers", "_asked", "_models")

    def __init__(self, answers: _core.Answers, models: Models) -> None:
        """Of the core's answers to a call."""
        self._answers, self._models, self._asked = answers, models, 0

    def __call__(self, name: str, kept: dict[str, Any]) -> Any:
        """The field's value. Who asks for several fields of few objects asks for all: they take less time
        together than one by one."""
        self._asked += 1
        if self._asked > _SEVERAL and len(self._answers) <= _FEW:
            self.fill(kept)
            return kept[name]
        return self._each_model() if name == "models" else self._answers.array(name)

    def fill(self, kept: dict[str, Any]) -> None:
        """Add all fields that are not there."""
        self._answers.fill(kept)
        if "models" not in kept:
            kept.setdefault("models", self._each_model())

    def _each_model(self) -> tuple[ShapeModel, ...]:
        """One for each object."""
        models, chosen = self._models, self._answers.model_indices
        if isinstance(models, ShapeModel):
            return (models,) * len(self._answers)
        return tuple(models) if chosen is None else tuple(models[i] for i in chosen)
