"""Motions from files: tables, trajectories, waypoints, motion capture."""
