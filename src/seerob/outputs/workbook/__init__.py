"""Workbooks and their sheets."""
