"""Readers of robot descriptions and meshes, one file per format."""
