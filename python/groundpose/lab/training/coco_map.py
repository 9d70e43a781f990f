"""What a labelled file's classes and keypoints are called here: a small JSON file.

`{"classes": {"sedan": "car"}, "keypoints": {"wheel_fl": "left_front_wheel"}}`; either part may be left out,
and then the file's names are our own.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from groundpose._checks import input_error
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS

_NAMES = tuple(keypoint.name for keypoint in KEYPOINTS)
_PARTS = {"classes": CLASSES, "keypoints": _NAMES}


@dataclass(frozen=True)
class CocoMap:
    """{their name: ours} of classes and keypoints."""

    classes: Mapping[str, str]
    keypoints: Mapping[str, str]

    @classmethod
    def own(cls) -> CocoMap:
        """For files with our names, as `groundpose simulate` writes them."""
        return cls({name: name for name in CLASSES}, {name: name for name in _NAMES})

    @classmethod
    def read(cls, path: Path) -> CocoMap:
        """From a JSON file.

        Raises:
            OSError: the file cannot be read.
            InputError: not such a file, or a name on the right that is none of ours.
        """
        try:
            data = json.loads(path.read_text("utf-8"))
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            raise input_error(str(path), "a JSON file", error) from None
        if not isinstance(data, dict) or not data or not set(data) <= set(_PARTS):
            got = sorted(data) if isinstance(data, dict) else type(data).__name__
            raise input_error(str(path), 'an object with "classes", "keypoints" or both', got)
        own = cls.own()
        parts: dict[str, Mapping[str, str]] = {"classes": own.classes, "keypoints": own.keypoints}
        for part, names in data.items():
            parts[part] = _checked(path, part, names)
        return cls(**parts)

    def check_against(self, categories: list[Any], path: Path) -> None:
        """Raises InputError when no name of the map is in the file: a wrong map would drop everything."""
        rows = [row for row in categories if isinstance(row, dict)]
        theirs = {
            "classes": [str(row.get("name")) for row in rows],
            "keypoints": [str(name) for row in rows for name in keypoints_of(row)],
        }
        for part, known in (("classes", self.classes), ("keypoints", self.keypoints)):
            if not set(known) & set(theirs[part]):
                expected = f"one of {', '.join(known)} (see --keypoints)"
                raise input_error(f"{path}: {part}", expected, sorted(set(theirs[part])) or "none")

    def class_of(self, theirs: str) -> str | None:
        """Our class of their category; None when the map has none."""
        return self.classes.get(theirs)

    def row_of(self, theirs: object, class_name: str) -> int | None:
        """Row of `KEYPOINTS` of their keypoint; None when our class has no such keypoint."""
        ours = self.keypoints.get(str(theirs))
        if ours is None:
            return None
        row = _NAMES.index(ours)
        return row if class_name in KEYPOINTS[row].classes else None

    def text(self) -> str:
        """As JSON, in a fixed order."""
        return json.dumps({"classes": dict(self.classes), "keypoints": dict(self.keypoints)}, sort_keys=True)


def keypoints_of(category: dict[str, Any]) -> list[Any]:
    """Names of a category's keypoints, in the order of its annotations."""
    names = category.get("keypoints")
    return names if isinstance(names, list) else []


def _checked(path: Path, part: str, names: Any) -> dict[str, str]:
    if not isinstance(names, dict) or not names:
        raise input_error(f"{path}: {part}", "an object of names", repr(names)[:60])
    for theirs, ours in names.items():
        if ours not in _PARTS[part]:
            expected = f"one of {', '.join(_PARTS[part])}"
            raise input_error(f"{path}: {part}.{theirs}", expected, repr(ours)[:60])
    if part == "keypoints" and len(set(names.values())) < len(names):
        twice = sorted({ours for ours in names.values() if list(names.values()).count(ours) > 1})
        raise input_error(f"{path}: keypoints", "each of our keypoints once", f"{', '.join(twice)} twice")
    return names
