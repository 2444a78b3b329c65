"""Exact distances, depths, rays and fields of the shapes of the scene."""
