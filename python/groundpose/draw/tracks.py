"""Pictures of tracks: boxes with trails and speeds over the image, one by one or as a film."""

from __future__ import annotations

from collections import deque
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import FloatArray, input_error
from groundpose._writing import whole_path
from groundpose.draw.film import Film, check_film
from groundpose.draw.road_marks import RoadMarks
from groundpose.tracking import SeenVehicles, Tracks

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C564B", "#555555")
"""Of vehicles, by number."""
_TRAIL = 30
"""Frames."""
_KMH = 3.6
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))


def colour_of(number: int) -> str:
    """The same for a vehicle in all pictures."""
    return COLOURS[number % len(COLOURS)]


def corners(place: FloatArray, down: float, heading: float, size: FloatArray) -> FloatArray:
    """(8, 3) metres, corners of an upright box in the ground frame; the first two are at its front, below."""
    length, height, width = size.tolist()
    ahead = np.array([np.sin(heading), 0.0, np.cos(heading)])
    right = np.array([np.cos(heading), 0.0, -np.sin(heading)])
    base = np.array([place[0], down, place[1]])
    ground = [
        base + 0.5 * (along * length * ahead + across * width * right)
        for along, across in ((1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    return np.array([*ground, *(point - [0.0, height, 0.0] for point in ground)])


class TrackPictures:
    """Every frame drawn: boxes, trails of the last seconds, numbers and speeds; as pictures or as a film.

    A film is whole when the `with` block ends, and not there when that ends with an error.
    """

    def __init__(self, path: str | PathLike[str], marks: RoadMarks | None = None) -> None:
        """`path`: an mp4, or a picture with `{id}` in its name; `marks` are drawn below the vehicles. Raises
        InputError."""
        self.path, self._marks = Path(path), marks
        self._is_film = self.path.suffix.lower() == ".mp4"
        if self._is_film:
            check_film("--draw")
        elif self.path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
            raise input_error("--draw", "a name that ends in .png, .jpg or .mp4", self.path.name)
        elif "{id}" not in self.path.name:
            raise input_error("--draw", "a name with {id}, as tracks_{id}.jpg, or an mp4", self.path.name)
        self._trails: dict[int, deque[FloatArray]] = {}
        self._place = ExitStack()
        self._film: Film | None = None

    def __enter__(self) -> TrackPictures:
        """Begin the film."""
        if self._is_film:
            part = self._place.enter_context(whole_path(self.path))
            self._film = Film(part)
        return self

    def __exit__(self, *error: Any) -> None:
        """Complete the film."""
        if self._film is not None:
            self._film.close()
        self._place.__exit__(*error)

    def add(
        self,
        label: str | int,
        time: float,
        image: NDArray[np.uint8] | None,
        seen: SeenVehicles,
        now: Tracks,
        source: Path | None = None,
    ) -> None:
        """Draw a frame over its image (H, W, 3), or over white.

        Raises OSError; InputError for the name of the image itself, its file `source`, and for an image of
        another size than the film's.
        """
        picture = self._drawn(image, seen, now)
        if self._film is not None:
            self._film.add(np.asarray(picture), time)
            return
        name = f"{label:06d}" if isinstance(label, int) else str(label).replace("/", "_")
        target = self.path.with_name(self.path.name.replace("{id}", name))
        if source is not None and target.exists() and source.exists() and target.samefile(source):
            raise input_error("--draw", "a name that is not the image's", target)
        target.parent.mkdir(exist_ok=True)
        with whole_path(target) as part:
            picture.save(part, format="PNG" if target.suffix.lower() == ".png" else "JPEG", quality=90)

    def _drawn(self, image: NDArray[np.uint8] | None, seen: SeenVehicles, now: Tracks) -> Any:
        from PIL import Image, ImageDraw

        size = seen.view.camera.image_size or (round(2 * seen.view.camera.cx), round(2 * seen.view.camera.cy))
        pixels = np.full((size[1], size[0], 3), 255, np.uint8) if image is None else image
        picture = Image.fromarray(pixels)
        pen = ImageDraw.Draw(picture)
        downs = _downs(seen)
        usual = float(np.nanmedian(downs)) if np.isfinite(downs).any() else (seen.view.height or 1.5)
        if self._marks is not None:
            if len(now):
                self._marks.count(now, int(now.frame.max()) + 1)
            self._marks.paint(pen, seen.view, seen.view.height or usual)
        for k in range(len(now)):
            index = int(now.index[k])
            self._vehicle(pen, seen, now[k : k + 1], float(downs[index]) if index >= 0 else usual)
        gone = set(self._trails) - set(now.id.tolist())
        for number in gone:
            del self._trails[number]
        return picture

    def _vehicle(self, pen: Any, seen: SeenVehicles, row: Tracks, down: float) -> None:
        view, number = seen.view, int(row.id[0])
        colour = colour_of(number)
        x, z, heading = row.seen_from[0].tolist()
        size = np.where(np.isfinite(row.size[0]), row.size[0], [4.3, 1.5, 1.8])
        points = _pixels(view, corners(np.array([x, z]), down, heading, size))
        if np.isfinite(points).all():
            for a, b in _EDGES:
                pen.line([*points[a], *points[b]], fill=colour, width=4 if (a, b) == (0, 1) else 2)
            left, top = points[:, 0].min(), points[:, 1].min()
            said = "stands" if row.standing[0] else f"{round(_KMH * row.speed[0])} km/h"
            pen.text((left, top - 12), f"{number} {said}", fill=colour)
        trail = self._trails.setdefault(number, deque(maxlen=_TRAIL))
        trail.append(np.array([x, down, z]))
        dots = _pixels(view, np.array(trail))
        dots = dots[np.isfinite(dots).all(axis=1)]
        if len(dots) > 1:
            pen.line([tuple(dot) for dot in dots.tolist()], fill=colour, width=2)


def _pixels(view: Any, ground: FloatArray) -> FloatArray:
    """(n, 2) of points (n, 3) of the ground frame, as the lens shows them; NaN behind the camera."""
    ideal = view.project(ground @ view.R_camera_from_ground.T)
    known = np.isfinite(ideal).all(axis=1)
    ideal[known] = view.camera.distort(np.ascontiguousarray(ideal[known]))
    return np.asarray(ideal)


def _downs(seen: SeenVehicles) -> FloatArray:
    """(N,) metres from the camera down to the bottoms of the vehicles."""
    middles = (seen.R @ seen.bottom_centres[..., None])[..., 0] + seen.t
    return np.asarray(middles @ seen.view.R_camera_from_ground[:, 1])
