"""Meshes as solids: checked, mended, measured, simplified, written."""
