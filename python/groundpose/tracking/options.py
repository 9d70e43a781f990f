"""What a tracker is told before it sees anything."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal

from groundpose import _core
from groundpose._checks import count, number, text
from groundpose._value import Value

_DEFAULTS = _core.default_track_options()
CameraMotion = Literal["static", "odometry", "unknown"]


@dataclass(frozen=True)
class TrackOptions(Value):
    """What a tracker is told before it sees anything.

    Args:
        camera_motion: "static": the camera stays where it is; "odometry": every frame says how it moved;
            "unknown": it moves and nobody says how, so that places and speeds are relative to it and do not
            tell where a vehicle faces.
        acceleration_sigma: m/s^2, of a vehicle's acceleration along its axis.
        turning_sigma: rad/s, of the change of its yaw rate within a second.
        speed_sigma: m/s, of its speed before anything is seen of it.
        constant_fraction: variance of a distance that is the same in all frames of a vehicle, in stated
            variances: its class is not as large as it is. Nothing but motion of the camera makes a tracker
            surer of it than one picture is.
        slow_fraction: variance of bearings and headings that is the same as long as the picture is, in
            stated ones; of distances a quarter of it.
        own_fraction: variance that every frame has of its own, in stated ones; of distances half as much.
        error_time: s, within which a network forgets its errors when the picture stays the same.
        gate: squared statistical distance up to which a pose can belong to a vehicle.
        longest_gap: s; a vehicle not seen for longer has left.
        least_sightings: until a vehicle is one.
        longest_history: frames of a vehicle that are kept to be smoothed; when there are so many, the older
            half is handed out.

    Raises:
        InputError: a value out of range. TypeError: a value of another type.
    """

    camera_motion: CameraMotion = _DEFAULTS["camera_motion"]
    acceleration_sigma: float = _DEFAULTS["acceleration_sigma"]
    turning_sigma: float = _DEFAULTS["turning_sigma"]
    speed_sigma: float = _DEFAULTS["speed_sigma"]
    constant_fraction: float = _DEFAULTS["constant_fraction"]
    slow_fraction: float = _DEFAULTS["slow_fraction"]
    own_fraction: float = _DEFAULTS["own_fraction"]
    error_time: float = _DEFAULTS["error_time"]
    gate: float = _DEFAULTS["gate"]
    longest_gap: float = _DEFAULTS["longest_gap"]
    least_sightings: int = _DEFAULTS["least_sightings"]
    longest_history: int = _DEFAULTS["longest_history"]
    _values: dict[str, Any] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check types here and values in the core."""
        checks = {str: text, float: number, int: count}
        given = {f.name: getattr(self, f.name) for f in fields(self) if f.init}
        values = {name: checks[type(_DEFAULTS[name])](name, value) for name, value in given.items()}
        _core.Tracker(values)
        self._set(**values, _values=values)

    def tracker(self) -> _core.Tracker:
        """The core's, which has seen nothing."""
        return _core.Tracker(self._values)
