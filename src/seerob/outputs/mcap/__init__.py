"""The recording as it is written, for ourselves and for foreign viewers."""
