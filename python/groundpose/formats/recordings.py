"""Images and cameras of recordings: bags of ROS 1 and ROS 2 (package rosbags, extra `ros`), MCAP files with
messages of ROS 2 (that too) or of Foxglove (packages mcap and mcap-protobuf-support, extra `mcap`).

Images are sensor_msgs/Image and CompressedImage, foxglove.RawImage and CompressedImage; cameras
sensor_msgs/CameraInfo and foxglove.CameraCalibration.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from groundpose._checks import existing, input_error
from groundpose._core import InputError
from groundpose.formats.calibrations import camera_of_message
from groundpose.formats.extras import extra_package
from groundpose.types import Camera

ENDINGS = frozenset((".mcap", ".db3", ".bag"))
"""Of names of recordings; a bag of ROS 2 is a folder with a file metadata.yaml."""
_CAMERAS = ("sensor_msgs/msg/CameraInfo", "foxglove.CameraCalibration")
_CHANNELS = {
    **{"rgb8": (3, "RGB"), "bgr8": (3, "BGR"), "rgba8": (4, "RGBA"), "bgra8": (4, "BGRA")},
    **{"mono8": (1, "L"), "8UC1": (1, "L"), "8UC3": (3, "BGR")},
}
"""Of ROS's and Foxglove's encodings: bytes of a pixel, and their order."""


@dataclass(frozen=True, eq=False)
class RecordedImage:
    """One image of a recording.

    Attributes:
        number: from 0. time: seconds since the first image, by its stamp. topic: where it comes from.
        image: (H, W, 3) uint8, red, green, blue.
        camera: that of its topic; None: the recording has none.
    """

    number: int
    time: float
    topic: str
    image: NDArray[np.uint8]
    camera: Camera | None


def is_recording(path: Path) -> bool:
    """Whether the name is one of a recording."""
    return (path / "metadata.yaml").is_file() if path.is_dir() else path.suffix.lower() in ENDINGS


def read_recording(
    path: str | PathLike[str], topic: str | None = None
) -> Iterator[RecordedImage | InputError]:
    """The images of a topic in order; for one that cannot be decoded its error.

    Args:
        path: a bag (a folder, .db3, .bag) or an MCAP file.
        topic: of the images; None: the only one that has any.

    Raises:
        OSError: no such file. InputError: no recording, a package is not installed, no images, several topics
            with images and none is named, or none of this name, an unusable camera.
    """
    file = existing(path)
    source: _Source = _mcap(file) if file.suffix.lower() == ".mcap" else _Bag(file)
    return _images(source, file, topic)


class _Source(Protocol):
    """A recording that is open."""

    topics: Mapping[str, str]
    """Types of the messages by topic."""

    def messages(self, topics: list[str]) -> Iterator[tuple[str, int, Any]]:
        """Topic, stamp in nanoseconds and message, in order."""


def _images(source: _Source, path: Path, wanted: str | None) -> Iterator[RecordedImage | InputError]:
    topic = _image_topic(source, path, wanted)
    decode = _IMAGES[source.topics[topic]]
    camera: Camera | None = None
    first: int | None = None
    for number, (_, stamp, message) in enumerate(source.messages([topic])):
        if first is None:
            first, camera = stamp, _camera(source, path, topic, message)
        try:
            image = decode(message)
        except (InputError, OSError, ValueError, SyntaxError) as error:  # of Pillow's, for damaged pictures
            yield InputError(f"{path}: {topic}, image {number}: {error}")
            continue
        yield RecordedImage(number, 1e-9 * (stamp - first), topic, image, camera)


def _image_topic(source: _Source, path: Path, wanted: str | None) -> str:
    found = sorted(topic for topic, kind in source.topics.items() if kind in _IMAGES)
    listed = ", ".join(found) or "none"
    if wanted is not None:
        if wanted not in found:
            raise input_error(f"{path}: topic", f"one of images: {listed}", wanted)
        return wanted
    if len(found) != 1:
        raise input_error(f"{path}: topic", "a topic of images, by name where there are several", listed)
    return found[0]


def _camera(source: _Source, path: Path, topic: str, image: Any) -> Camera | None:
    """The camera in the frame of an image; of several in that frame the one beside its topic."""
    found: dict[str, Any] = {}
    topics = [name for name, kind in source.topics.items() if kind in _CAMERAS]
    for name, _, message in source.messages(topics) if topics else ():
        found.setdefault(name, message)
        if len(found) == len(topics):
            break
    same = {name: m for name, m in found.items() if _frame_of(m) == _frame_of(image)} or found
    if len(same) > 1:
        parent = topic.removesuffix("/compressed").rpartition("/")[0]
        same = {name: m for name, m in same.items() if name.rpartition("/")[0] == parent}
        if len(same) != 1:
            raise input_error(f"{path}: {topic}", "one camera of its frame or beside it", ", ".join(found))
    for name, message in same.items():
        rectified = "rect" in topic.removesuffix("/compressed").rpartition("/")[2]
        return camera_of_message(_members(message), f"{path}: {name}", rectified)
    return None


def _frame_of(message: Any) -> str:
    return str(message.header.frame_id if hasattr(message, "header") else message.frame_id)


def _members(message: Any) -> dict[str, Any]:
    """Of a camera, as ROS 1 calls them."""
    sides = {name: int(getattr(message, name)) for name in ("width", "height")}
    size = sides if all(sides.values()) else {}
    letters = {n: getattr(message, n if hasattr(message, n) else n.lower()) for n in "DKRP"}
    arrays = {name: [float(x) for x in values] for name, values in letters.items() if len(values)}
    return {**size, "distortion_model": message.distortion_model, **arrays}


def _compressed(message: Any) -> NDArray[np.uint8]:
    with Image.open(io.BytesIO(bytes(message.data))) as picture:
        return np.asarray(picture.convert("RGB"))


def _raw(message: Any) -> NDArray[np.uint8]:
    if message.encoding not in _CHANNELS:
        raise input_error("encoding", f"one of {', '.join(_CHANNELS)}", message.encoding)
    size, order = _CHANNELS[message.encoding]
    data = np.frombuffer(bytes(message.data), np.uint8)
    width, height, step = int(message.width), int(message.height), int(message.step)
    if step < size * width or len(data) < step * height:
        raise input_error("data", f"{height} rows of {size * width} bytes", f"{len(data)} in rows of {step}")
    rows = data[: step * height].reshape(height, step)[:, : size * width].reshape(height, width, size)
    if order == "L":
        return np.repeat(rows, 3, axis=2)
    return np.ascontiguousarray(rows[:, :, [order.index(letter) for letter in "RGB"]])


_IMAGES: dict[str, Callable[[Any], NDArray[np.uint8]]] = {
    "sensor_msgs/msg/Image": _raw,
    "sensor_msgs/msg/CompressedImage": _compressed,
    "foxglove.RawImage": _raw,
    "foxglove.CompressedImage": _compressed,
}
"""Decoders by the type of the message."""


class _Bag:
    """A recording with messages of ROS."""

    def __init__(self, path: Path) -> None:
        self._rosbags = extra_package("rosbags.highlevel", "rosbags", "ros")
        self._path = path
        with self._open() as bag:
            self.topics: Mapping[str, str] = {c.topic: c.msgtype for c in bag.connections}

    def _open(self) -> Any:
        typesys = extra_package("rosbags.typesys", "rosbags", "ros")
        store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)  # for bags without definitions
        try:
            bag = self._rosbags.AnyReader([self._path], default_typestore=store)
            bag.open()
        except Exception as error:  # rosbags and what it reads with have their own for each kind of damage
            raise input_error(str(self._path), "a recording", str(error) or type(error).__name__) from None
        bag.close()
        return self._rosbags.AnyReader([self._path], default_typestore=store)

    def messages(self, topics: list[str]) -> Iterator[tuple[str, int, Any]]:
        with self._open() as bag:
            wanted = [c for c in bag.connections if c.topic in topics]
            for connection, stamp, raw in bag.messages(connections=wanted):
                yield connection.topic, stamp, bag.deserialize(raw, connection.msgtype)


def _mcap(path: Path) -> _Source:
    """By the encoding of its messages."""
    reader = extra_package("mcap.reader", "mcap", "mcap")
    try:
        with path.open("rb") as stream:
            summary = reader.make_reader(stream).get_summary()
            schemas = {} if summary is None else summary.schemas
    except Exception as error:  # mcap has its own for each kind of damage
        if isinstance(error, OSError):
            raise
        raise input_error(str(path), "an MCAP file", str(error) or type(error).__name__) from None
    if any(schema.encoding == "protobuf" for schema in schemas.values()):
        channels = {} if summary is None else summary.channels
        return _Foxglove(path, {c.topic: schemas[c.schema_id].name for c in channels.values() if c.schema_id})
    return _Bag(path)


class _Foxglove:
    """An MCAP file with messages in protobuf."""

    def __init__(self, path: Path, topics: Mapping[str, str]) -> None:
        self._path, self.topics = path, topics
        self._reader = extra_package("mcap.reader", "mcap", "mcap")
        self._decoder = extra_package("mcap_protobuf.decoder", "mcap-protobuf-support", "mcap")

    def messages(self, topics: list[str]) -> Iterator[tuple[str, int, Any]]:
        with self._path.open("rb") as stream:
            made = self._reader.make_reader(stream, decoder_factories=[self._decoder.DecoderFactory()])
            for _, channel, message, said in made.iter_decoded_messages(topics=topics):
                yield channel.topic, message.log_time, said
