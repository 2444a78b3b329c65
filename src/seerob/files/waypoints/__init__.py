"""Programmed waypoints: read from files, made into continuous motion; knows no physics engine."""
