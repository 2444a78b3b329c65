"""Readers of mesh files, one per format: bytes in, triangles in the file's own unit and axes out."""
