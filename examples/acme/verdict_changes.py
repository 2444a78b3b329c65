"""Sink of a company: a line for every verdict that changes."""

from __future__ import annotations

import csv
from pathlib import Path

from seerob.api import Closing, Sample, Scene, Sink, Snapshot, Verdict, Writer, no_formula


class VerdictChanges(Sink, frozen=True, kw_only=True):
    """A table of when which criterion changed its verdict."""

    file: str = "verdicts.csv"
    """Name of the file in the folder of the run."""

    def open(self, scene: Scene, meshes: dict[str, bytes], files: dict[str, bytes], folder: Path) -> Writer:
        """Begin the table; what it needs of the run once is in the scene."""
        return _Table(folder / self.file)


class _Table(Closing):
    def __init__(self, path: Path) -> None:
        self._file = path.open("w", newline="", encoding="utf-8")
        self._rows = csv.writer(self._file)
        self._rows.writerow(("t [s]", "criterion", "verdict", "value", "unit", "reason"))
        self._last: dict[str, Verdict | None] = {}

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Take one tick."""
        for result in snapshot.results:
            if result.name in self._last and self._last[result.name] is result.verdict:
                continue
            self._last[result.name] = result.verdict
            verdict = "" if result.verdict is None else result.verdict.value
            row = (f"{snapshot.t:.4f}", result.name, verdict, result.value, result.unit, result.reason)
            self._rows.writerow(no_formula(str(cell)) for cell in row)  # names come from files of others

    def close(self) -> None:
        """Finish the file."""
        self._file.close()
