"""How poses are estimated: every choice and number, with its default."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from groundpose import _core
from groundpose._checks import FloatArray, count, describe, flag, input_error, number, shaped, text
from groundpose._value import Value

Solver = Literal["auto", "p1p", "p3p", "up2p", "p1p_height"]
Cases = Literal["all", "paper"]
Scoring = Literal["msac", "inliers"]
Refinement = Literal["default", "hre", "re", "gn", "none"]


@dataclass(frozen=True)
class Options(Value):
    """How poses are estimated. Every field is read; an unknown one is a TypeError.

    Args:
        inlier_threshold: pixels, one number or one per object; None: `relative_threshold` times
            the longer side of the object's 2D box.
        relative_threshold: inlier threshold as a fraction of the longer side of the 2D box,
            unless `inlier_threshold` is given.
        confidence: wanted probability of having drawn one good sample (the stop rule of RANSAC).
        solver: of the search: "auto" (by what is known of the box; in the default refinement "up2p" has a
            second try where the answer is doubtful, and "p3p" a last one, without the ground, where neither
            keypoints nor box convince and no `tilt_sigma` is given), "p1p", "p3p", "up2p" or "p1p_height".
        cases: pairs of footprint corners that the one-point solver tries: "all", or the four of the "paper".
        scoring: "msac" (truncated squared error) or "inliers" (their number).
        refinement: "default", "hre" (algorithm 1 of the paper), "re" (its robust stage alone),
            "gn" (least squares on the inliers) or "none".
        hre_thresholds: `(tau1, tau2, tau3)` of "hre" as multiples of the inlier threshold.
        tilt_sigma: radians, standard deviation of an object's lean, its up axis against the ground's
            normal; infinite: the lean is free after the search, 0: objects stand exactly upright;
            None: 1.5 degrees in the default refinement, infinite in the paper's.
        shape_prior: whether shape coefficients are pulled to zero by the model's eigenvalues;
            None: in the default refinement, not in the paper's.
        bbox_sigma: pixels, standard deviation of the 2D box's sides about the projected 3D box;
            infinite: the box only makes hypotheses; None: by the inlier threshold in the default
            refinement, infinite in the paper's.
        covariance: whether covariances are computed. A pose whose inliers leave a direction of it or of its
            shape free has none and is then refused as `degenerate`: without priors, a pose and M modes take
            at least (6 + M) / 2 inliers.
        max_iterations: most samples drawn for one object.
        min_keypoints: fewest visible keypoints an object must have.
        max_log10_nfa: refuse a pose when this many (log10) as good are to be expected among random
            keypoints; infinite: never refuse.
        keypoint_error_factor: how much larger the variance of the keypoints' common error is than their
            residuals show: 1 for independent errors, 7 to 20 for a network's; it widens `covariance`. None:
            1, or the network's own in a `Pipeline`.
        keypoint_error_dof: degrees of freedom of Student's t of the errors of a pose, more than 2; few are
            heavy tails, see `PoseBatch.region`. None: infinite (Gaussian), or the network's own.
        keypoint_error_shift: standard deviation of a shift in the image that all keypoints of an object
            share, as a fraction of the longer side of its 2D box; it widens `covariance` across the ray.
            None: 0, or the network's own.
        keypoint_error_turn: the same for a turn about the ground's normal, radians. None: 0, or the network's
            own.
        probability_coefficients: of the logistic model of `probability`: a bias and one for each number of
            `evidence`; None: those for keypoints of the caller, with scores or without, or the network's own.
        ambiguity_coefficients: bias and slope of the logit of `ambiguity` against that of what the
            viewing-angle probabilities say; None: 0 and 1, or the network's own.
        min_probability: answers less probable to be right get the status "improbable", as do poses that
            look far smaller than their boxes; 0: none does; None: the network's own, or for keypoints of
            the caller 0.15 in the default refinement and 0 in the paper's.
        score_weights: whether keypoint scores weigh the residuals (they order the draws in any case).
        seed: of the random draws; an object's draws depend on it and the object's index only.

    Raises:
        InputError: a value out of range. TypeError: a value of another type, an unknown field.
    """

    inlier_threshold: float | Sequence[float] | None = None
    relative_threshold: float = 0.0375
    confidence: float = 0.99
    solver: Solver = "auto"
    cases: Cases = "all"
    scoring: Scoring = "msac"
    refinement: Refinement = "default"
    hre_thresholds: tuple[float, float, float] = (1.0, 1.5, 3.0)
    tilt_sigma: float | None = None
    shape_prior: bool | None = None
    bbox_sigma: float | None = None
    covariance: bool = True
    max_iterations: int = 10_000
    min_keypoints: int = 4
    max_log10_nfa: float = 1.0
    keypoint_error_factor: float | None = None
    keypoint_error_dof: float | None = None
    keypoint_error_shift: float | None = None
    keypoint_error_turn: float | None = None
    probability_coefficients: Sequence[float] | None = None
    ambiguity_coefficients: tuple[float, float] | None = None
    min_probability: float | None = None
    score_weights: bool = True
    seed: int = 0
    _handle: _core.Options = field(init=False, repr=False, compare=False)
    _thresholds: FloatArray | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check types here and values in the core."""
        values = {name: check(name, getattr(self, name)) for name, check in _checks_of_options().items()}
        thresholds = None
        if isinstance(values["inlier_threshold"], tuple):
            thresholds = np.array(values["inlier_threshold"])
            if not np.all(np.isfinite(thresholds) & (thresholds > 0.0)):
                raise input_error(
                    "inlier_threshold", "positive numbers of pixels", describe(thresholds.tolist())
                )
        handle = _core.Options(**{**values, **({} if thresholds is None else {"inlier_threshold": None})})
        self._set(**values, _handle=handle, _thresholds=thresholds)


_Check = Callable[[str, Any], Any]


def _one_or_more(name: str, value: Any) -> float | tuple[float, ...]:
    if not isinstance(value, (list, tuple)) and np.ndim(value) == 0:
        return number(name, value)
    return tuple(shaped(name, value, ("N",)).tolist())


def _just(numbers: int) -> _Check:
    return lambda name, value: tuple(shaped(name, value, (numbers,)).tolist())


# How a value of an annotated type is checked; names of choices are the core's to judge.
_CHECKS: dict[Any, _Check] = {
    float: number,
    int: count,
    bool: flag,
    str: text,
    tuple[float, float]: _just(2),
    tuple[float, float, float]: _just(3),
    Sequence[float]: _just(1 + _core.EVIDENCE),
    float | Sequence[float]: _one_or_more,
}


@cache
def _checks_of_options() -> dict[str, _Check]:
    """Each option's check, by its annotation; here because `typing` resolves annotations slowly."""
    hints = get_type_hints(Options)
    return {f.name: _check(hints[f.name]) for f in fields(Options) if f.init}


def _check(hint: Any) -> _Check:
    if get_origin(hint) is Literal:
        return text
    parts = get_args(hint) if get_origin(hint) in (Union, UnionType) else ()
    if type(None) not in parts:
        return _CHECKS[hint]
    check = _check(Union[tuple(part for part in parts if part is not type(None))])  # noqa: UP007
    return lambda name, value: None if value is None else check(name, value)
