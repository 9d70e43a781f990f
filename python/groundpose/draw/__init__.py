"""Pictures: poses over the image, the bird's-eye view, contact sheets.

matplotlib is imported when it is first used.
"""

from groundpose.draw.birds_eye import draw_birds_eye, footprint_on_ground, position_ellipse
from groundpose.draw.overlay import draw_overlay
from groundpose.draw.picture import check_path, draw_poses
from groundpose.draw.sheet import Tile, contact_sheet

__all__ = [
    "Tile",
    "check_path",
    "contact_sheet",
    "draw_birds_eye",
    "draw_overlay",
    "draw_poses",
    "footprint_on_ground",
    "position_ellipse",
]
