"""Figures of norms as data files: each value with source, edition and confidence, each file replaceable."""
