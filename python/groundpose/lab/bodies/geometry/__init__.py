"""Meshes out of closed components: lofts, lathes, boxes, slabs on surfaces. Knows nothing of vehicles."""
