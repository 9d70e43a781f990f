"""Where the ground under a camera lies on a map or on the earth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from groundpose._checks import FloatArray, finite, float_array, input_error, number, shaped, type_error
from groundpose._value import Value
from groundpose.tracking import Tracks

_AXIS, _FLATTENING = 6378137.0, 1.0 / 298.257223563
"""WGS84: metres, ratio."""
_POLAR_AXIS = _AXIS * (1.0 - _FLATTENING)
_SQUARE = _FLATTENING * (2.0 - _FLATTENING)
"""Of the first eccentricity."""
_LIMITS = {"latitude_deg": 89.999, "longitude_deg": 180.0}
"""At a pole there is no north."""
_FARTHEST = 1e5
"""Metres from the camera up to which the tangent plane is the earth."""


@dataclass(frozen=True)
class World(Value):
    """Where the ground under a camera lies: on a map, or with `at` on the earth.

    Places of the ground are metres right and forward of the camera, as `Tracks.place`; headings of the ground
    are those against the camera's forward direction. Both turn from forward to the right as a compass turns
    from north to east. The camera is where it stood in the first frame.

    >>> mast = gp.World(east=1200.0, north=3400.0, heading=0.5 * np.pi)
    >>> mast.map_of([[0.0, 20.0]]).round(6).tolist()
    [[1220.0, 3400.0]]
    >>> mast = gp.World.at(48.137, 11.575, heading=0.0)
    >>> mast.geographic_of([[0.0, 100.0]]).round(6).tolist()
    [[48.137899, 11.575]]

    Args:
        east, north: metres on the map of the point below the camera.
        heading: radians from the map's north to the east, of the camera's forward direction.
        latitude_deg, longitude_deg: of the map's origin; None: the map is not tied to the earth.

    Raises:
        InputError: a number that cannot be. TypeError: not a number.
    """

    east: float = 0.0
    north: float = 0.0
    heading: float = 0.0
    latitude_deg: float | None = None
    longitude_deg: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        values = {name: number(name, getattr(self, name)) for name in ("east", "north", "heading")}
        for name, value in values.items():
            if not math.isfinite(value):
                raise input_error(name, "a finite number", value)
        self._set(**values)
        if (self.latitude_deg is None) != (self.longitude_deg is None):
            raise input_error("longitude_deg", "both latitude_deg and longitude_deg, or none", "one of them")
        if self.latitude_deg is not None:
            for name, limit in _LIMITS.items():
                value = number(name, getattr(self, name))
                if not abs(value) <= limit:
                    raise input_error(name, f"degrees from {-limit:g} to {limit:g}", value)
                self._set(**{name: value})

    @classmethod
    def at(cls, latitude_deg: float, longitude_deg: float, heading: float = 0.0) -> World:
        """A camera at geographic coordinates (WGS84), which are the origin of its map. `heading`: radians
        from true north to the east."""
        return cls(heading=heading, latitude_deg=latitude_deg, longitude_deg=longitude_deg)

    @property
    def is_geographic(self) -> bool:
        """Whether the map is tied to the earth."""
        return self.latitude_deg is not None

    def map_of(self, ground: ArrayLike) -> FloatArray:
        """Places (..., 2) on the map, metres east and north, of places (..., 2) of the ground."""
        return np.asarray(_places("ground", ground) @ self._turn.T + [self.east, self.north])

    def ground_of(self, places: ArrayLike) -> FloatArray:
        """Places (..., 2) of the ground of places (..., 2) on the map: the inverse of `map_of`."""
        return np.asarray((_places("places", places) - [self.east, self.north]) @ self._turn)

    def geographic_of(self, ground: ArrayLike) -> FloatArray:
        """Latitudes and longitudes (..., 2) in degrees of places (..., 2) of the ground.

        The ground is the plane that touches WGS84's ellipsoid at the map's origin; heights above it are
        left out. Raises InputError without `latitude_deg`, or for places more than 100 km away.
        """
        origin, east_north = self._tangent()
        flat = self.map_of(ground)
        if (np.abs(flat) > _FARTHEST).any():
            raise input_error("ground", "places within 100 km of the map's origin", np.abs(flat).max())
        x, y, z = np.moveaxis(origin + flat @ east_north.T, -1, 0)
        # Bowring's formula: exact to a nanometre near the ellipsoid
        away = np.hypot(x, y)
        u = np.arctan2(z * _AXIS, away * _POLAR_AXIS)
        below = _SQUARE * _AXIS**2 / _POLAR_AXIS
        latitude = np.arctan2(z + below * np.sin(u) ** 3, away - _SQUARE * _AXIS * np.cos(u) ** 3)
        return np.asarray(np.degrees(np.stack([latitude, np.arctan2(y, x)], axis=-1)))

    def ground_of_geographic(self, degrees: ArrayLike) -> FloatArray:
        """Places (..., 2) of the ground of latitudes and longitudes (..., 2) in degrees: the inverse of
        `geographic_of`. Raises InputError as that."""
        origin, east_north = self._tangent()
        points = _places("degrees", degrees)
        if (np.abs(points[..., 0]) > 90.0).any():
            raise input_error("degrees", "latitudes from -90 to 90", np.abs(points[..., 0]).max())
        flat = (_earth(*np.moveaxis(np.radians(points), -1, 0)) - origin) @ east_north
        if (np.abs(flat) > _FARTHEST).any():
            raise input_error("degrees", "places within 100 km of the map's origin", points.tolist())
        return self.ground_of(flat)

    def heading_of(self, ground: ArrayLike) -> FloatArray:
        """Headings on the map, radians from 0 to 2 pi from north to the east, of headings of the ground."""
        given = float_array("ground", ground, "numbers")
        return np.asarray(np.mod(given + self.heading, 2.0 * math.pi))

    def covariance_of(self, ground: ArrayLike) -> FloatArray:
        """Covariances (N, 2, 2) on the map, square metres, of those of places of the ground."""
        return np.asarray(self._turn @ shaped("ground", ground, ("N", 2, 2)) @ self._turn.T)

    def columns(self, tracks: Tracks) -> dict[str, FloatArray]:
        """What the map adds to the rows of tracks, by the names that files have for it: `map_x`, `map_y`
        (metres east and north) or `latitude`, `longitude` (degrees), `east_sigma`, `north_sigma` (metres,
        without the errors of this world itself), `map_heading_deg` (0 to 360)."""
        if not isinstance(tracks, Tracks):
            raise type_error("tracks", "Tracks", tracks)
        names = self.place_columns
        places = self.place_of(tracks.place)
        spread = np.sqrt(np.diagonal(self.covariance_of(tracks.place_covariance), axis1=1, axis2=2))
        return {
            **{name: places[:, k] for k, name in enumerate(names)},
            **{name: spread[:, k] for k, name in enumerate(("east_sigma", "north_sigma"))},
            "map_heading_deg": np.asarray(np.degrees(self.heading_of(tracks.heading))),
        }

    @property
    def place_columns(self) -> tuple[str, str]:
        """What the numbers of `place_of` are called in files."""
        return ("latitude", "longitude") if self.is_geographic else ("map_x", "map_y")

    def place_of(self, ground: ArrayLike) -> FloatArray:
        """`geographic_of` if the map is tied to the earth, else `map_of`."""
        return self.geographic_of(ground) if self.is_geographic else self.map_of(ground)

    @property
    def _turn(self) -> FloatArray:
        """(2, 2), to east and north from right and forward."""
        s, c = math.sin(self.heading), math.cos(self.heading)
        return np.array([[c, s], [-s, c]])

    def _tangent(self) -> tuple[FloatArray, FloatArray]:
        """The map's origin (3,) in metres from the middle of the earth, and (3, 2) its east and north."""
        if self.latitude_deg is None or self.longitude_deg is None:
            raise input_error("world", "one with latitude and longitude", "one of a map")
        latitude, longitude = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        s, c, sl, cl = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
        axes = np.array([[-sl, -s * cl], [cl, -s * sl], [0.0, c]])
        return _earth(np.array(latitude), np.array(longitude)), axes


def _places(argument: str, value: Any) -> FloatArray:
    places = float_array(argument, value, "numbers of shape (..., 2)")
    if places.shape[-1:] != (2,):
        raise input_error(argument, "shape (..., 2)", f"shape {places.shape}")
    return finite(argument, places)


def _earth(latitude: FloatArray, longitude: FloatArray) -> FloatArray:
    """(..., 3) metres from the middle of the earth, of points on the ellipsoid in radians."""
    across = _AXIS / np.sqrt(1.0 - _SQUARE * np.sin(latitude) ** 2)
    ring = across * np.cos(latitude)
    up = (1.0 - _SQUARE) * across * np.sin(latitude)
    return np.stack([ring * np.cos(longitude), ring * np.sin(longitude), up], axis=-1)
