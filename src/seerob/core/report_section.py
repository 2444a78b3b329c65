"""A section that a command adds to the report: sentences and tables, in plain data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReportTable:
    """A table of words and figures that are already written out."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


@dataclass(frozen=True)
class ReportSection:
    """What stands under one heading."""

    title: str
    sentences: tuple[str, ...] = ()
    tables: tuple[ReportTable, ...] = ()
    picture: bytes | None = None
    """PNG."""
    caption: str = ""
    """Caption of the picture."""
