"""What each piece of knowledge (region, height, more frames) is worth for the distances of KITTI's cars."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import groundpose as gp
from groundpose._writing import write_text
from groundpose.formats.kitti.dataset import KittiFrame, KittiFrames, KittiSet, difficulty
from groundpose.formats.kitti.labels import KittiLabel
from groundpose.formats.kitti.table import KittiTable
from groundpose.formats.skips import Skips
from groundpose.lab.contenders.own import DEFAULT
from groundpose.lab.evaluate import distance_sets, report
from groundpose.lab.evaluate.kitti.average_precision import Hits, Overlaps, average_precision, judge
from groundpose.lab.evaluate.kitti.frame import (
    CAMERA_HEIGHT,
    ERROR_COLUMNS,
    Prepared,
    Task,
    as_results,
    errors_of,
    given,
    prepare,
)
from groundpose.lab.evaluate.kitti.keypoints import KeypointSource, Network, Simulated
from groundpose.lab.evaluate.kitti.official import Case, official_precision
from groundpose.lab.evaluate.kitti.summary import group
from groundpose.lab.metrics import percentage

JSON, PAGE = Path("results/distance.json"), Path("docs/distance.md")
MARKS = ("<!-- distances: begin -->", "<!-- distances: end -->")
MODERATE = 1
REGION = "europe"
WRONG = 1.1
"""A height that is told wrong, in true ones."""
REPORTED = (
    *("objects", "median distance error %", "distance bias %", "distance beyond 10 %"),
    *("95 % interval of distance holds %", "mean overlap in space", "median yaw error deg"),
)
OFFICIAL = {"3D": 0.7, "3D loose": 0.5}
"""Measures whose precision is taken to the digit as KITTI's evaluator has it, too, and their overlaps."""
KNOWN_WITHIN_PERCENT = 15.0
"""A distance this near to the truth is of use for a class whose sizes differ much."""


@dataclass(frozen=True)
class Setting:
    """What is known beside camera and nominal tilt."""

    name: str
    height: float | None = None
    region: str | None = None
    together: bool = True
    """Whether the vehicles of a frame stand on one road."""
    camera_state: bool = False
    """Whether it is learned from frame to frame of a sequence."""

    @property
    def priors(self) -> gp.FramePriors:
        """Of each frame."""
        return gp.FramePriors(size=None if self.region is None else gp.SizePrior.region(self.region))


SETTINGS = (
    Setting("every vehicle alone", together=False),
    Setting("every vehicle alone, region", region=REGION, together=False),
    Setting("one road", region=None),
    Setting("one road, region", region=REGION),
    Setting("one road, height", CAMERA_HEIGHT),
    Setting("one road, height, region", CAMERA_HEIGHT, REGION),
    Setting("one road, height, region, over frames", CAMERA_HEIGHT, REGION, camera_state=True),
    Setting("one road, height, over frames", CAMERA_HEIGHT, camera_state=True),
    Setting("one road, height 10 % too large, region", WRONG * CAMERA_HEIGHT, REGION),
    Setting("the same over frames", WRONG * CAMERA_HEIGHT, REGION, camera_state=True),
    Setting("height 10 % too small over frames", CAMERA_HEIGHT / WRONG, REGION, camera_state=True),
)


@dataclass(frozen=True)
class Set:
    """Frames whose keypoints were found once."""

    name: str
    frames: list[tuple[KittiFrame, Prepared]]
    task: Task
    settings: tuple[Setting, ...] = SETTINGS

    @classmethod
    def of(
        cls,
        name: str,
        folder: KittiFrames,
        source: KeypointSource,
        task: Task,
        settings: tuple[Setting, ...] = SETTINGS,
    ) -> Set:
        """Find the keypoints of all frames."""
        frames = []
        for frame_id in folder.ids():
            frame = folder.read(frame_id, Skips())
            prepared = None if frame is None else prepare(frame, task, source, Skips())
            if frame is not None and prepared is not None and prepared.boxes:
                frames.append((frame, prepared))
        return cls(name, frames, task, settings)


def sets(data: Path, network: str | None) -> Iterator[Callable[[], Set]]:
    """The pictures and the table in a folder of data, as far as they are there."""
    pictures, table = data / "kitti", data / "kitti_vehicles_dev.npz"
    if pictures.is_dir():
        task = Task(keypoints="network")
        # single frames of many drives
        alone = tuple(setting for setting in SETTINGS if not setting.camera_state)
        yield lambda: Set.of("pictures", KittiSet(pictures), Network(network, 1), task, alone)
    if table.is_file():
        simulated = Task(boxes="detections", keypoints="simulated")
        yield lambda: Set.of("table", KittiTable(table, True), Simulated(), simulated)


def measure(found: Set, setting: Setting) -> dict[str, Any]:
    """Numbers of a set with what is known in a setting."""
    errors: list[list[float]] = []
    counted: list[KittiLabel] = []
    hits, states = Hits(), dict[str, gp.CameraState]()
    cases: dict[str, list[Case]] = {measure: [] for measure in OFFICIAL}
    for frame, prepared in found.frames:
        view = gp.View(frame.camera, height=setting.height)
        objects = replace(given(frame, prepared, found.task), view=view)
        if setting.together:
            objects = replace(objects, frame=_frame(setting, view, frame.id.partition("/")[0], states))
        elif setting.region is not None:
            prior = gp.SizePrior.region(setting.region)
            objects = replace(objects, models=[prior.sized(model) for model in objects.models])
        poses = DEFAULT.poses(objects)
        answers = as_results(frame, prepared, poses)
        overlaps = Overlaps.of(answers, frame.labels)
        hits.add(judge(frame.labels, answers, "Car", overlaps))
        for name, kept in cases.items():
            kept.append(Case.of(frame.labels, answers, "Car", name, MODERATE, overlaps))
        errors += errors_of(frame, prepared, poses, overlaps)
        counted += [label for label in prepared.labels if label is not None]
    rows = np.array(errors, dtype=float).reshape(-1, len(ERROR_COLUMNS))
    usual = np.array([difficulty(label) <= MODERATE for label in counted], dtype=bool)
    types = np.array([label.type for label in counted])
    cars = group("Car", rows[usual & (types == "Car")])
    precision = average_precision(hits)
    vans = rows[usual & (types == "Van"), ERROR_COLUMNS.index("distance_percent")]
    return {
        "setting": setting.name,
        **{name: cars[name] for name in REPORTED},
        "AP3D 0.7 %": precision["3D"][MODERATE],
        "AP3D 0.5 %": precision["3D loose"][MODERATE],
        **{f"AP3D {OFFICIAL[name]} %, 41 scores": official_precision(kept) for name, kept in cases.items()},
        "vans": len(vans),
        "vans within 15 % of distance %": percentage(np.abs(vans) <= KNOWN_WITHIN_PERCENT),
        "drives": len(states),
        "drives with a remark about the height": sum(bool(s.remarks) for s in states.values()),
    }


def _frame(
    setting: Setting, view: gp.View, sequence: str, states: dict[str, gp.CameraState]
) -> gp.FramePriors | gp.CameraState:
    """What is known of a frame; every sequence is a drive of another camera."""
    if not setting.camera_state:
        return setting.priors
    if sequence not in states:
        states[sequence] = gp.CameraState(view, setting.priors)
    return states[sequence]


def run(
    data: Path, network: str | None, crops: Path | None, advance: Callable[[int, int], None]
) -> dict[str, Any]:
    """All settings on all sets; those of renders where their folder is given."""
    found = [make() for make in sets(data, network)]
    known = distance_sets.sets(data, network, crops)
    total = sum(len(each.settings) for each in found) + sum(len(settings) for _, settings in known.values())
    tables: dict[str, list[dict[str, Any]]] = {}

    def add(name: str, row: dict[str, Any]) -> None:
        tables.setdefault(name, []).append(row)
        advance(sum(map(len, tables.values())), total)

    for each in found:
        for setting in each.settings:
            add(each.name, measure(each, setting))
    for name, (frames, settings) in known.items():
        seen = list(frames())
        for one in settings:
            add(name, distance_sets.measure(seen, one))
    return {
        "command": "groundpose evaluate distance",
        "versions": report.versions(),
        "camera height m": CAMERA_HEIGHT,
        "region": REGION,
        "sets": tables,
    }


_SHOWN = (
    *("setting", "objects", "median distance error %", "distance bias %", "distance beyond 10 %"),
    *("95 % interval of distance holds %", "mean overlap in space", "AP3D 0.7 %", "AP3D 0.5 %"),
    *("vans within 15 % of distance %", f"median distance error below {distance_sets.NEAR:g} m %"),
    *("median tilt error deg", "drives", "drives with a remark about the height"),
)
_TITLES = {
    "pictures": "Pictures, the bundled network's keypoints, labelled boxes",
    "table": "Table of many vehicles, simulated keypoints with a CNN's errors, a detector's boxes",
    "drive": "Virtual drives, exact truth: simulated keypoints with a CNN's errors, a detector's boxes",
    "road side, 6 m": "Renders from 6 m above a road, the network's keypoints, tilt up to 3 degrees wrong",
    "road side, 8 m": "Renders from 8 m above a road, the same",
    "apollo": "ApolloCar3D, keypoints labelled by hand, shape basis of 79 models; heights unknown",
}


def write_stored(root: Path) -> Path | None:
    """The page from the stored results under `root`, if there are any."""
    stored = root / JSON
    return write_page(report.read_json(stored), root / PAGE) if stored.exists() else None


def write_page(content: dict[str, Any], path: Path) -> Path:
    """The tables between the marks of the page."""
    parts = [""]
    for name, rows in content["sets"].items():
        columns = [column for column in _SHOWN if any(row.get(column) for row in rows)]
        shown = [{column: row[column] for column in columns} for row in rows]
        parts += [f"### {_TITLES[name]}", report.table(shown)]
    new = "\n\n".join([*parts, ""])
    write_text(path, report.between(path.read_text(encoding="utf-8"), MARKS, new))
    return path
