"""docs/real_data.md from results/real/*.json: `groundpose evaluate pages`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from groundpose._writing import write_text
from groundpose.formats.kitti.dataset import DIFFICULTIES
from groundpose.lab.evaluate.report import read_json, table

RESULTS, PAGE = Path("results/real"), Path("docs/real_data.md")
Content = dict[str, Any]

# Table 3 of the paper: e_r and e_a at easy, moderate, hard.
PAPER = {
    "RNSC-P1P+RE": ((3.203, 4.141, 4.283), (0.1376, 0.1509, 0.1531)),
    "RNSC-P1P+HRE": ((3.365, 4.016, 4.071), (0.1356, 0.1450, 0.1460)),
    "RNSC-P3P+RE": ((4.083, 5.482, 5.450), (0.1511, 0.1651, 0.1644)),
    "RNSC-P3P+HRE": ((4.021, 5.243, 5.231), (0.1472, 0.1616, 0.1613)),
}

INTRODUCTION = r"""# Real data

Point it at a folder and get the numbers of the paper, KITTI's own, and pictures of what went wrong:

```sh
groundpose evaluate kitti --root KITTI --split val.txt -o kitti.json --report page   # the network on images
groundpose evaluate kitti --root KITTI --boxes detections -m all -o kitti.json       # a detector's boxes
groundpose evaluate kitti --root KITTI --keypoints simulated -o kitti.json           # without any image
groundpose evaluate kitti --root KITTI -o kitti.json --export results --rerun out.rrd
groundpose evaluate figure6 --root KITTI --frame 000008 -o figure6.png               # the paper's Fig. 6
groundpose evaluate apollo --root 3d_car_instance/train --models apollo_models.npz -o apollo.json
groundpose evaluate tilt --data data -o tilt.json
```

KITTI's object set and its tracking set are read as they unpack. A run goes on where it was stopped
(finished frames are kept in `.frames.jsonl` beside the numbers). A bad line, a missing file or an image
of another camera leaves out an object or a frame, is counted, and is named with file and line at the end.
`--export` writes result files for KITTI's own evaluator.
"""

FORMATS = (
    {
        "what": "boxes of files",
        "in": "KITTI, COCO, COCO results, nuScenes' 2D annotations, our frames, JSON lists: "
        "`formats.boxes.read_boxes`",
        "out": "KITTI results: `poses.to_kitti`, `--export`",
    },
    {
        "what": "boxes of a detector, as it gives them",
        "in": "supervision, ultralytics, torchvision, COCO, KITTI, arrays: `formats.detections.bboxes_of`",
        "out": "",
    },
    {
        "what": "cameras",
        "in": "KITTI, OpenCV's and ROS's YAML, camera_info, nuScenes, JSON: "
        "`formats.calibrations.read_calibration`",
        "out": "`formats.camera_files`: `format_opencv_yaml`, `format_camera_info`, `format_nuscenes`",
    },
    {
        "what": "keypoints",
        "in": "COCO: `formats.coco_keypoints.read_keypoints`",
        "out": "`format_keypoints`",
    },
    {
        "what": "poses",
        "in": "JSON frames: `groundpose estimate`",
        "out": "JSON lines, KITTI; 4 x 4, rvec and tvec, quaternions: `formats.conversions`; "
        "Rerun: `--rerun`",
    },
)

SNIPPET = """```python
from groundpose.formats.conversions import to_rvec_tvec
from groundpose.formats.detections import bboxes_of

poses = pipeline(image, bboxes_of(detections), view)  # what supervision, ultralytics ... gave
rvec, tvec = to_rvec_tvec(poses.R, poses.t)
```"""

READING = r"""## How to read the tables

The average precision here follows KITTI's rules (40 recalls, difficulties, vans beside cars, DontCare);
detections are matched once, by falling score, instead of once at each of 41 scores. Beside an independent
transcription of the official algorithm on 500 made-up frames it is within 0.5 points. The labels against
themselves give 100, and every run checks that.

Every table below is made by the command above it; the page by `groundpose evaluate pages`.
How well the solver does on the keypoints of a real CNN: [results.md](results.md).
"""

SIMULATED = (
    "Vehicles and boxes are real; the keypoints are not: random bodies of the bundled shape models, "
    "stretched to the labelled size, are projected by the labelled pose, and a simulated detector adds the "
    "errors and scores that a real CNN has on KITTI (fitted to 108 cars of three tracks: one car of seven is "
    "confused about its front). All methods get the same keypoints; our default weighs them by their scores, "
    "for the others those below 0.1 are left out. Means are of the answers; a failure is an error above 10 "
    "deg or 10 % or no answer."
)
CLASS = (
    "Known is the class alone: its shape model with all modes. The paper's refinements have no prior on the "
    "shape, and so no scale: their distances say little here. PoseLib gets the mean shape."
)
RIGID = "Known is the mean shape of the class stretched to the labelled size, rigid, for every method."
NETWORK = (
    "Nothing is simulated: the bundled network, trained on the virtual drive alone, finds class and "
    "keypoints in the image."
)
PAPER_NOTE = (
    "The paper's own numbers (Table 3: 1019 vehicles of the validation split, its network, its keypoints) "
    "stand beside them for orientation; they are not of these vehicles."
)


def write_page(root: Path) -> Path | None:
    """Write the page from the stored numbers; None when there are none."""
    if not (root / RESULTS).is_dir():
        return None
    page = root / PAGE
    page.parent.mkdir(parents=True, exist_ok=True)
    write_text(page, render(root / RESULTS))
    return page


def render(folder: Path) -> str:
    """The page from the files that are there."""
    parts = [INTRODUCTION.rstrip(), "## Your own data", table([*FORMATS]), SNIPPET, READING.rstrip()]
    for name, write in SECTIONS:
        content = read_json(folder / f"{name}.json")
        if content:
            parts += write(content)
    return "\n\n".join(parts) + "\n"


def _vehicles(title: str, note: str) -> Callable[[Content], Iterator[str]]:
    def write(content: Content) -> Iterator[str]:
        yield f"## {title}"
        yield f"`{content['command']}`"
        missed = (
            f", {content['missed objects']} more without a detection" if content["missed objects"] else ""
        )
        yield f"{content['objects']} vehicles in {content['frames']['done']} frames{missed}. {note}"
        yield table([_by_difficulty(method) for method in content["methods"]])
        cars = [
            {"method": method["method"], **_precisions(method["average precision"]["Car"])}
            for method in content["methods"]
            if "Car" in method["average precision"]
        ]
        if cars and content["settings"]["root"].endswith("kitti"):
            yield "Average precision of cars at easy / moderate / hard, %:"
            yield table(cars)

    return write


def _by_difficulty(method: Content) -> Content:
    groups = method["by difficulty"][: len(DIFFICULTIES)]

    def three(name: str, digits: int) -> str:
        return " / ".join("-" if g[name] is None else f"{g[name]:.{digits}f}" for g in groups)

    row = {
        "method": method["method"],
        "mean e_r, deg": three("mean e_r deg", 2),
        "mean e_a, deg": three("mean e_a deg", 3),
        "failures, %": three("failures %", 1),
        "median e_r, deg": three("median e_r deg", 2),
        "yaw above 15 deg, %": three("yaw above 15 deg %", 1),
        "no answer, %": three("no answer %", 1),
        "median depth error, %": three("median depth error %", 1),
        "overlap in space": three("mean overlap in space", 2),
    }
    if method["method"] in PAPER:
        e_r, e_a = PAPER[method["method"]]
        row["paper e_r"] = " / ".join(f"{x:.2f}" for x in e_r)
        row["paper e_a"] = " / ".join(f"{x:.3f}" for x in e_a)
    return row


def _precisions(measures: Content) -> Content:
    return {
        name: " / ".join("-" if value is None else f"{value:.1f}" for value in values)
        for name, values in measures.items()
    }


def _groups(content: Content) -> Iterator[str]:
    """By distance, truncation, occlusion: the default method alone."""
    method = content["methods"][0]
    yield f"### {method['method']}, by distance, occlusion and class"
    rows = []
    for what in ("distance", "occlusion", "class"):
        for row in method[f"by {what}"]:
            if row["objects"]:
                kept = (
                    "objects",
                    "failures %",
                    "median e_r deg",
                    "median yaw error deg",
                    "yaw above 15 deg %",
                )
                rows.append({"group": row["group"], **{name: row[name] for name in kept}})
                rows[-1]["median depth error %"] = row["median depth error %"]
                rows[-1]["on the ground %"] = row["median depth error on the ground %"]
    yield table(rows)
    yield (
        "The last column is the error of depth when the object is put on a flat road 1.65 m below the "
        "camera: better than the pose's own depth only near, where the size is not known. KITTI's vans are 5 "
        "m long, our class of vans and buses 7.6 m in the mean: that is too far off for its prior."
    )


def _vehicles_class(content: Content) -> Iterator[str]:
    title = "KITTI: 3,472 labelled vehicles with boxes of a real detector, class known"
    yield from _vehicles(title, f"{SIMULATED} {CLASS}")(content)
    yield from _groups(content)


def _vehicles_rigid(content: Content) -> Iterator[str]:
    title = "KITTI: the same vehicles, size known"
    yield from _vehicles(title, f"{RIGID} {PAPER_NOTE}")(content)


def _apollo(content: Content) -> Iterator[str]:
    yield "## ApolloCar3D"
    yield f"`{content['command']}`"
    yield from _sets(content, "methods")


def _tilt(content: Content) -> Iterator[str]:
    yield "## The tilt on real roads"
    yield f"`{content['command']}`"
    yield (
        "How the solver uses the nominal tilt: fixed (with the default's prior of 1.5 deg for objects that "
        "lean), with twice that or twice the set's spread, as in the paper forgotten after the search, or "
        "estimated for each image from all its objects first (`frame_tilt_sigma`)."
    )
    yield from _sets(content, "tilt")


def _sets(content: Content, rows: str) -> Iterator[str]:
    for group in content["sets"]:
        yield f"### {group['name']}, {group['objects']} cars"
        yield group["note"]
        yield table(group[rows])


def _speed(content: Content) -> Iterator[str]:
    yield "## Speed and memory"
    yield f"`{content['command']}`"
    yield table([{key: value for key, value in content.items() if key != "command"}])
    yield (
        "Made-up frames of 5.4 vehicles without images, keypoints simulated, one method: reading, "
        "simulating, estimating, matching and writing. Memory grows by the kept numbers, some 400 bytes per "
        "object and method."
    )


SECTIONS: tuple[tuple[str, Callable[[Content], Iterator[str]]], ...] = (
    ("vehicles_class", _vehicles_class),
    ("vehicles_rigid", _vehicles_rigid),
    (
        "kitti_labels",
        _vehicles("KITTI: nine frames, labelled boxes", "Keypoints and models as above, class known."),
    ),
    (
        "kitti_detections",
        _vehicles(
            "KITTI: six frames, boxes of a real detector",
            "As above; frames without detections are left out.",
        ),
    ),
    ("kitti_network", _vehicles("KITTI: nine frames, labelled boxes, the bundled network", NETWORK)),
    (
        "kitti_network_detections",
        _vehicles("KITTI: six frames, boxes of a real detector, the bundled network", NETWORK),
    ),
    ("apollo", _apollo),
    ("tilt", _tilt),
    ("speed", _speed),
)
"""Files of numbers and what is written of them, in the order of the page."""
