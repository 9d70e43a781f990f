"""Which keypoints of a vehicle are joined by lines when its shape is drawn."""

from __future__ import annotations

from functools import cache

from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import keypoint_names

# Lines of one side of a vehicle, drawn where a class has both ends; each is drawn left and right.
_SIDE = (
    ("front_bumper", "headlamp"),
    ("headlamp", "windscreen_bottom"),
    ("windscreen_bottom", "windscreen_top"),
    ("windscreen_bottom", "mirror"),
    ("front_bumper", "front_wheel"),
    ("front_wheel", "rear_wheel"),
    ("rear_wheel", "rear_bumper"),
    ("rear_bumper", "taillamp"),
    ("taillamp", "rear_window_bottom"),
    ("rear_window_bottom", "rear_window_top"),
    ("rear_window_top", "windscreen_top"),
    ("windscreen_bottom", "belt_b"),
    ("belt_b", "belt_c"),
    ("belt_c", "rear_window_bottom"),
    ("windscreen_top", "side_window_top"),
    ("windscreen_top", "roof_rear"),
    ("rear_window_bottom", "roof_rear"),
    ("windscreen_top", "cab_roof_rear"),
    ("cab_roof_rear", "bed_front"),
    ("bed_front", "bed_rear_top"),
    ("bed_rear_top", "bed_rear_bottom"),
    ("bed_rear_bottom", "taillamp"),
    ("rear_wheel", "bed_rear_bottom"),
    ("windscreen_bottom", "cab_window"),
    ("box_front_top", "box_front_bottom"),
    ("box_front_top", "box_rear_top"),
    ("box_rear_top", "box_rear_bottom"),
    ("box_front_bottom", "box_rear_bottom"),
    ("box_rear_bottom", "taillamp"),
    ("taillamp", "guard_rear"),
    ("rear_wheel", "guard_rear"),
)
# Lines from left to right.
_ACROSS = (
    *("front_bumper", "windscreen_bottom", "windscreen_top", "rear_bumper", "rear_window_bottom"),
    *("rear_window_top", "roof_rear", "cab_roof_rear", "bed_rear_bottom"),
    *("box_front_top", "box_rear_top", "box_rear_bottom", "guard_rear"),
)
# Lines from the middle plane to both sides.
_MIDDLE = (("front_plate", "headlamp"), ("rear_plate", "taillamp"), ("tailgate", "bed_rear_top"))


@cache
def skeleton(class_name: str) -> tuple[tuple[int, int], ...]:
    """Pairs of keypoint numbers of a class, from 0, joined by a line."""
    names = keypoint_names(class_name)
    lines = [(f"{side}_{a}", f"{side}_{b}") for a, b in _SIDE for side in ("left", "right")]
    lines += [(f"left_{a}", f"right_{a}") for a in _ACROSS]
    lines += [(a, f"{side}_{b}") for a, b in _MIDDLE for side in ("left", "right")]
    return tuple((names.index(a), names.index(b)) for a, b in lines if a in names and b in names)


def skeleton_of(name: str, names: tuple[str, ...]) -> tuple[tuple[int, int], ...]:
    """The same for a model called `name` with keypoints `names`; none where it is not one of our classes."""
    if name not in CLASSES or keypoint_names(name) != names:
        return ()
    return skeleton(name)
