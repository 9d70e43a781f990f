"""How sure the poses of a network's keypoints are: numbers fitted for each network, stored in its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from groundpose.options import Options


@dataclass(frozen=True)
class Certainty:
    """Numbers of one network, fitted by `groundpose evaluate honesty --fit`; the options of the same names.

    The defaults are for a network of which nothing is known: the errors of every network's keypoints are
    shared between them, so independent ones would be wrong for all.

    Args:
        error_factor: `Options.keypoint_error_factor`.
        error_dof: `Options.keypoint_error_dof`.
        probability_coefficients: `Options.probability_coefficients`; None: those for keypoints of the caller.
        min_probability: `Options.min_probability`; None: that for keypoints of the caller.
        error_shift, error_turn: `Options.keypoint_error_shift` and `keypoint_error_turn`.
        ambiguity_coefficients: `Options.ambiguity_coefficients`; None: as the network says.
    """

    error_factor: float = 15.0
    error_dof: float = 5.6
    probability_coefficients: tuple[float, ...] | None = None
    min_probability: float | None = None
    error_shift: float = 0.0
    error_turn: float = 0.0
    ambiguity_coefficients: tuple[float, float] | None = None

    @classmethod
    def of(cls, stored: Mapping[str, Any]) -> Certainty:
        """From `numbers` of another."""
        values: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in stored.items()}
        return cls(**values)

    def numbers(self) -> dict[str, Any]:
        """The arguments by name, for JSON and `of`."""
        return asdict(self)

    def applied(self, options: Options) -> Options:
        """The options with these numbers where the caller left them open."""
        own: dict[str, Any] = {
            "keypoint_error_factor": self.error_factor,
            "keypoint_error_dof": self.error_dof,
            "keypoint_error_shift": self.error_shift,
            "keypoint_error_turn": self.error_turn,
            "probability_coefficients": self.probability_coefficients,
            "ambiguity_coefficients": self.ambiguity_coefficients,
            "min_probability": self.min_probability,
        }
        return replace(options, **{name: own[name] for name in own if getattr(options, name) is None})
