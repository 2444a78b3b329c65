"""Volumes in voxels: swept and reachable."""
