"""Meshes from closed components: lofts, lathes, boxes, slabs on surfaces. Independent of vehicles."""
