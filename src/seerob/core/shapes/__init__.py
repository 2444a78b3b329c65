"""Shapes with one meaning each, on the floor and in the room."""
