"""The renderer of the virtual drive."""

from groundpose.simulation.render.renderer import Renderer

__all__ = ["Renderer"]
