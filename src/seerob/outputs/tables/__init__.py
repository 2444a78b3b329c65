"""Rows of a run, for tables of any format."""
