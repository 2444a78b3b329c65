"""Robots, meshes, people and norms as plain data, each figure with its origin."""
