"""A table that never holds more than so many rows: when it is full, every second one goes."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Mapping, Sequence

Cell = str | float | int | None


class ThinnedTable:
    """Rows evenly spread over what was offered, at least half as many as may be.

    Args:
        most: Rows at most, 2 or more.
        titles: Columns that are known at the start.
    """

    def __init__(self, most: int, titles: Sequence[str] = ()) -> None:
        self.titles: list[str] = list(titles)
        self.offered = 0
        self._most, self._stride = most, 1
        self._places = {title: k for k, title in enumerate(self.titles)}
        self._rows: list[tuple[array[float], dict[int, str]]] = []

    @property
    def thinned(self) -> bool:
        """Whether rows were left out."""
        return self._stride > 1

    def wants(self) -> bool:
        """Offer a row: whether it is to be kept, and `keep` to be called."""
        wanted = self.offered % self._stride == 0
        self.offered += 1
        if wanted and len(self._rows) >= self._most:
            del self._rows[1::2]
            self._stride *= 2
            wanted = (self.offered - 1) % self._stride == 0
        return wanted

    def keep(self, cells: Mapping[str, str | float | bool | None]) -> None:
        """Keep a row; a column that is new goes to the end."""
        for title in cells:
            if title not in self._places:
                self._places[title] = len(self.titles)
                self.titles.append(title)
        numbers, texts = array("d", [math.nan]) * len(self.titles), {}
        for title, value in cells.items():
            if isinstance(value, str):
                texts[self._places[title]] = value
            elif value is not None:
                numbers[self._places[title]] = float(value)
        self._rows.append((numbers, texts))

    def keep_numbers(self, values: Sequence[float | None]) -> None:
        """Keep a row of numbers, one per column."""
        self._rows.append((array("d", [math.nan if v is None else v for v in values]), {}))

    def rows(self) -> Iterator[list[Cell]]:
        """All rows, equally wide; NaN where there is nothing."""
        width = len(self.titles)
        for numbers, texts in self._rows:
            row: list[Cell] = [*numbers, *([math.nan] * (width - len(numbers)))]
            for place, text in texts.items():
                row[place] = text
            yield row
