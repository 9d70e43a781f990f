"""What the stated certainty has to reach, each number once."""

from __future__ import annotations

from groundpose.lab.evaluate.honesty.coverage import WINDOWS
from groundpose.lab.evaluate.honesty.numbers import ALLOWED, CLEAR
from groundpose.lab.evaluate.honesty.sources import ALL_RENDERS, BACKGROUND, MANY_LOOKS, RENDERS
from groundpose.lab.evaluate.networks.targets import Wanted
from groundpose.lab.targets import AT_LEAST, AT_MOST, Target

_PLAIN, _MOVED, _DARK = RENDERS
_REGIONS, _PROBABILITY = "regions of right answers", "probability of a right answer"
_OTHER, _NOTHING = "the other reading", "background called right"
_INDEPENDENT = "synthetic scenes with independent noise"
_SCENES = (
    "synthetic vehicles (V1)",
    "synthetic cubes (E1), 50 % outliers",
    "synthetic cubes (E1), 90 % outliers",
)


def _region(source: str, group: str, level: str, limit: float, most: bool = False) -> Wanted:
    """The worst of all quantities; the distance may hold more."""
    what = f"{source}, {group}: {'most' if most else 'least'} in {level} %"
    target = Target(what, _REGIONS, what, limit, AT_MOST if most else AT_LEAST, " %")
    return Wanted(
        target, "default", ("vehicles", source, "coverage", group, "most" if most else "least", level)
    )


def _of(source: str, id: str, what: str, limit: float, path: tuple[str, ...], least: bool = True) -> Wanted:
    measure = _OTHER if path[0] == "ambiguity" else _PROBABILITY
    target = Target(f"{id} {source}", measure, f"{source}: {what}", limit, AT_LEAST if least else AT_MOST)
    return Wanted(target, "default", ("vehicles", source, *path))


WANTED = (
    *(
        _region(_PLAIN, CLEAR, f"{100 * level:g}", 100 * window[most], bool(most))
        for level, window in WINDOWS.items()
        for most in (0, 1)
    ),
    _region(_MOVED, CLEAR, "95", 92.0),
    _region(_DARK, CLEAR, "95", 91.0),
    _region(MANY_LOOKS, CLEAR, "95", 85.0),
    _region(MANY_LOOKS, ALLOWED, "95", 90.0),
    *(
        Wanted(
            Target(f"sharp {quantity} {side}", "sharpness", f"{_PLAIN}: {quantity}", limit, comparison),
            "default",
            ("vehicles", _PLAIN, "coverage", CLEAR, "sharpness", quantity),
        )
        for quantity in ("yaw", "distance")
        for side, limit, comparison in (("least", 1.0, AT_LEAST), ("most", 1.6, AT_MOST))
    ),
    *(
        Wanted(
            Target(f"{scenes} {side}", _INDEPENDENT, f"{scenes}: pose in 95 %", limit, comparison, " %"),
            "",
            ("callers", scenes, "inside", "pose", "95"),
        )
        for scenes in _SCENES
        for side, limit, comparison in (("least", 93.0, AT_LEAST), ("most", 97.0, AT_MOST))
    ),
    *(
        Wanted(
            Target(source, _NOTHING, source, 1.0, unit=" %"),
            "default",
            ("background", source, "called_right"),
        )
        for source in BACKGROUND
    ),
    _of(_PLAIN, "kept", "right answers kept, %", 96.0, ("kept",)),
    _of(MANY_LOOKS, "kept", "right answers kept, %", 95.0, ("kept",)),
    _of(ALL_RENDERS, "ece", "calibration error", 0.03, ("probability", "calibration_error"), least=False),
    _of(ALL_RENDERS, "auc", "AUC right against wrong", 0.93, ("probability", "auc")),
    _of(ALL_RENDERS, "flips", "AUC for turned poses", 0.90, ("ambiguity", "auc")),
    _of(
        ALL_RENDERS,
        "factor",
        "stated against true, worst factor of a bin of 50 or more",
        1.5,
        ("ambiguity", "worst_factor"),
        least=False,
    ),
)
"""Rows of the page's first table."""
