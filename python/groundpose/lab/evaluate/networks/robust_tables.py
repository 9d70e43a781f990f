"""Tables of docs/model.md about looks at real streets, renders of chosen vehicles, and scores."""

from __future__ import annotations

from typing import Any

from groundpose.lab.evaluate.networks import reliability, sweeps

LOOKS = (
    "Each car of the development frames twelve times: in the frame and in its mirror image, with the box of "
    "the label and five times with its sides moved by 3 %. Poses are of every box; vehicles in whose box the "
    "network sees none are counted apart."
)
HEIGHTS = "The same looks by height of the box."
SQUARE_ON = (
    "Vehicles of 20 to 30 px seen within 20 degrees of straight from the front or from behind, with a camera "
    "like KITTI's and the true view; each six times, once with its box and then with the box's sides moved "
    "by 3 %. A pose with a yaw error above 90 degrees is turned round; the viewing angle says so where its "
    "probability of the half turned away from the pose is above 0.2."
)
ROAD_SIDE = (
    "Median rotation error in degrees / right class in %. Cameras on masts look down by 20 to 35 degrees and "
    'see 50 to 70 degrees wide; at "8 m, 20 deg" and at 1.5 m the camera is the drive\'s own. Vehicles of '
    "25 px and more, at most half hidden; true boxes and views."
)
SWEEPS = (
    "![Median rotation error and class accuracy against focal length and roll]({})\n\n"
    "The same drives seen with other focal lengths, and with the camera rolled; the largest median rotation "
    "error divided by that of the drive's own camera."
)
RELIABILITY = (
    "![Fraction of good keypoints against their score]({})\n\n"
    "Mean score / fraction of keypoints within 0.0375 l / mean distance of the two over ten bins of scores."
)
Table = tuple[str, str, list[dict[str, Any]]]


def robust_tables(trained: dict[str, Any]) -> list[Table]:
    """Titles, words and lines; without lines where nothing was measured."""
    return [
        ("Real streets, twelve looks at each car", LOOKS, _flat(trained, "looks")),
        ("Real streets by height", HEIGHTS, _heights(trained)),
        ("Small vehicles, square-on", SQUARE_ON, _square_on(trained)),
        ("Camera height", ROAD_SIDE, _road_side(trained)),
        ("Focal length and roll", SWEEPS.format(sweeps.FIGURE.name), _sweeps(trained)),
        ("Keypoint scores", RELIABILITY.format(reliability.FIGURE.name), _reliability(trained)),
    ]


def _flat(trained: dict[str, Any], part: str) -> list[dict[str, Any]]:
    return [{"network": name, **one[part]} for name, one in trained.items() if part in one]


def _heights(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {"network": name, "height": group, **numbers}
        for name, one in trained.items()
        for group, numbers in one.get("heights", {}).items()
    ]


def _square_on(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "network": one["network"],
            "vehicles": one["vehicles"],
            "turned round, %": 100 * one["turned"],
            "of these, told by the viewing angle, %": _percentage(one["turned_told"]),
            "right ones told turned, %": _percentage(one["right_told_turned"]),
            "median e_r, deg": one["median_e_r_deg"],
            "class accuracy, %": 100 * one["class_accuracy"],
            "called none, %": 100 * one["called_none"],
        }
        for one in _flat(trained, "square_on")
    ]


def _percentage(fraction: float | None) -> float | None:
    return None if fraction is None else 100 * fraction


def _road_side(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "network": name,
            **{
                f"{place}: {m['vehicles']}": f"{m['median_e_r_deg']:.3g} / {100 * m['class_accuracy']:.3g}"
                for place, m in one["road_side"].items()
            },
        }
        for name, one in trained.items()
        if "road_side" in one
    ]


def _sweeps(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {"network": one["network"], **{sweep: one[f"worst {sweep}"] for sweep in ("focal length", "roll")}}
        for one in _flat(trained, "sweeps")
    ]


def _reliability(trained: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "network": name,
            **{
                f"{place}: {m['keypoints']}": (
                    f"{m['mean_score']:.3g} / {m['good']:.3g} / {m['calibration_error']:.2g}"
                )
                for place, m in one["reliability"].items()
            },
        }
        for name, one in trained.items()
        if "reliability" in one
    ]
