"""The renderer of the virtual drive."""

from groundpose.lab.drive.render.renderer import Renderer

__all__ = ["Renderer"]
