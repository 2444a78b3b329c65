"""Posture scores as pure functions: bands, published tables, and what is not known as a span."""
