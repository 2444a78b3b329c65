"""Volumes in voxels and as polygons: swept, reachable, extruded."""
