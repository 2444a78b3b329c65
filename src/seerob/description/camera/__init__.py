"""Cameras that look at the cell: lens, pose, printed boards."""
