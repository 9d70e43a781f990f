"""The classes of vehicles: one table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class VehicleClass:
    """One row of the table.

    Args:
        name: of the class; its shape model is `models/<name>.npz`.
        kitti_type: what KITTI calls it. A type that several classes share means the first of them.
    """

    name: str
    kitti_type: str


TABLE: tuple[VehicleClass, ...] = (
    VehicleClass("car", "Car"),
    VehicleClass("van_bus", "Van"),
    VehicleClass("pickup", "Car"),  # KITTI counts pickups as cars
    VehicleClass("box_truck", "Truck"),
)

CLASSES: tuple[str, ...] = tuple(row.name for row in TABLE)
"""Names of the classes of vehicles; the order is that of the network's answer and never changes."""
