"""Damaged files of every kind that is read: each is read, or refused with an error of its own kind.

`python tests/python/mutations.py --count 300000` writes results/mutations.json; `test_mutations.py` tries a
few of each kind. Refused means `InputError` that names the file and is short, or `OSError`. Anything else, a
warning of NumPy too, is an untyped error and is listed with the file's content.
"""

from __future__ import annotations

import argparse
import base64
import io
import json
import random
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import detectors
import groundpose as gp
import numpy as np
from conftest import CAMERA, MODEL, VIEW, make_batch
from groundpose.formats.apollo import read_keypoints as read_apollo
from groundpose.formats.boxes import read_boxes
from groundpose.formats.calibrations import read_calibration
from groundpose.formats.coco_keypoints import read_keypoints
from groundpose.formats.frames import FrameSource, model_members
from groundpose.formats.kitti.dataset import read_split
from groundpose.formats.kitti.labels import read_labels, read_tracking
from groundpose.formats.kitti.table import KittiTable
from groundpose.formats.skips import Skips
from groundpose.keypoints.image import as_rgb
from groundpose.lab.drive.workers import Settings
from groundpose.lab.drive.write import SETTINGS, write_drive
from PIL import Image
from stand_in import onnx
from stand_in import write as write_network
from test_box_formats import FORMATS, H, W, coco
from test_calibration_tools import READ

OUT = Path("results/mutations.json")
LONGEST = 2000
"""Characters of an error: a file may hold a line of a megabyte."""


@dataclass(frozen=True)
class Kind:
    """Files of a kind: whole ones, what mutates one, and what reads it."""

    seeds: list[bytes]
    mutate: Callable[[random.Random, bytes], bytes]
    read: Callable[[Path], object]
    share: float = 1.0
    name: str = "file.any"


# How content is damaged.

PIECES = tuple(
    piece.encode("utf-8", "surrogateescape")
    for piece in (
        *('"', "{", "}", "[", "]", ",", "null", "1e400", "-1", "NaN", '""', "<", ">", "/>", "\n", "\0", " "),
        *("9" * 30, "9" * 400, "9" * 5000, "true", "é", "[]", "{}", "0", "&", "id", "box", "\t", ";", ":"),
        *("-", "- ", "'", "%", "!!", "*a", "&a ", "|", "#", "\udcff", "\u202e", "1e308", "-0", ".", "<!--"),
    )
)


def text(draw: random.Random, content: bytes) -> bytes:
    """Pieces cut out, put in and replaced, here and there."""
    for _ in range(draw.randint(1, 4)):
        at, length = draw.randrange(len(content) + 1), draw.choice((0, 0, 1, 8, 30))
        content = content[:at] + draw.choice((*PIECES, b"", b"", b"")) + content[at + length :]
    return content


def raw(draw: random.Random, content: bytes) -> bytes:
    """Bytes changed, runs of them left out or repeated, the end cut off."""
    made = bytearray(content)
    for _ in range(draw.choice((1, 1, 2, 5, 20))):
        at = draw.randrange(len(made) + 1)
        what = draw.randrange(6)
        if what < 3 and at < len(made):
            made[at] = draw.choice((0, 1, 127, 128, 255, draw.randrange(256)))
        elif what == 3:
            del made[at : at + draw.choice((1, 4, 100))]
        elif what == 4:
            made[at:at] = made[at : at + draw.choice((1, 8, 100))]
        elif draw.random() < 0.3:
            del made[at:]
    return bytes(made)


ODD: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 0.5, -0.0, 1e308, -1e308, 1e-320, float("nan"), float("inf"), 10**400),
    *(
        "",
        "0",
        "car",
        "\0",
        "\ud800",
        "a" * 5000,
        "../../x",
        [],
        {},
        [[]],
        [None],
        {"": None},
        [0] * 9,
        2**63,
    ),
    *([1e300] * 3, {"data": []}, [1, [2, [3]]], "nan", "1e5", [10**400] * 4, -(2**31), [True] * 4),
)


def tree(draw: random.Random, content: bytes) -> bytes:
    """JSON whose members are replaced, left out, doubled and moved; now and then its text is damaged."""
    if draw.random() < 0.2:
        return text(draw, content)
    try:
        lines = [json.loads(line) for line in content.splitlines() if line.strip()]
    except ValueError:
        lines = [json.loads(content)]
    for _ in range(draw.choice((1, 1, 1, 2, 4))):
        where = draw.randrange(len(lines))
        lines[where] = _changed(draw, lines[where])
    return b"\n".join(json.dumps(line).encode("utf-8", "surrogatepass") for line in lines)


def _changed(draw: random.Random, value: Any) -> Any:
    inside = isinstance(value, (dict, list)) and value and draw.random() < 0.85
    if not inside:
        return draw.choice(ODD)
    made: Any = value.copy()
    keys = list(made) if isinstance(made, dict) else list(range(len(made)))
    key, what = draw.choice(keys), draw.random()
    if what < 0.1:
        del made[key]
    elif what < 0.15 and isinstance(made, dict):
        made[draw.choice(("x", "K", "D", "bbox", "id", "roi", key + "_", key.upper()))] = made.pop(key)
    elif what < 0.2 and isinstance(made, list):
        made += [made[key]] * draw.choice((1, 3))
    else:
        made[key] = _changed(draw, made[key])
    return made


def arrays(draw: random.Random, content: bytes) -> bytes:
    """An .npz whose arrays have other types, shapes and values; half of the time its bytes are damaged."""
    if draw.random() < 0.5:
        return raw(draw, content)
    with np.load(io.BytesIO(content)) as file:
        made = dict(file)
    key = draw.choice(list(made))
    array = made[key]
    change = draw.randrange(6)
    if change == 0:
        del made[key]
    elif change == 1:
        kind = draw.choice(("f2", "i8", "u1", "c16", "U3", "S2", "?", "M8[s]", "f8"))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            made[key] = array.astype(kind) if array.dtype.kind in "fiu" else np.zeros(array.shape, kind)
    elif change == 2:
        made[key] = array.reshape((*array.shape, 1)) if draw.random() < 0.5 else array.ravel()
    elif change == 3:
        made[key] = array[:-1] if array.ndim else np.array([array])
    elif change == 4 and array.size and array.dtype.kind in "fi":
        made[key] = array.copy()
        odd = (np.nan, np.inf, 1e308, -1, 0, 2**62) if array.dtype.kind == "f" else (-1, 0, 2**62, 2)
        made[key].flat[draw.randrange(array.size)] = draw.choice(odd)
    else:
        made[draw.choice(("x", *made))] = draw.choice((np.zeros(0), np.array("a"), np.ones((2, 3, 4))))
    file = io.BytesIO()
    np.savez(file, **made)
    return file.getvalue()


def metadata(draw: random.Random, content: bytes) -> bytes:
    """An ONNX file that says something else of itself, or has other names; sometimes with damaged bytes."""
    if draw.random() < 0.2:
        return raw(draw, content)
    model = onnx.load_from_string(content)
    said = {p.key: p.value for p in model.metadata_props}
    for _ in range(draw.choice((1, 1, 2))):
        key, what = draw.choice(list(said)), draw.random()
        if what < 0.15:
            del said[key]
        elif what < 0.3:
            said[key + "s"] = said.pop(key)
        elif what < 0.6:
            said[key] = text(draw, said[key].encode()).decode("utf-8", "replace")
        else:
            said[key] = (
                json.dumps(draw.choice(ODD)) if draw.random() < 0.7 else ascii(draw.choice(ODD))[:50:2]
            )
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, {k: v.replace("\ud800", "?") for k, v in said.items()})
    if draw.random() < 0.15:
        dims = [d for v in (*model.graph.input, *model.graph.output) for d in v.type.tensor_type.shape.dim]
        draw.choice(dims).dim_value = draw.choice((0, 1, 7, 2**31, 2**62))
    return bytes(model.SerializeToString())


# What reads it.


def _boxes(path: Path) -> None:
    file = read_boxes(path)
    boxes = file.of("street.jpg").in_pixels(W, H, file.place).boxes
    with suppress(gp.InputError):  # where images have names
        boxes = (*boxes, *file.frame(3).boxes)
    for box in boxes:
        str(box.is_vehicle)


def _frames(path: Path) -> None:
    """Every line is a frame or its error; frames are estimated."""
    bad: gp.InputError | None = None
    with path.open("rb") as stream:
        for frame in FrameSource(stream, str(path), path.parent):
            if isinstance(frame, gp.InputError):
                bad = frame
            else:
                gp.estimate_poses(**frame.arguments, threads=1)
    if bad is not None:
        raise bad


def _coco_keypoints(path: Path) -> None:
    for skipped in (None, Skips()):
        for frame in read_keypoints(path, VIEW, {"car": NAMED}, skipped):
            gp.estimate_poses(**frame.arguments, threads=1)


def _table(path: Path) -> None:
    table, skipped = KittiTable(path, with_detections=True), Skips()
    for name in table.ids():
        table.read(name, skipped)


def _network(path: Path) -> None:
    network = gp.Network(path, threads=1)
    network.detect(np.zeros((1, network.codec.height, network.codec.width, 3), np.uint8))


def _detector(path: Path) -> None:
    gp.Detector(path, threads=1)(np.full((60, 90, 3), 20, np.uint8))


def _drive(path: Path) -> None:
    """The settings of a drive that is gone on with; nothing is left to make."""
    try:
        write_drive(path.parent, 1, Settings(images=None))
    finally:
        for left in path.parent.iterdir():
            if left.is_file() and left.name not in (path.name, "labels.jsonl", *_WHOLE_DRIVE):
                left.unlink()


_WHOLE_DRIVE = ("tilt.csv", "keypoints_coco.json")


_SEVERAL = "expected the name of one of "


def _camera(path: Path) -> None:
    """Of several, the first that the error names."""
    try:
        read_calibration(path)
    except gp.InputError as error:
        _, several, names = str(error).partition(_SEVERAL)
        if not several:
            raise
        read_calibration(path, names.split(", ")[0].strip("'"))


# Whole files.

NAMED = gp.ShapeModel(
    MODEL.keypoints_3d, MODEL.bbox_3d, keypoint_names=tuple(f"k{i}" for i in range(24)), name="car"
)


def _json(value: object) -> bytes:
    return json.dumps(value).encode()


def _frame_lines() -> bytes:
    batch = make_batch(2, seed=3)
    camera = {name: getattr(CAMERA, name) for name in ("fx", "fy", "cx", "cy", "image_size")}
    objects = [
        {"id": k, "model": "car", "keypoints_2d": points.tolist(), "bbox": box.tolist()}
        | {"keypoint_scores": [1.0] * 24, "truth": {"R": R.tolist(), "t": t.tolist()}}
        for k, (points, box, R, t) in enumerate(
            zip(batch.keypoints_2d, batch.bboxes, batch.R, batch.t, strict=True)
        )
    ]
    head = {"id": "a", "camera": camera, "pitch_deg": 1.0, "roll_deg": 0.0, "camera_height": 1.5}
    models = {"models": {"car": model_members(SHAPED)}}
    again = {"id": 1, "camera": camera, "gravity": [0.0, 1.0, 0.0], "objects": objects[:1]}
    return _json(head | models | {"objects": objects}) + b"\n" + _json(again) + b"\n"


SHAPED = gp.ShapeModel(
    MODEL.keypoints_3d,
    MODEL.bbox_3d,
    np.random.default_rng(0).normal(size=(2, 24, 3)) / 8.0,
    [0.1, 0.05],
    footprint=[[-1, -2], [1, -2], [1, 2], [-1, 2]],
    bbox_basis=np.zeros((2, 2, 3)),
)


def _coco_names() -> dict[str, Any]:
    batch = make_batch(1, seed=3)
    points = [float(v) for u, w in batch.keypoints_2d[0] for v in (u, w, 2)]
    annotation = {"id": 1, "image_id": 1, "category_id": 1, "iscrowd": 0, "bbox": [1, 2, 30, 40]}
    return {
        "images": [{"id": 1, "file_name": "a.png", "width": 1280, "height": 720}],
        "categories": [{"id": 1, "name": "car", "keypoints": list(NAMED.keypoint_names)}],
        "annotations": [annotation | {"keypoints": points, "num_keypoints": 24}] * 2,
    }


def _saved(save: Callable[[Path], object]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "saved.onnx"
        save(path)
        return path.read_bytes()


def _kitti_table() -> bytes:
    names = "split seq frame track cls trunc occ alpha x1 y1 x2 y2 h w l x y z ry det_score"
    columns = [*names.split(), "det_x1", "det_y1", "det_x2", "det_y2", "imgW", "imgH"]
    row = [
        0,
        0,
        0,
        1,
        0,
        0,
        0,
        0,
        10,
        20,
        60,
        70,
        1.5,
        1.7,
        4.2,
        1,
        1.6,
        20,
        0,
        0.9,
        9,
        19,
        61,
        71,
        1242,
        375,
    ]
    file = io.BytesIO()
    rows = np.array([row, row], float)
    P2 = np.hstack([CAMERA.K, np.zeros((3, 1))])[None]
    np.savez(file, rows=rows, cols=np.array(columns), classes=np.array(["Car"]), P2_by_seq=P2)
    return file.getvalue()


def _pictures() -> list[bytes]:
    pixels = np.random.default_rng(0).integers(0, 255, (40, 60, 3), dtype=np.uint8)
    exif = Image.Exif()
    exif[0x0112] = 6
    found = []
    for form, mode in (("PNG", "RGB"), ("JPEG", "RGB"), ("PNG", "P"), ("TIFF", "CMYK"), ("WEBP", "RGB")):
        file = io.BytesIO()
        Image.fromarray(pixels).convert(mode).save(file, form, **({} if mode == "P" else {"exif": exif}))
        found.append(file.getvalue())
    file = io.BytesIO()
    Image.fromarray(pixels.astype(np.uint16)[..., 0] * 100).save(file, "PNG")
    return [*found, file.getvalue()]


_LABEL = "Car 0.00 0 -1.5 {} 20 60 70 1.5 1.7 4.2 1 1.6 20 0.1"
_STATE = gp.CameraState(gp.View(CAMERA, height=1.5), gp.FramePriors(size=gp.SizePrior.region("europe")))


def kinds() -> dict[str, Kind]:
    """Every kind of file that is read."""
    cameras = {name: content for name, (content, *_) in READ.items()}
    texts = [c.encode() for c in cameras.values() if isinstance(c, str)]
    objects = [_json(c) for c in cameras.values() if not isinstance(c, str)]
    sets = {**FORMATS, "COCO": json.dumps(coco(width=W, height=H))}
    records = [t.encode() for t in sets.values() if t.startswith(("{", "["))]
    network = _saved(lambda path: write_network(path, version="2", vehicle_threshold="0.5", certainty="{}"))
    labels = "\n".join([_LABEL.format(10), _LABEL.format(11) + " 0.9"])
    tracks = "\n".join(f"{k} {k} {_LABEL.format(10)}" for k in range(3))
    return {
        "cameras, text": Kind(texts, text, _camera, 4.0),
        "cameras, JSON": Kind(objects, tree, _camera, 4.0),
        "boxes, text and XML": Kind([t.encode() for t in sets.values()], text, _boxes, 6.0),
        "boxes, JSON": Kind(records, tree, _boxes, 4.0),
        "frames": Kind([_frame_lines()], tree, _frames, 1.5),
        "COCO keypoints": Kind([_json(_coco_names())], tree, _coco_keypoints, 2.0),
        "KITTI labels": Kind([labels.encode()], text, read_labels, 2.0),
        "KITTI tracks": Kind([tracks.encode()], text, read_tracking),
        "KITTI table": Kind([_kitti_table()], arrays, _table, 0.5),
        "KITTI split": Kind([b"000001\n000002\n"], text, lambda path: read_split(path, Skips()), 0.5),
        "Apollo keypoints": Kind([b"1\t100.0\t200.0\n7\t3.5\t4\n"], text, read_apollo),
        "shape models": Kind([_saved(SHAPED.save), _saved(NAMED.save)], arrays, gp.ShapeModel.load, 2.0),
        "camera states": Kind([_saved(_STATE.save)], tree, gp.CameraState.load, 2.0),
        "settings of drives": Kind([_saved(_settings)], tree, _drive, 0.3, SETTINGS),
        "pictures": Kind(_pictures(), raw, as_rgb, 2.0),
        "networks": Kind([network], metadata, _network, 0.6),
        "detectors": Kind(_detectors(), metadata, _detector, 0.6),
    }


def _detectors() -> list[bytes]:
    names = {"names": str({0: "person", 1: "bicycle", 2: "car"}), "task": "detect", "stride": "32"}
    return [
        _saved(lambda path, way=way: detectors.write(path, way, metadata=names)) for way in detectors.WAYS
    ]


def _settings(path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        write_drive(Path(folder), 1, Settings(images=None))
        path.write_bytes((Path(folder) / SETTINGS).read_bytes())


# Trying them.


@dataclass
class Found:
    """How often files of a kind were read or refused, and what else happened."""

    tried: int = 0
    read: int = 0
    refused: int = 0
    untyped: Counter[str] = field(default_factory=Counter)
    unnamed: Counter[str] = field(default_factory=Counter)
    """Errors that do not name the file, or say too much."""
    examples: dict[str, str] = field(default_factory=dict)
    """Of both: the content, base64."""
    slowest: float = 0.0


@contextmanager
def scratch() -> Iterator[Path]:
    """A folder in memory where there is one: a disk is ten times as slow."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        yield Path(folder)


def attempt(kind: Kind, count: int, seed: object, folder: Path, found: Found | None = None) -> Found:
    """Damage files of a kind so often and read them."""
    found, draw, path = found or Found(), random.Random(str(seed)), folder / kind.name
    for _ in range(count):
        content = kind.mutate(draw, draw.choice(kind.seeds))
        path.write_bytes(content)
        start = time.perf_counter()
        _read(kind, path, content, found)
        found.slowest = max(found.slowest, time.perf_counter() - start)
        found.tried += 1
    return found


def _read(kind: Kind, path: Path, content: bytes, found: Found) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", module="PIL", category=UserWarning)  # of damaged EXIF data
            kind.read(path)
    except gp.InputError as error:
        found.refused += 1
        if len(str(error)) > LONGEST or not str(error).startswith((str(path), str(path.parent))):
            _note(found.unnamed, found, str(error)[:100], content)
    except OSError:
        found.refused += 1
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        place = error.__traceback__
        while place is not None and place.tb_next is not None:
            place = place.tb_next
        where = f"{Path(place.tb_frame.f_code.co_filename).name}:{place.tb_lineno}" if place else ""
        _note(found.untyped, found, f"{type(error).__name__} {where} {str(error)[:80]}", content)
    else:
        found.read += 1


def _note(counts: Counter[str], found: Found, said: str, content: bytes) -> None:
    counts[said] += 1
    found.examples.setdefault(said, base64.b64encode(content[:20_000]).decode())


def main() -> None:
    """Try all kinds and write what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300_000, help="files in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="a kind")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    those = {name: kind for name, kind in kinds().items() if given.only in name}
    shares = sum(kind.share for kind in those.values())
    results: dict[str, Any] = {}
    with scratch() as folder:
        for number, (name, kind) in enumerate(those.items()):
            place = folder / str(number)
            place.mkdir()
            count = -(-given.count * kind.share // shares)
            start = time.monotonic()
            found = attempt(kind, int(count), f"{given.seed} {name}", place)
            results[name] = {
                "tried": found.tried,
                "read": found.read,
                "refused": found.refused,
                "untyped": dict(found.untyped),
                "unnamed": dict(found.unnamed),
                "slowest, s": round(found.slowest, 3),
                **({"examples": found.examples} if found.examples else {}),
            }
            said = {k: v for k, v in results[name].items() if k != "examples"}
            print(name, f"{time.monotonic() - start:.0f} s", said, flush=True)
    keys = ("tried", "read", "refused")
    total: dict[str, int] = {key: sum(found[key] for found in results.values()) for key in keys}
    total |= {
        key: sum(sum(found[key].values()) for found in results.values()) for key in ("untyped", "unnamed")
    }
    given.out.parent.mkdir(parents=True, exist_ok=True)
    command = f"python tests/python/mutations.py --count {given.count} --seed {given.seed}"
    content = {"command": command, "total": total, "kinds": results}
    given.out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(total)


if __name__ == "__main__":
    main()
