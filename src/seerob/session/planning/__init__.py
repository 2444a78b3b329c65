"""Paths of a robot that keep a distance from everything, and the proof that they do."""
