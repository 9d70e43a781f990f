"""The formats of 2D boxes, and the reader that chooses among them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike

from groundpose._checks import input_error
from groundpose.formats.boxes import rows, sets, text, tools, xml
from groundpose.formats.boxes.box import Boxes, BoxFile
from groundpose.formats.content import Content, read_content
from groundpose.formats.skips import Skips


@dataclass(frozen=True)
class BoxFormat:
    """One format: its name in errors, whether a file's content is in it, and its reader.

    `read` maps images to boxes, see `BoxFile`, counts what it leaves out, and raises InputError naming file
    and line or field. `first_frame` is the number of a video's first frame.
    """

    name: str
    suits: Callable[[Content], bool]
    read: Callable[[Content, Skips], Mapping[str, Boxes]]
    first_frame: int = 0


def read_boxes(path: str | PathLike[str]) -> BoxFile:
    """Boxes from a file of any format of `BOXES`.

    Raises:
        OSError: no such file. InputError: no format suits, or the file is not as its format has it.
    """
    content = read_content(path)
    for row in BOXES:
        if row.suits(content):
            skipped = Skips()
            return BoxFile(str(path), row.read(content, skipped), skipped, row.first_frame)
    known = "; ".join(row.name for row in BOXES)
    raise input_error(str(path), f"2D boxes ({known})", _in_words(content))


def _in_words(content: Content) -> str:
    """What a file is that holds no boxes."""
    if content.json:
        value = content.json[0].value
        return f"JSON with {', '.join(value) or 'nothing'}"[:80] if isinstance(value, dict) else "other JSON"
    if xml.is_xml(content):
        return f"XML <{xml.root_of(content).tag[:40]}>"
    return "something else"


BOXES: tuple[BoxFormat, ...] = (
    BoxFormat("KITTI's labels or results", text.is_kitti, text.kitti),
    BoxFormat("KITTI's tracking labels", text.is_kitti_tracking, text.kitti_tracking),
    BoxFormat("Pascal VOC", xml.is_voc, xml.voc),
    BoxFormat("CVAT", xml.is_cvat, xml.cvat),
    BoxFormat("UA-DETRAC", xml.is_detrac, xml.detrac, first_frame=1),
    BoxFormat("CSV with a header", rows.is_csv, rows.csv_table),
    BoxFormat("MOT Challenge", text.is_mot, text.mot, first_frame=1),
    BoxFormat("YOLO", text.is_yolo, text.yolo),
    BoxFormat("lines of left, top, right, bottom", text.is_numbers, text.numbers),
    BoxFormat("a COCO data set", sets.is_coco, sets.coco),
    BoxFormat("COCO results", sets.is_coco_results, sets.coco_results),
    BoxFormat("nuScenes' 2D annotations", sets.is_nuscenes, sets.nuscenes),
    BoxFormat("Label Studio", tools.is_label_studio, tools.label_studio),
    BoxFormat("labelme", tools.is_labelme, tools.labelme),
    BoxFormat("BDD100K", tools.is_bdd, tools.bdd),
    BoxFormat("Cityscapes", tools.is_cityscapes, tools.cityscapes),
    BoxFormat("JSON objects with the columns of a box (ultralytics, supervision)", rows.is_rows, rows.rows),
    BoxFormat('our frames {"objects": [{"bbox": ...}]}', sets.is_frames, sets.frames),
    BoxFormat("a JSON list of left, top, right, bottom", sets.is_list, sets.plain_list),
)
"""The formats, asked in this order."""
