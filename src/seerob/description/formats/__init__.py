"""Readers of robot descriptions, one file per format, and the files that they name."""
