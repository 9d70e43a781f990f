"""Cameras from files: the format is recognised by the content.

A format is a row of `CALIBRATIONS`: its name, and how it finds the cameras of a record or of a text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from groundpose._checks import input_error
from groundpose.formats.cameras.driving import (
    argoverse_entries,
    cityscapes_entries,
    nuscenes_entries,
    waymo_entries,
)
from groundpose.formats.cameras.matrices import matlab_entries, matrix_entries, stereo_entries
from groundpose.formats.cameras.record import Entry, Record
from groundpose.formats.cameras.scalars import carla_entries, own_entries, realsense_entries
from groundpose.formats.cameras.slam import basalt_entries, kalibr_entries, orb_entries, vins_entries
from groundpose.formats.cameras.texts import colmap_entries, kitti_entries
from groundpose.formats.content import Content, read_content
from groundpose.formats.fields import Field
from groundpose.formats.opencv_xml import parse_opencv_xml
from groundpose.formats.yaml_text import parse_yaml
from groundpose.types import Camera, View


@dataclass(frozen=True)
class CalibrationFormat:
    """One format: its name in errors, and the cameras that it finds: in a record, or in the text of a file.

    Reading one raises InputError naming file and line or key. A tilt that the file does not tell is 0.
    """

    name: str
    in_record: Callable[[Record], list[Entry]] | None = None
    in_text: Callable[[Content], list[Entry]] | None = None


CALIBRATIONS: tuple[CalibrationFormat, ...] = (
    CalibrationFormat("KITTI's text with a line P2", in_text=kitti_entries),
    CalibrationFormat("COLMAP's cameras.txt", in_text=colmap_entries),
    CalibrationFormat("nuScenes' calibrated_sensor", nuscenes_entries),
    CalibrationFormat("Basalt's list of intrinsics", basalt_entries),
    CalibrationFormat("Kalibr's camchain or EuRoC's sensor.yaml", kalibr_entries),
    CalibrationFormat("VINS' projection_parameters", vins_entries),
    CalibrationFormat("ORB-SLAM's or OpenVSLAM's Camera.fx", orb_entries),
    CalibrationFormat("Cityscapes' camera.json", cityscapes_entries),
    CalibrationFormat("Waymo's intrinsic", waymo_entries),
    CalibrationFormat("Argoverse's focal_length_x_px_", argoverse_entries),
    CalibrationFormat("MATLAB's cameraParameters", matlab_entries),
    CalibrationFormat("the camera_matrix or K of OpenCV, ROS, Autoware or Open3D", matrix_entries),
    CalibrationFormat("OpenCV's stereo M1, D1", stereo_entries),
    CalibrationFormat("RealSense's ppx, ppy", realsense_entries),
    CalibrationFormat("CARLA's fov", carla_entries),
    CalibrationFormat("JSON with fx, fy, cx, cy", own_entries),
)
"""The formats, asked in this order."""

_NAME_KEYS = ("camera_name", "channel", "name", "token", "sensor_token", "key", "camera_id", "id")
_DEEPEST = 6
_LISTED = 12


def read_calibration(path: str | PathLike[str], name: str | None = None) -> View:
    """Camera and tilt from a file of any format of `CALIBRATIONS`.

    Args:
        path: the file.
        name: which of its cameras: its key in the file, its name, token, channel or number there. None: the
            only one (of KITTI's the usual P2, of ROS's the raw one rather than the "rectified" one).

    Raises:
        OSError: no such file. InputError: no format suits, the file is not as its format has it, it has
            several cameras and none is named, or none of this name.
    """
    content = read_content(path)
    entries = [entry for row in CALIBRATIONS if row.in_text for entry in row.in_text(content)]
    if not entries:
        root = _root(content)
        entries = [] if root is None else list(_search(root, ()))
    if not entries:
        known = "; ".join(row.name for row in CALIBRATIONS)
        raise input_error(content.place, f"a calibration ({known})", "something else")
    view = _chosen(content.place, _with_channels(entries, Path(path)), name).read()
    _refuse_implausible(content.place, view.camera)
    return view


def camera_of_message(message: Mapping[str, Any], place: str, rectified: bool = False) -> Camera:
    """The camera of a ROS CameraInfo, or of what has its members: `width, height, distortion_model, D, K, R,
    P`.

    Args:
        message: its members as numbers, texts and lists.
        place: how errors begin.
        rectified: whether of the rectified pictures (`P`) rather than of the raw ones.

    Raises:
        InputError: no camera, or one that is not calibrated.
    """
    entries = list(_search(Field(dict(message), place), ()))
    if not entries:
        raise input_error(place, "a camera with K or P", "none")
    camera = _chosen(place, entries, "rectified" if rectified else None).read().camera
    _refuse_implausible(place, camera)
    return camera


def _root(content: Content) -> Field | None:
    """What a JSON, YAML or OpenCV's XML holds; a list of the values of JSON lines."""
    if content.json:
        one = len(content.json) == 1
        return content.json[0] if one else Field([line.value for line in content.json], content.place)
    parse = parse_opencv_xml if content.text.lstrip().startswith("<") else parse_yaml
    return parse(content.text, content.place)


def _search(field: Field, names: tuple[str, ...]) -> Iterator[Entry]:
    """The cameras of a record; of its members where it is none itself."""
    if isinstance(field.value, dict) and field.value:
        record = Record(field)
        for row in CALIBRATIONS:
            entries = row.in_record(record) if row.in_record else []
            if entries:
                yield from (_named(entry, field, names) for entry in entries)
                return
    found = [entry for key, child in _children(field) for entry in _search(child, (key, *_names_of(field)))]
    if found and isinstance(field.value, dict):
        rest = Record(field)
        rest.ignore(*_cameras_keys(field))
        rest.refuse_unread()
    yield from found


def _cameras_keys(field: Field) -> list[str]:
    return [key for key, value in field.value.items() if isinstance(value, (dict, list)) or "." in key]


def _children(field: Field) -> Iterator[tuple[str, Field]]:
    """Members that may hold cameras, each with its key; `Camera.fx`, `Camera.fy` are those of `Camera`."""
    if field.path.count(".") + field.path.count("[") >= _DEEPEST:
        return
    if isinstance(field.value, list):
        if any(isinstance(item, dict) for item in field.value):
            yield from ((str(i), child) for i, child in enumerate(field.items()))
    elif isinstance(field.value, dict):
        blocks: dict[str, dict[str, object]] = {}
        for key, child in field.entries():
            block, _, rest = key.partition(".")
            if rest:
                blocks.setdefault(block, {})[rest] = child.value
            else:
                yield key, child
        for block, members in blocks.items():
            yield block, field.child(members, f".{block}")


def _names_of(field: Field) -> tuple[str, ...]:
    """What a record calls itself."""
    if not isinstance(field.value, dict):
        return ()
    given = (field.value.get(key) for key in _NAME_KEYS)
    return tuple(str(name) for name in given if isinstance(name, (str, int)))


def _named(entry: Entry, field: Field, outer: tuple[str, ...]) -> Entry:
    """With the names of its record and of the place where it stands before its own."""
    names = dict.fromkeys((*_names_of(field), *outer))
    own = entry.names
    if not names:
        return entry
    both = tuple(f"{name} {mine}" for name in names for mine in own)
    plain = tuple(names) if not own or entry.is_default else ()
    return Entry((*plain, *both, *own), entry.read, entry.is_default)


def _with_channels(entries: list[Entry], path: Path) -> list[Entry]:
    """nuScenes' cameras by their channel too, which stands in the file sensor.json beside theirs."""
    table = path.with_name("sensor.json")
    if path.name != "calibrated_sensor.json" or not table.is_file():
        return entries
    root = _root(read_content(table))
    rows = root.items() if root else []
    channels = {row.need("token").text(): row.need("channel").text() for row in rows}
    return [
        Entry(tuple(channels[name] for name in entry.names if name in channels) + entry.names, entry.read)
        for entry in entries
    ]


def _chosen(place: str, entries: list[Entry], name: str | None) -> Entry:
    """The camera of this name, or the one that needs none. Raises InputError listing the names."""
    if name is None:
        suiting = entries if len(entries) == 1 else [entry for entry in entries if entry.is_default]
    else:
        suiting = [entry for entry in entries if name in entry.names]
    if len(suiting) == 1:
        return suiting[0]
    listed = [entry.names[0] if entry.names else "one without a name" for entry in suiting or entries]
    if len(set(listed)) < len(listed):  # the same channel of several vehicles
        listed = [entry.names[1] if len(entry.names) > 1 else entry.names[0] for entry in suiting or entries]
    shown = ", ".join(listed[:_LISTED]) + (", ..." if len(listed) > _LISTED else "")
    got = "none of them named" if name is None else repr(name)
    if name is not None and suiting:
        got += f", which {len(suiting)} of them are called"
    raise input_error(f"{place}: camera", f"the name of one of {shown}", got)


def _refuse_implausible(place: str, camera: Camera) -> None:
    """A camera whose numbers are no pixels: a unit matrix, or numbers over the size of the image."""
    focal, point = max(camera.fx, camera.fy), max(abs(camera.cx), abs(camera.cy))
    if focal < 20.0 and point <= 2.0:
        got = f"fx {camera.fx:g}, fy {camera.fy:g}, cx {camera.cx:g}, cy {camera.cy:g}"
        raise input_error(
            f"{place}: camera", "fx, fy, cx, cy in pixels", f"{got}: over the size of the image?"
        )
