"""Recordings read back: their format, their index, and the files that travel in them."""
