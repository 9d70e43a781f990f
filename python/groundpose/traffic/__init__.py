"""Lines and lanes on the road: who crosses them, when and how fast."""

from groundpose.traffic.crossings import Crossing, CrossingCounter
from groundpose.traffic.shapes import Lane, Line
from groundpose.traffic.summary import Flow, TrafficSummary

__all__ = ["Crossing", "CrossingCounter", "Flow", "Lane", "Line", "TrafficSummary"]
