"""Grippers and other tools of the library."""
