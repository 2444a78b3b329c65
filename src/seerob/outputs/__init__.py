"""Sinks: the recorder, tables, workbooks, the report."""
