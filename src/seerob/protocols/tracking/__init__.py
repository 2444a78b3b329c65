"""Protocols of motion capture: suits, cameras, trackers."""
