"""The page of an evaluation: tables, curves by distance and tilt, and pictures of the worst objects."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from groundpose.draw import Tile, contact_sheet
from groundpose.draw.colours import GRID
from groundpose.formats.kitti.dataset import DIFFICULTIES
from groundpose.formats.skips import Skips
from groundpose.lab.contenders.registry import by_option
from groundpose.lab.contenders.styles import style_of
from groundpose.lab.evaluate import html
from groundpose.lab.evaluate.kitti.frame import estimate, prepare
from groundpose.lab.evaluate.kitti.run import Worker
from groundpose.lab.evaluate.kitti.show import pixels_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Content = dict[str, Any]
_CURVES = (
    ("distance", "distance, m"),
    ("tilt", "tilt of the road below the object against the nominal one, deg"),
)
_MEASURES = (("median e_r deg", "median e_r, deg"), ("yaw above 15 deg %", "yaw error above 15 deg, %"))
_FEWEST = 10
"""Groups of fewer objects are not drawn."""
_GROUPS = ("class", "distance", "truncation", "occlusion", "tilt")


def write(content: Content, worker: Worker, folder: Path) -> Path:
    """The page of the numbers that `run` gave; the worst objects are estimated once more for their
    pictures."""
    title = f"KITTI: {worker.folder.root.name}"
    return html.write(folder, html.page(title, _parts(content, worker)))


def _parts(content: Content, worker: Worker) -> Iterator[str]:
    frames, settings = content["frames"], content["settings"]
    yield f"<p><code>{html.text('span', content['command'])}</code></p>"
    versions = ", ".join(f"{name} {value}" for name, value in content["versions"].items())
    yield html.text(
        "p",
        f"{frames['done']} frames, {content['objects']} objects ({content['missed objects']} without a box). "
        f"Boxes: {settings['boxes']}; keypoints: {settings['keypoints']}; nominal tilt "
        f"{settings['pitch_deg']:g} deg. {versions}; {content['machine']}.",
        "note",
    )
    if frames["done"]:
        yield from _headline(content)
        yield from _curves(content)
        yield from _worst(content, worker)
        yield from _tables(content)
    yield from _left_out(content)


def _headline(content: Content) -> Iterator[str]:
    yield html.text("h2", "Errors at easy / moderate / hard")
    rows = []
    for method in content["methods"]:
        groups = method["by difficulty"][: len(DIFFICULTIES)]

        def three(name: str, groups: list[Content] = groups) -> list[Any]:
            return [group[name] for group in groups]

        rows.append(
            {
                "method": method["method"],
                "e_r, deg": three("mean e_r deg"),
                "e_a, deg": three("mean e_a deg"),
                "failures, %": three("failures %"),
                "yaw above 15 deg, %": three("yaw above 15 deg %"),
                "no answer, %": three("no answer %"),
                "us per object": method["us per object"],
            }
        )
    yield html.table(rows)
    yield html.text(
        "p",
        "Means over the objects with an answer, as the paper's Table 3; each level holds those before it. A "
        "failure: e_r above 10 deg, e_t above 10 % or no answer.",
        "note",
    )
    yield html.text("h2", "Average precision (R40) at easy / moderate / hard, %")
    yield html.table(
        [
            {"method": method["method"], "class": class_name, **precision}
            for method in content["methods"]
            for class_name, precision in method["average precision"].items()
            if any(value is not None for value in precision["2D"])
        ]
    )
    check = {class_name: row["3D"] for class_name, row in content["self-check"].items()}
    words = "; ".join(
        f"{class_name} {' / '.join('–' if x is None else f'{x:g}' for x in v)}"
        for class_name, v in check.items()
    )
    yield html.text("p", f"Overlaps: 0.7, loose 0.5. The labels against themselves, 3D: {words}.", "note")


def _curves(content: Content) -> Iterator[str]:
    yield html.text("h2", "By distance and by tilt")
    enough = [
        (what, label)
        for what, label in _CURVES
        if any(len(_shown(method[f"by {what}"])) > 1 for method in content["methods"])
    ]
    if not enough:
        yield html.text("p", f"A curve needs two groups of {_FEWEST} objects and more.")
    for what, label in enough:
        yield html.figure(_curve(content, what, label), f"By {what}; groups of {_FEWEST} objects and more.")


def _curve(content: Content, what: str, label: str) -> Figure:
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(11.0, 3.6), layout="constrained")
    panels: list[Axes] = list(drawn.subplots(1, 2))
    shown = {row["group"] for method in content["methods"] for row in _shown(method[f"by {what}"])}
    words = [row["group"] for row in content["methods"][0][f"by {what}"] if row["group"] in shown]
    for axes, (measure, name) in zip(panels, _MEASURES, strict=True):
        for method in content["methods"]:
            rows = _shown(method[f"by {what}"])
            style = style_of(method["method"]).curve()
            x, y = [words.index(row["group"]) for row in rows], [row[measure] for row in rows]
            axes.plot(x, y, **style, linewidth=1.6, markersize=5, label=method["method"])
        axes.set_xticks(range(len(words)), [_short(word) for word in words], fontsize=8)
        axes.set(xlabel=label, ylabel=name, ylim=(0.0, None))
        axes.grid(color=GRID, linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    drawn.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False)
    return drawn


def _short(word: str) -> str:
    return word.removesuffix(" m").removesuffix(" deg").replace("below ", "< ")


def _shown(rows: list[Content]) -> list[Content]:
    return [row for row in rows if row["objects"] >= _FEWEST]


def _tables(content: Content) -> Iterator[str]:
    yield html.text("h2", "All groups")
    for method in content["methods"]:
        yield html.text("h3", method["method"])
        groups = [("difficulty", method["by difficulty"])]
        groups += [(what, method[f"by {what}"]) for what in _GROUPS]
        rows = []
        for what, lines in groups:
            rows += [{"group": f"{what}: {row['group']}", **_numbers(row)} for row in lines if row["objects"]]
        yield html.table(rows)


def _numbers(row: Content) -> Content:
    return {key: value for key, value in row.items() if key not in ("group", "from", "to")}


def _worst(content: Content, worker: Worker) -> Iterator[str]:
    tiles = list(_tiles(content, worker))
    if tiles:
        method = content["methods"][0]["method"]
        yield html.text("h2", f"The {len(tiles)} worst objects of {method}")
        yield html.figure(contact_sheet(tiles), _CAPTION + _simulated(content), "png")


_CAPTION = (
    "Frame, object, error of rotation. Orange: the 2D box; blue: the estimated 3D box, its front yellow "
    "(dashed when seen from behind); white: the shape; dots: inliers, crosses: outliers. No image: a blank "
    "background."
)


def _simulated(content: Content) -> str:
    return " The keypoints are simulated." if content["settings"]["keypoints"] == "simulated" else ""


def _tiles(content: Content, worker: Worker) -> Iterator[Tile]:
    method = by_option("kitti")[worker.task.methods[0]]
    for row in content["worst"]:
        skipped = Skips()
        frame = worker.folder.read(row["frame"], skipped)
        prepared = None if frame is None else prepare(frame, worker.task, worker.source, skipped)
        if frame is None or prepared is None:
            continue  # it was there when it was evaluated
        poses = estimate(frame, prepared, worker.task, method)
        labelled = [k for k, label in enumerate(prepared.labels) if label is not None]
        index = labelled[row["object"]]
        said = f"{row['e_r deg']:.0f}°" if poses.ok[index] else str(poses.status[index])
        title = f"{row['frame']} #{row['object']} {prepared.boxes[index].type}: {said}"
        yield Tile(pixels_of(frame), poses, index, title)


def _left_out(content: Content) -> Iterator[str]:
    yield html.text("h2", "Left out")
    if not content["skipped"]:
        yield html.text("p", "Nothing.")
        return
    rows = [
        {"what": row["reason"], "how many": row["count"], "first": "; ".join(row["first"][:3])}
        for row in content["skipped"]
    ]
    yield html.table(rows)
