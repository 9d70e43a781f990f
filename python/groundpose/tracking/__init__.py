"""Vehicles followed over time: one identity, one size and one front for all frames of a vehicle."""

from groundpose.tracking.options import TrackOptions
from groundpose.tracking.seen import SeenVehicles
from groundpose.tracking.tracker import Tracker
from groundpose.tracking.tracks import Tracks

__all__ = ["SeenVehicles", "TrackOptions", "Tracker", "Tracks"]
